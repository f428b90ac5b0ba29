"""Writing all or nothing: what is left behind when a writer fails."""

import json

import numpy as np
import pytest

from vigauge.files import atomic_path, write_json, write_rows, write_text


class Interrupted(BaseException):
    """As KeyboardInterrupt: no Exception."""


@pytest.mark.parametrize("failure", [ValueError, Interrupted])
@pytest.mark.parametrize("existed", [True, False])
def test_a_failed_write_leaves_nothing_new(tmp_path, failure, existed):
    """Catches a half-written result that a workflow would take for a finished one."""
    target = tmp_path / "result.csv"
    if existed:
        target.write_text("old", encoding="utf-8")
    with pytest.raises(failure), atomic_path(target) as temporary:
        temporary.write_text("half", encoding="utf-8")
        raise failure
    assert [path.name for path in tmp_path.iterdir()] == (["result.csv"] if existed else [])
    if existed:
        assert target.read_text(encoding="utf-8") == "old"


def test_a_good_write_replaces_the_old_file(tmp_path):
    """Catches a temporary file left beside the result, and a lost ending that writers look at."""
    target = tmp_path / "new folder" / "result.npz"
    for text in ("first", "second"):
        with atomic_path(target) as temporary:
            assert temporary.suffix == ".npz"
            assert temporary.parent == target.parent
            assert not temporary.name.startswith("result")
            temporary.write_text(text, encoding="utf-8")
            assert not target.exists() or target.read_text(encoding="utf-8") == "first"
        assert target.read_text(encoding="utf-8") == text
    assert [path.name for path in target.parent.iterdir()] == ["result.npz"]


def test_a_writer_that_wrote_nothing_is_an_error(tmp_path):
    """Catches a missing result that passes for a written one."""
    with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "result.csv"):
        pass


def test_json_is_sorted_and_strict(tmp_path):
    """Catches bytes that depend on the order of insertion, and NaN, which is no JSON."""
    write_json(tmp_path / "a.json", {"b": 1, "a": [1.5, None]})
    write_json(tmp_path / "b.json", {"a": [1.5, None], "b": 1})
    text = (tmp_path / "a.json").read_bytes()
    assert text == (tmp_path / "b.json").read_bytes()
    assert json.loads(text) == {"a": [1.5, None], "b": 1}
    assert text.endswith(b"}\n")
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "c.json", {"a": float("nan")})
    assert not (tmp_path / "c.json").exists()


def test_rows_keep_all_digits_and_line_ends(tmp_path):
    """Catches rounding on the way to disk, and line ends of the platform."""
    value = float(np.nextafter(0.1, 1.0))
    write_rows(tmp_path / "rows.csv", [{"name": "a,b", "x": value}, {"name": "c", "x": 2}])
    lines = (tmp_path / "rows.csv").read_bytes()
    assert lines == b'name,x\n"a,b",' + repr(value).encode() + b"\nc,2\n"
    with pytest.raises(ValueError, match="fieldnames"):
        write_rows(tmp_path / "bad.csv", [{"a": 1}, {"b": 2}])
    assert not (tmp_path / "bad.csv").exists()


def test_text_is_written_as_it_is(tmp_path):
    """Catches another encoding or translated line ends."""
    write_text(tmp_path / "a.md", "sigma: \u03c3\nend\n")
    assert (tmp_path / "a.md").read_bytes() == "sigma: \u03c3\nend\n".encode()
