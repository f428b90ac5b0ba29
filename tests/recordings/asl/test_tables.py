"""The strict reader of ``data.csv``: every way a file can be bad, one by one, with its line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vigauge.errors import DataError
from vigauge.recordings.asl.tables import Table, read_table

T0 = 1403636580863555584
GOOD = f"#timestamp [ns],x,y\n{T0},1.5,-2\n{T0 + 1},3e-1,4\n"


def read(tmp_path: Path, text: str | bytes, widths=(3,), **options) -> Table:
    path = tmp_path / "data.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path, widths, **options)


def refused(tmp_path: Path, text: str | bytes, **options) -> DataError:
    """The error of a file, whose numbers are read too."""
    with pytest.raises(DataError) as caught:
        read(tmp_path, text, **options).numbers()
    assert caught.value.file == str(tmp_path / "data.csv")
    return caught.value


@given(stamps=st.lists(st.integers(10**17, 2**63 - 1), min_size=1, max_size=5, unique=True))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_stamps_never_pass_through_a_float(tmp_path, stamps):
    """Catches a float64 on the way, which keeps only multiples of 128 or 256 ns."""
    stamps = sorted(stamps)
    table = read(tmp_path, "#t,x\n" + "".join(f"{t},0\n" for t in stamps), widths=(2,))
    assert table.t_ns.dtype == np.int64
    assert table.t_ns.tolist() == stamps


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(GOOD, id="plain"),
        pytest.param("\ufeff" + GOOD, id="byte-order mark"),
        pytest.param(GOOD.replace("\n", "\r\n"), id="CRLF"),
        pytest.param(GOOD.replace("\n", ",\n", 1), id="trailing comma in the header"),
        pytest.param(GOOD.replace(",", " , "), id="spaces"),
        pytest.param(GOOD.replace("\n", "\n\n"), id="blank lines"),
        pytest.param(GOOD.split("\n", 1)[1], id="no header"),
        pytest.param(GOOD[1:], id="header without #"),
        pytest.param(GOOD[:-1], id="no line end at the end"),
    ],
)
def test_harmless_variants_read_the_same(tmp_path, text):
    """Catches a reader that loses a row or a column over a matter of style."""
    table = read(tmp_path, text)
    assert table.t_ns.tolist() == [T0, T0 + 1]
    assert table.numbers().tolist() == [[1.5, -2.0], [0.3, 4.0]]
    assert table.n_repeated == 0


def test_missing_file_is_named(tmp_path):
    with pytest.raises(DataError, match="nowhere.csv: file must exist"):
        read_table(tmp_path / "nowhere.csv", (2,))


@pytest.mark.parametrize("text", ["", "\n\n", "#timestamp,x,y\n", "timestamp,x,y\n"])
def test_file_without_rows_is_refused(tmp_path, text):
    """Catches an empty array that fails far from here."""
    assert "at least one row" in refused(tmp_path, text).rule


def test_bytes_that_are_not_text_are_refused(tmp_path):
    assert "UTF-8" in refused(tmp_path, b"\x89PNG\r\n\x1a\n\xff\xfe").rule


@pytest.mark.parametrize(
    ("text", "row", "rule"),
    [
        (f"#t,x,y\n{T0},1,2\n{T0 + 5},1\n", 3, "must have 3 columns"),
        (f"#t,x,y\n{T0},1,2\n{T0 + 5},1,2,3\n", 3, "must have 3 columns"),
        (f"#t,x,y\n\n{T0},1,2,3\n", 3, "must have 3 columns"),
    ],
)
def test_wrong_number_of_columns_names_the_line(tmp_path, text, row, rule):
    """Catches a check of the first row only, and lines counted without header and blanks."""
    error = refused(tmp_path, text)
    assert (error.row, rule in error.rule) == (row, True)


@pytest.mark.parametrize("value", ["nan", "inf", "-Infinity", "1e999", "", "abc", "1_0", "0x10", "1,5e"])
def test_value_that_is_no_finite_number_names_line_and_column(tmp_path, value):
    """Catches NaN that would reach the Hessian, and texts that ``float`` takes for numbers."""
    error = refused(tmp_path, f"#t,x,y\n{T0},1,2\n{T0 + 5},{value},2\n".replace("1,5e,2", "1,5e"))
    assert error.row == 3
    assert error.field in ("x", "y")


@pytest.mark.parametrize(
    ("stamp", "hint"),
    [
        ("1403636580.863555", "look like seconds"),
        ("1.403636580863555e+18", "float"),
        ("1403636580863555584.0", "float"),
        ("", "integer"),
        ("-5", "integer"),
        ("12x", "integer"),
        (str(2**63), "integer"),
    ],
)
def test_stamp_that_is_no_integer_is_refused(tmp_path, stamp, hint):
    error = refused(tmp_path, f"#t,x,y\n{T0},0,0\n{stamp},1,2\n")
    assert (error.row, error.field, error.value) == (3, "timestamp", stamp)
    assert hint in error.rule


@pytest.mark.parametrize(("unit", "divisor"), [("s", 10**9), ("ms", 10**6), ("us", 10**3)])
@pytest.mark.parametrize("n_rows", [1, 40])
def test_stamps_in_another_unit_are_recognised(tmp_path, unit, divisor, n_rows):
    """Catches intervals a thousand times too short that would pass as data."""
    rows = "".join(f"{(T0 + k * 10**9) // divisor},1,2\n" for k in range(n_rows))
    error = refused(tmp_path, "#t,x,y\n" + rows)
    assert error.rule.endswith(f"these look like {unit}")


def test_stamps_that_count_from_power_on_are_nanoseconds(tmp_path):
    """Catches a check by magnitude alone: a clock near 2 s or 25 min is small, and right."""
    for start in (0, 2_000_000_000, 1_500_000_000_000):
        rows = "".join(f"{start + 50_000_000 * k},1,2\n" for k in range(100))
        assert len(read(tmp_path, rows).t_ns) == 100


@pytest.mark.parametrize("start", [950 * 10**9, 2_000 * 10**9, 2 * 10**15, 1_700_000_000])
def test_a_short_recording_long_after_power_on_is_in_nanoseconds(tmp_path, start):
    """Catches a nanosecond clock taken for a date in ms or us: 33 minutes or 23 days after power-on."""
    rows = "".join(f"{start + 5_000_000 * k},1,2\n" for k in range(400))
    assert len(read(tmp_path, rows).t_ns) == 400


def test_unsorted_stamps_are_refused(tmp_path):
    error = refused(tmp_path, f"#t,x,y\n{T0},1,2\n{T0 - 1},1,2\n")
    assert (error.row, error.value) == (3, T0 - 1)
    assert "must increase" in error.rule


def test_repeated_rows_are_dropped_and_counted_only_on_request(tmp_path):
    """Catches silent loss: identical rows may go, but the count must tell."""
    text = f"#t,x,y\n{T0},1,2\n{T0},1,2\n{T0},1,2\n{T0 + 1},1,2\n"
    table = read(tmp_path, text, drop_repeated=True)
    assert (table.t_ns.tolist(), table.n_repeated) == ([T0, T0 + 1], 2)
    assert table.lines.tolist() == [2, 5]
    assert refused(tmp_path, text).row == 3


def test_repeated_stamp_with_other_values_is_refused(tmp_path):
    error = refused(tmp_path, f"#t,x,y\n{T0},1,2\n{T0},1,3\n", drop_repeated=True)
    assert (error.row, error.field) == (3, "timestamp")
