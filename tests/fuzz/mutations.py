"""Malformed files from valid ones: bytes spoilt anywhere, and spoilt inside an intact container."""

import io
import struct
import warnings
import zipfile
import zlib
from random import Random

import numpy as np

# Pieces at which readers of text and numbers have been known to trip.
TEXT_TOKENS = [
    b"nan", b"-inf", b"1e999", b"-1e-999", b"1_0", b"0x10", b"--1", b"+", b"-", b".", b"e", b"1e",
    b"9223372036854775807", b"9223372036854775808", b"-1", b"0", b"1403636580863555584",
    b"1403636580.86", b"9" * 5000, b"0." + b"3" * 5000, b"\x00", b"\xef\xbb\xbf", b"\r\n", b"\n\n",
    b"\r", b",", b",,", b"#", b"\xff\xfe", b"\xc3\x28", "\u2028".encode(), "\u0663".encode(),
    "\U0001f600".encode(), b"\x1b[31m", b"../x.png", b"/etc/passwd", b"C:\\x.png", b"..\\x",
    b"a/../../x", b"x" * 300, b"x/" * 3000, b"~", b"$HOME", b"link.png", b"outside.png", b".", b"..",
    b"\"", b"'",
]  # fmt: skip
YAML_TOKENS = [
    b"&a [*a]", b"*a", b"&a ", b"<<: *a", b"!!python/object/apply:os.system ['true']", b"!!int x",
    b"!!bool x", b"!!timestamp x", b"!!binary x", b"!!set {a}", b"!!omap [a: 1]", b"!x y", b"? ", b"- ",
    b": ", b"{", b"}", b"[", b"]", b"[" * 3000, b"{a: " * 200, b"---\n", b"...\n", b"%YAML 9.9\n",
    b"%YAML:1.0\n", b"%TAG ! x\n", b"|\n", b">\n", b"2020-13-45", b"2020-01-01T99:99:99Z", b"1:60:99",
    b"0b2", b"0o9", b".nan", b".inf", b"null", b"yes", b"0x" + b"f" * 5000, b"1" * 400, b"\t", b"\x85",
    b"'", b'"\\x', b"[1]: 2",
]  # fmt: skip


