"""Fetching, end to end, from a host on this machine that serves a nested bundle of EuRoC's shape."""

import hashlib
import io
import json
import logging
import os
import shutil
import stat
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from support import ROOT
from support.asl import write_sequence
from support.file_server import Host, serve
from vigauge.errors import DataError, FetchError
from vigauge.recordings.asl.sequence import read_sequence
from vigauge_paper.fetch import download
from vigauge_paper.fetch.archive import extract_sequence
from vigauge_paper.fetch.download import Patience
from vigauge_paper.fetch.sequence import Fetched, fetch_sequence
from vigauge_paper.fetch.sources import COLUMNS, read_sources

NAME = "XX_01_easy"
BUNDLE, MEMBER = "/bundles/room/content", f"room/{NAME}/{NAME}.zip"
HASTE = Patience(attempts=3, first_wait_s=0.01, longest_wait_s=0.05, timeout_s=5.0)
NOTE = "landing page https://example.org/euroc"


def zip_of(folder: Path) -> bytes:
    """A sequence's zip as EuRoC's are: mav0 at the top, and what a Mac leaves behind."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, str(path.relative_to(folder)))
        archive.writestr("__MACOSX/mav0/._cam0", b"x")
    return stream.getvalue()


def bundle_with(inner: bytes, member: str = MEMBER, compression: int = zipfile.ZIP_STORED) -> bytes:
    """A room's bundle: the zip of the sequence after a bag that nobody needs."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        archive.writestr(f"room/{NAME}/{NAME}.bag", os.urandom(400_000), zipfile.ZIP_STORED)
        archive.writestr(member, inner)
        archive.writestr("room/calibration.bag", os.urandom(300_000), zipfile.ZIP_STORED)
    return stream.getvalue()


@pytest.fixture
def host() -> Iterator[Host]:
    with serve() as host:
        yield host


@pytest.fixture
def sequence_folder(tmp_path: Path) -> Path:
    return write_sequence(tmp_path / "sequence")


@pytest.fixture
def inner(sequence_folder: Path) -> bytes:
    return zip_of(sequence_folder)