def spoil_bytes(rng: Random, data: bytes, tokens: list[bytes], others: list[bytes]) -> bytes:
    """One to six random edits anywhere."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        at = rng.randrange(len(out) + 1)
        span = min(rng.choice((1, 1, 2, 4, 16, 200)), len(out) - at)
        kind = rng.randrange(9)
        if kind == 0 and out:
            out[min(at, len(out) - 1)] ^= 1 << rng.randrange(8)
        elif kind == 1:
            out[at : at + span] = rng.randbytes(span)
        elif kind == 2:
            del out[at : at + span]
        elif kind == 3:
            out[at:at] = out[at : at + span] * rng.choice((1, 2, 50))
        elif kind == 4:
            del out[at:]
        elif kind == 5:
            other = rng.choice(others)
            start = rng.randrange(len(other) + 1)
            out[at : at + span] = other[start : start + rng.choice((1, 10, 1000))]
        elif kind == 6:
            out[at : at + span] = struct.pack(
                rng.choice(("<q", ">q", "<I", ">I", "<H")), rng.choice((0, 1, 0x7FFF, 0xFFFF))
            )
        else:
            out[at : at + (span if kind == 7 else 0)] = rng.choice(tokens) if tokens else rng.randbytes(4)
    return bytes(out[:100_000])


def spoil_fields(rng: Random, data: bytes, tokens: list[bytes], separator: bytes) -> bytes:
    """Lines and fields of a table exchanged, repeated, lost or replaced."""
    rows = [line.split(separator) for line in data.split(b"\n")]
    for _ in range(rng.choice((1, 1, 2, 4))):
        i, j = rng.randrange(len(rows)), rng.randrange(len(rows))
        k = rng.randrange(len(rows[i]))
        kind = rng.randrange(6)
        if kind == 0:
            rows[i], rows[j] = rows[j], rows[i]
        elif kind == 1:
            rows[i] = list(rows[j])
        elif kind == 2:
            rows[i].insert(k, rng.choice(tokens))
        elif kind == 3 and len(rows[i]) > 1:
            del rows[i][k]
        else:
            rows[i][k] = rng.choice(tokens)
    return b"\n".join(separator.join(row) for row in rows)


def spoil_png(rng: Random, data: bytes) -> bytes:
    """Chunks of a PNG spoilt, exchanged, repeated or lost, with checksums that fit again."""
    chunks = []
    at = 8
    while at + 12 <= len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    for _ in range(rng.choice((1, 1, 2))):
        i = rng.randrange(len(chunks))
        name, body = chunks[i]
        kind = rng.randrange(6)
        if kind == 0 and name == b"IHDR":
            side = rng.choice((0, 1, 39, 41, 100_000, 2**31 - 1, 2**32 - 1))
            depth, colour = rng.choice((1, 2, 4, 8, 16, 7)), rng.choice((0, 2, 3, 4, 6, 5))
            sides = rng.choice(((side, 30), (40, side), (40, 30)))
            body = struct.pack(">IIBBBBB", *sides, depth, colour, 0, 0, rng.randrange(2))
        elif kind == 1:
            body = body + bytes(100_000) if name != b"IDAT" else PIXEL_BOMB
        elif kind == 2:
            name = rng.choice(
                (b"PLTE", b"tRNS", b"zTXt", b"iCCP", b"acTL", b"fcTL", b"fdAT", b"eXIf", b"IDAT", b"IEND")
            )
        elif kind == 3:
            chunks.insert(rng.randrange(len(chunks) + 1), (name, body))
        else:
            body = spoil_bytes(rng, body, [], [data])
        chunks[i] = (name, body)
    return data[:8] + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks
    )


# Ten megabytes of black, and a member that unpacks to more than is allowed.
PIXEL_BOMB = zlib.compress(bytes(10_000_000), 9)
ZEROS = bytes(1_100_000)

NPY_HEADERS = [
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-1, -3), }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (1,), }",
    "{'descr': '<U1000000000', 'fortran_order': False, 'shape': (), }",
    "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), 'x': " + "(" * 500 + ")" * 500 + "}",
    "{'descr': '<M8[ns]', 'fortran_order': True, 'shape': (1,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (0, 99999999999999999999999),}",
    "__import__('os').system('true')", "{", "'''", "\x00", "{'descr': '<f8'}", "((" * 3000,
]  # fmt: skip


def _npy(header: str, body: bytes, version: tuple[int, int]) -> bytes:
    text = header.encode("latin1", "replace") + b"\n"
    length = struct.pack("<H" if version == (1, 0) else "<I", len(text))
    return b"\x93NUMPY" + bytes(version) + length + text + body


def _strange_array(rng: Random) -> bytes:
    """A whole .npy file of a kind, type or size that a reader does not expect."""
    stream = io.BytesIO()
    shape = rng.choice(((), (0,), (3,), (1, 3), (4, 3, 3), (2, 0)))
    dtype = rng.choice(("f8", "f4", "i8", "i4", "u1", "?", "c16", "U5", "S5"))
    value = rng.choice((0, 1, -1, 7, 2**31, 10**12, 10**18))
    array = np.full(shape, value).astype(dtype, casting="unsafe")
    if dtype == "f8" and rng.random() < 0.5:
        array = np.full(shape, rng.choice((np.nan, np.inf, 1e300, 1e-320)))
    np.save(stream, array)
    return stream.getvalue()


def spoil_npz(rng: Random, data: bytes) -> bytes:
    """Members of an archive spoilt, renamed, exchanged or lost, in a zip whose checksums fit."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    for _ in range(rng.choice((1, 1, 2))):
        i = rng.randrange(len(members))
        name, body = members[i]
        kind = rng.randrange(7)
        if kind == 0:
            version = rng.choice(((1, 0), (2, 0), (3, 0), (9, 9)))
            body = _npy(rng.choice(NPY_HEADERS), body[128:], version)
        elif kind == 1:
            body = _strange_array(rng)
        elif kind == 2:
            name = rng.choice((name, "count.npy", "kind.npy", "00/x.npy", "../x.npy", "/x", "0/", "-1/a.npy"))
        elif kind == 3:
            body = members[rng.randrange(len(members))][1]
        elif kind == 4 and len(members) > 1:
            del members[i]
            continue
        else:
            body = spoil_bytes(rng, body, [], [body])
        members[i] = (name, body)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive:
        for name, body in dict(members).items():
            archive.writestr(name, body)
    return stream.getvalue()


def zip_of(members: list[tuple[str, bytes]]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, body in members:
            archive.writestr(name, body)
    return stream.getvalue()


ZIP_NAMES = [
    "../x", "/x", "mav0/../../x", "mav0/a/b", "mav0/a", "mav0", "mav0/", "C:\\x", "mav0\\..\\x",
    "mav0/\u0000x", "mav0/" + "x" * 300, "mav0/" + "x/" * 500, "XX/mav0/a", "MAV0/A", "mav0/.", "mav0//a",
    "mav0/con", "/", "mav0/\u00e9",
]  # fmt: skip


def spoil_zip(rng: Random, data: bytes) -> bytes:
    """Members of a zip renamed, doubled, turned into links, or of another declared size."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    stream = io.BytesIO()
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(stream, "w") as archive:
        for name, body in members * rng.choice((1, 1, 1, 2)):
            if rng.random() < 0.4:
                name = rng.choice(ZIP_NAMES)
            info = zipfile.ZipInfo("x")
            info.filename = name
            info.compress_type = rng.choice((0, 8, 8, 8, 12))
            info.create_system = 3
            if rng.random() < 0.2:
                info.external_attr = rng.choice((0o120777, 0o010777, 0o040755, 0o100644, 0)) << 16
            if rng.random() < 0.03:
                body = ZEROS
            archive.writestr(info, body)
    out = stream.getvalue()
    return spoil_bytes(rng, out, [], [data]) if rng.random() < 0.4 else out