def write_sources(path: Path, *rows: tuple[str, str, int | str, str]) -> Path:
    """A table of (sequence, url, bytes, sha256)."""
    lines = [",".join(COLUMNS)]
    lines += [f"{name},host {k},{url},{size},{sha},{NOTE}" for k, (name, url, size, sha) in enumerate(rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


Fetch = Callable[..., Fetched]


@pytest.fixture
def fetch(tmp_path: Path) -> Fetch:
    """Fetch from the rows given into ``tmp_path/euroc``."""

    def run(*rows: tuple[str, str, int | str, str], patience: Patience = HASTE) -> Fetched:
        table = write_sources(tmp_path / "sources.csv", *rows)
        return fetch_sequence(NAME, read_sources(table), table, tmp_path / "euroc", patience)

    return run


def nested_rows(host: Host, inner: bytes, **options) -> list[tuple[str, str, int | str, str]]:
    """The bundle on the host, and the rows of bundle and sequence as the real table has them."""
    bundle = bundle_with(inner, **options)
    host.files[BUNDLE] = bundle
    url = host.url(BUNDLE)
    return [
        ("room", url, len(bundle), hashlib.sha256(bundle).hexdigest()),
        (NAME, f"{url}#{MEMBER}", len(inner), hashlib.sha256(inner).hexdigest()),
    ]


def require_whole(tmp_path: Path, original: Path) -> None:
    """The fetched folder is the original, read by the reader; nothing of the work is left."""
    made = tmp_path / "euroc" / NAME
    for path in original.rglob("*"):
        if path.is_file():
            assert (made / path.relative_to(original)).read_bytes() == path.read_bytes()
    assert len(read_sequence(made).frames.t_ns) == 4
    assert not (made / "__MACOSX").exists()
    left = [path.name for path in (tmp_path / "euroc" / ".downloads").iterdir()]
    assert not [name for name in left if NAME in name]


def require_nothing(tmp_path: Path) -> None:
    """No sequence, not even a part of one, after a failure."""
    assert not (tmp_path / "euroc" / NAME).exists()
    assert not [path for path in downloads(tmp_path) if path.is_dir()]


def downloads(tmp_path: Path) -> list[Path]:
    """What earlier attempts at the sequence left."""
    return list((tmp_path / "euroc" / ".downloads" / NAME).iterdir())


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_sequence_is_cut_out_of_a_bundle_by_ranges(
    host, inner, fetch, tmp_path, sequence_folder, compression
):
    """Catches 12 GB fetched for 1.5: the bags of the bundle must stay where they are."""
    fetched = fetch(*nested_rows(host, inner, compression=compression))
    require_whole(tmp_path, sequence_folder)
    assert fetched.sha256 == hashlib.sha256(inner).hexdigest()
    assert fetched.sha256_expected
    assert host.bytes_asked < len(inner) + 400_000
    record = json.loads((tmp_path / "euroc" / NAME / "fetched.json").read_text())
    assert (record["url"], record["member"]) == (host.url(BUNDLE), MEMBER)


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_host_without_ranges_gives_the_whole_bundle(
    host, inner, fetch, tmp_path, sequence_folder, compression
):
    """Catches a fetch that needs ranges; the bundle stays, and a second sequence of it needs no download."""
    host.ranges = False
    rows = nested_rows(host, inner, compression=compression)
    fetch(*rows)
    require_whole(tmp_path, sequence_folder)
    shutil.rmtree(tmp_path / "euroc" / NAME)
    before = len(host.requests)
    fetch(*rows)
    require_whole(tmp_path, sequence_folder)
    assert len(host.requests) == before + 1, "only the probe"


def test_mirror_that_has_the_zip_itself(host, inner, fetch, tmp_path, sequence_folder):
    host.files["/x.zip"] = inner
    fetched = fetch((NAME, host.url("/x.zip"), "", ""))
    require_whole(tmp_path, sequence_folder)
    assert not fetched.sha256_expected


def test_broken_connection_is_resumed_where_it_broke(
    host, inner, fetch, tmp_path, sequence_folder, monkeypatch
):
    """Catches a download that starts over, and one that takes the part for the whole."""
    monkeypatch.setattr(download, "_CHUNK_BYTES", 512)
    host.files["/x.zip"] = inner
    third = len(inner) // 3
    host.cut = [None, third, third, None]
    fetch((NAME, host.url("/x.zip"), len(inner), hashlib.sha256(inner).hexdigest()))
    require_whole(tmp_path, sequence_folder)
    starts = [int(span.removeprefix("bytes=").split("-")[0]) for _, span in host.requests[1:]]
    assert starts[0] == 0
    assert starts[1] > 0
    assert starts[2] > starts[1]


def test_next_run_goes_on_where_a_broken_one_stopped(
    host, inner, fetch, tmp_path, sequence_folder, monkeypatch
):
    """Catches what there is being thrown away between runs, or kept when the file has changed since."""
    monkeypatch.setattr(download, "_CHUNK_BYTES", 512)
    host.files["/x.zip"] = inner
    row = (NAME, host.url("/x.zip"), len(inner), hashlib.sha256(inner).hexdigest())
    host.cut = [None, len(inner) // 2, 0, 0, 0]
    with pytest.raises(FetchError, match="broke off 3 times in a row"):
        fetch(row)
    require_nothing(tmp_path)
    (part,) = downloads(tmp_path)
    kept = part.stat().st_size
    assert kept > 0
    host.requests.clear()
    fetch(row)
    require_whole(tmp_path, sequence_folder)
    assert host.requests[1][1] == f"bytes={kept}-{len(inner) - 1}"


def test_file_that_changed_between_runs_is_fetched_from_its_start(
    host, inner, fetch, tmp_path, sequence_folder, monkeypatch
):
    """Catches two versions of a file glued together."""
    monkeypatch.setattr(download, "_CHUNK_BYTES", 512)
    host.files["/x.zip"] = b"other" * (len(inner) // 5 + 1)
    host.cut = [None, len(inner) // 2, 0, 0, 0]
    with pytest.raises(FetchError):
        fetch((NAME, host.url("/x.zip"), "", ""))
    host.files["/x.zip"] = inner
    fetch((NAME, host.url("/x.zip"), len(inner), hashlib.sha256(inner).hexdigest()))
    require_whole(tmp_path, sequence_folder)


def test_truncated_file_without_ranges_is_refused_after_bounded_attempts(host, inner, fetch, tmp_path):
    """Fault 1: catches half a zip unpacked, and an endless loop over a host that always breaks off."""
    host.ranges = False
    host.files["/x.zip"] = inner
    host.cut = [100] * 20
    with pytest.raises(FetchError) as caught:
        fetch((NAME, host.url("/x.zip"), "", ""))
    assert "broke off 3 times in a row" in str(caught.value)
    assert len(host.requests) <= 1 + HASTE.attempts
    require_nothing(tmp_path)


def test_truncated_zip_is_refused(host, inner, fetch, tmp_path):
    """Fault 1: a file that is short on the host itself, so that the connection tells nothing."""
    host.files["/x.zip"] = inner[:-200]
    with pytest.raises(FetchError, match="must be a whole zip archive"):
        fetch((NAME, host.url("/x.zip"), "", ""))
    require_nothing(tmp_path)


def test_wrong_checksum_is_deleted_and_refused(host, inner, fetch, tmp_path):
    """Fault 1: catches other bytes of the right length taken for the sequence."""
    rows = nested_rows(host, inner)
    with pytest.raises(FetchError) as caught:
        fetch(rows[0], (NAME, rows[1][1], len(inner), "0" * 64))
    message = str(caught.value)
    assert "must have the checksum of the table" in message
    assert NOTE in message and "EUROC_ROOT" in message
    require_nothing(tmp_path)
    assert not downloads(tmp_path)


def test_wrong_checksum_of_a_whole_bundle_is_refused(host, inner, fetch, tmp_path):
    host.ranges = False
    rows = nested_rows(host, inner)
    with pytest.raises(FetchError, match="checksum of the table"):
        fetch((*rows[0][:3], "0" * 64), rows[1])
    require_nothing(tmp_path)
    assert not list((tmp_path / "euroc" / ".downloads").glob("*.zip"))


def test_other_size_than_in_the_table_is_refused_before_the_download(host, inner, fetch):
    """Catches gigabytes fetched of a file that cannot be the one."""
    host.files["/x.zip"] = inner
    with pytest.raises(FetchError, match="must have the size of the table"):
        fetch((NAME, host.url("/x.zip"), len(inner) + 1, ""))
    assert len(host.requests) == 1


def test_web_page_instead_of_a_zip_is_refused(host, fetch, tmp_path):
    """Fault 1: catches an error page saved as a zip, by its type, or by what it holds where that lies."""
    host.files["/x.zip"] = b"<html>please accept our cookies</html>"
    with pytest.raises(FetchError, match="must be a whole zip archive"):
        fetch((NAME, host.url("/x.zip"), "", ""))
    host.kind = "text/html; charset=utf-8"
    with pytest.raises(FetchError, match="not a web page"):
        fetch((NAME, host.url("/x.zip"), "", ""))
    require_nothing(tmp_path)


def test_busy_host_is_waited_for(host, inner, fetch, tmp_path, sequence_folder):
    """Fault 2: catches giving up at the first 429, and Retry-After ignored."""
    rows = nested_rows(host, inner)
    host.answers = [(429, {"Retry-After": "1"}), (503, {})]
    waits = []
    original = download.time.sleep
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(download.time, "sleep", lambda s: (waits.append(s), original(0))[0])
        fetch(*rows, patience=Patience(3, 0.2, 5.0, 5.0))
    require_whole(tmp_path, sequence_folder)
    assert waits[0] == 1.0
    assert waits[1] == pytest.approx(0.4)


@pytest.mark.parametrize("after", ["100000", "soon", "-3", "Fri, 31 Dec 2100 23:59:59 GMT"])
def test_host_that_stays_busy_is_left_after_bounded_waits(host, inner, fetch, tmp_path, after):
    """Fault 2: catches an endless loop, a wait of a day that the host asks for, and a broken header."""
    rows = nested_rows(host, inner)
    host.answers = [(429, {"Retry-After": after})] * 50
    with pytest.raises(FetchError) as caught:
        fetch(*rows)
    assert "it answered HTTP 429 Too Many Requests after 3 attempts" in str(caught.value)
    assert len(host.requests) == HASTE.attempts
    require_nothing(tmp_path)


def test_dead_host_fails_and_names_what_to_do(fetch, tmp_path):
    """Fault 2: catches an endless loop, and a message that leaves the reader alone."""
    with serve() as gone:
        url = gone.url("/x.zip")
    with pytest.raises(FetchError) as caught:
        fetch((NAME, url, "", ""))
    message = str(caught.value)
    assert "server must answer" in message and "refused" in message
    assert NOTE in message and "EUROC_ROOT" in message and str(tmp_path / "sources.csv") in message
    require_nothing(tmp_path)


def test_missing_file_is_not_asked_for_again(host, fetch):
    with pytest.raises(FetchError, match="HTTP 404"):
        fetch((NAME, host.url("/gone.zip"), "", ""))
    assert len(host.requests) == 1


def test_next_mirror_is_tried(host, inner, fetch, tmp_path, sequence_folder):
    host.files["/x.zip"] = inner
    fetched = fetch((NAME, host.url("/gone.zip"), "", ""), (NAME, host.url("/x.zip"), "", ""))
    assert fetched.host == "host 1"
    require_whole(tmp_path, sequence_folder)


@pytest.mark.parametrize("ranges", [True, False])
def test_bundle_without_the_sequence_lists_what_it_has(host, inner, fetch, tmp_path, ranges):
    """Fault 3: catches a KeyError, or a guess, where the path inside the bundle has changed."""
    host.ranges = ranges
    rows = nested_rows(host, inner, member=f"room/renamed/{NAME}.zip")
    with pytest.raises(FetchError) as caught:
        fetch(*rows)
    assert f"bundle must contain {MEMBER}; found: room/renamed/{NAME}.zip" in str(caught.value)
    require_nothing(tmp_path)


def test_zip_without_mav0_lists_what_it_has(host, fetch, tmp_path):
    """Fault 3, one level down."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("data/mav0/cam0/data.csv", "x")
        archive.writestr("README", "x")
    host.files["/x.zip"] = stream.getvalue()
    with pytest.raises(FetchError, match=r"must have mav0 at its top; found: README, data"):
        fetch((NAME, host.url("/x.zip"), "", ""))
    require_nothing(tmp_path)


def test_sequence_that_does_not_read_is_not_put_in_place(host, sequence_folder, fetch, tmp_path):
    """Catches a zip that is whole and holds half a sequence."""
    (sequence_folder / "mav0" / "imu0" / "data.csv").unlink()
    host.files["/x.zip"] = zip_of(sequence_folder)
    with pytest.raises(FetchError, match=r"must hold a readable sequence: .*imu0"):
        fetch((NAME, host.url("/x.zip"), "", ""))
    require_nothing(tmp_path)


def test_full_disk_is_told_before_the_download(host, inner, fetch, monkeypatch):
    """Catches a disk filled to the last byte by a download that could not fit."""
    rows = nested_rows(host, inner)
    usage = shutil.disk_usage(".")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=1000))
    with pytest.raises(FetchError, match="disk must have .* GB free to fetch and unpack"):
        fetch(*rows)
    assert host.bytes_asked < len(inner) + 300_000


def test_run_stopped_while_unpacking_leaves_the_zip_for_the_next(
    host, inner, fetch, tmp_path, sequence_folder, monkeypatch
):
    """Catches 1.5 GB fetched again after Ctrl-C, or half a sequence left in place."""
    rows = nested_rows(host, inner)

    def stop(folder: Path) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("vigauge_paper.fetch.sequence.read_sequence", stop)
        fetch(*rows)
    require_nothing(tmp_path)
    *looked, downloaded = host.requests
    assert downloaded[1].startswith("bytes=4001"), "the member lies right behind the bag of 400 kB"
    host.requests.clear()
    fetch(*rows)
    require_whole(tmp_path, sequence_folder)
    assert host.requests == looked, "the directory of the bundle, and nothing of the sequence"


def test_existing_data_are_never_replaced(host, inner, fetch, tmp_path):
    (tmp_path / "euroc" / NAME).mkdir(parents=True)
    (tmp_path / "euroc" / NAME / "mine").write_text("x")
    with pytest.raises(DataError, match="never replaced"):
        fetch(*nested_rows(host, inner))
    assert [p.name for p in (tmp_path / "euroc" / NAME).iterdir()] == ["mine"]


def test_server_that_sends_another_range_is_refused(host, inner, fetch):
    """Catches bytes from elsewhere in the file, or of a file that changed, glued in."""
    rows = nested_rows(host, inner)
    host.answers = [(206, {"Content-Range": f"bytes {span}"}) for span in ("0-0/5000", "0-4998/5000")]
    with pytest.raises(FetchError, match=r"server must send bytes \d+-4999/5000 \(found 'bytes 0-4998"):
        fetch((rows[1][0], rows[1][1], "", ""))


# Archives that mean harm: nothing may be written outside, and nothing may be left inside.


def hostile(tmp_path: Path, *members: tuple[str | zipfile.ZipInfo, bytes]) -> Path:
    with zipfile.ZipFile(tmp_path / "x.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mav0/first", b"x")
        for name, data in members:
            archive.writestr(name, data)
    return tmp_path / "x.zip"


def link(name: str, mode: int = stat.S_IFLNK) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.create_system = 3
    info.external_attr = (mode | 0o777) << 16
    return info


def refused(tmp_path: Path, path: Path, match: str, largest: int = 10**6) -> None:
    """Nothing is written outside of the folder, which the caller deletes."""
    before = sorted(tmp_path.parent.rglob("*"))
    with pytest.raises(FetchError, match=match):
        extract_sequence(path, NAME, tmp_path / "out", "x.zip", largest)
    shutil.rmtree(tmp_path / "out", ignore_errors=True)
    assert sorted(tmp_path.parent.rglob("*")) == before


@pytest.mark.parametrize(
    "name", ["../outside", "mav0/../../outside", "/outside", "mav0/a\\..\\..\\x", "C:\\outside", "C:outside"]
)
def test_member_that_leads_out_of_the_folder_is_refused(tmp_path, name):
    refused(tmp_path, hostile(tmp_path, (name, b"x")), "inside the folder")


@pytest.mark.parametrize("mode", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR])
def test_links_and_devices_are_refused(tmp_path, mode):
    """Catches a link through which a later member writes anywhere."""
    refused(tmp_path, hostile(tmp_path, (link("mav0/cam0", mode), b"/etc")), "no links or devices")


def test_archive_that_unpacks_to_too_much_is_refused(tmp_path):
    """Catches a bomb, by what it declares, before a byte is written."""
    refused(tmp_path, hostile(tmp_path, ("mav0/x", bytes(2_000_000))), "at most 1000000 bytes")


def test_archive_that_declares_too_little_is_refused(tmp_path):
    """Catches a bomb that lies about its size."""
    path = hostile(tmp_path, ("mav0/x", bytes(2_000_000)))
    data = path.read_bytes()
    path.write_bytes(data.replace((2_000_000).to_bytes(4, "little"), (10).to_bytes(4, "little")))
    refused(tmp_path, path, "whole zip archive")


@pytest.mark.parametrize("name", ["mav0/first/x", "mav0/" + "x" * 300])
def test_names_that_no_folder_can_have_are_refused(tmp_path, name):
    """Catches the error of the operating system passed on as it is."""
    refused(tmp_path, hostile(tmp_path, (name, b"y")), "must be a whole zip archive")


def test_member_at_a_place_outside_of_the_archive_is_refused(tmp_path):
    """Catches the error of a seek to before the start of the file."""
    data = bytearray(hostile(tmp_path, ("mav0/x", b"y")).read_bytes())
    end = data.rindex(b"PK\x05\x06")
    start = int.from_bytes(data[end + 16 : end + 20], "little")
    data[end + 16 : end + 20] = (start + 1000).to_bytes(4, "little")  # shifts every place by -1000
    (tmp_path / "x.zip").write_bytes(data)
    refused(tmp_path, tmp_path / "x.zip", "must be a whole zip archive")


def test_encrypted_and_strangely_packed_members_are_refused(tmp_path):
    path = hostile(tmp_path, ("mav0/x", b"y"))
    data = bytearray(path.read_bytes())
    at = data.rindex(b"PK\x01\x02")
    data[at + 8] |= 1
    path.write_bytes(data)
    refused(tmp_path, path, "encrypted")
    data[at + 8] ^= 1
    data[at + 10] = 99
    path.write_bytes(data)
    refused(tmp_path, path, "compression")


def test_wrong_crc_leaves_nothing(host, fetch, tmp_path):
    """Catches a half-unpacked folder: the first members are good."""
    path = hostile(tmp_path, (zipfile.ZipInfo("mav0/x"), os.urandom(1000)))
    data = bytearray(path.read_bytes())
    data[data.index(b"mav0/x") + 100] ^= 1
    host.files["/x.zip"] = bytes(data)
    with pytest.raises(FetchError, match="must be a whole zip archive: Bad CRC-32"):
        fetch((NAME, host.url("/x.zip"), "", ""))
    require_nothing(tmp_path)
    assert not downloads(tmp_path)


# The table.


def test_shipped_table_is_valid_and_names_the_configured_sequences():
    """Catches a mistyped checksum or address, and a sequence of the configuration without a source."""
    root = ROOT
    sources = read_sources(root / "data" / "euroc_sources.csv")
    names = {source.name for source in sources}
    assert {"MH_01_easy", "V1_01_easy", "machine_hall", "vicon_room1"} <= names
    for source in sources:
        if source.member is not None:
            assert source.member.endswith(f"/{source.name}/{source.name}.zip")
        assert "landing page" in source.note


@pytest.mark.parametrize(
    ("row", "field"),
    [
        ("../x,h,http://a/b,,,", "sequence"),
        ("x,h,ftp://a/b,,,", "url"),
        ("x,h,file:///etc/passwd,,,", "url"),
        ("x,h,http://[,,,", "url"),
        ("x,h,http://[#a,,,", "url"),
        ("x,h,http://a/b,-1,,", "bytes"),
        ("x,h,http://a/b,1e9,,", "bytes"),
        ("x,h,http://a/b,,abc,", "sha256"),
        ("x,h,http://a/b,", None),
        ("x,h,http://a/b,,,,,", None),
    ],
)
def test_bad_row_of_the_table_is_named(tmp_path, row, field):
    (tmp_path / "s.csv").write_text(",".join(COLUMNS) + "\n" + row + "\n")
    with pytest.raises(DataError) as caught:
        read_sources(tmp_path / "s.csv")
    assert (caught.value.row, caught.value.field) == (2, field)


def test_unknown_sequence_is_refused_with_a_list_of_the_known_ones(fetch):
    with pytest.raises(DataError, match="it has other"):
        fetch(("other", "http://127.0.0.1:1/x", "", ""))


# The command.


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    call = [sys.executable, "-m", "vigauge_paper.commands.fetch_euroc", *map(str, arguments)]
    return subprocess.run(call, capture_output=True, text=True, check=False, timeout=60)


def test_command_fetches_records_and_does_not_fetch_again(host, inner, tmp_path, sequence_folder):
    rows = nested_rows(host, inner)
    table = write_sources(tmp_path / "sources.csv", *rows)
    flags = ["--sequence", NAME, "--sources", table, "--output", tmp_path / "euroc", "--first-wait", "0.01"]
    done = command(*flags, "--record", tmp_path / "record.json")
    assert done.returncode == 0, done.stderr
    assert f"EUROC_ROOT={tmp_path / 'euroc'}" in done.stderr
    require_whole(tmp_path, sequence_folder)
    first = (tmp_path / "record.json").read_bytes()
    (tmp_path / "record.json").unlink()
    asked = len(host.requests)
    assert command(*flags, "--record", tmp_path / "record.json").returncode == 0
    assert (tmp_path / "record.json").read_bytes() == first
    assert len(host.requests) == asked


def test_command_that_fails_is_one_message_and_status_2(tmp_path):
    with serve() as gone:
        table = write_sources(tmp_path / "sources.csv", (NAME, gone.url("/x.zip"), "", ""))
    done = command(
        "--sequence", NAME, "--sources", table, "--output", tmp_path / "euroc",
        "--attempts", "2", "--first-wait", "0.01",
    )  # fmt: skip
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert NOTE in done.stderr and "EUROC_ROOT" in done.stderr


def test_waits_are_told(host, inner, fetch, caplog):
    """Catches minutes of silence."""
    rows = nested_rows(host, inner)
    host.answers = [(429, {})]
    with caplog.at_level(logging.WARNING):
        fetch(*rows)
    assert "HTTP 429; trying again" in caplog.text
