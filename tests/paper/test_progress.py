"""How far long work has got."""

import logging

import pytest

from vigauge_paper.run import progress as module


def test_where_there_is_no_terminal_the_log_says_how_far_work_has_got(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catches control characters in a log, and items that get lost."""
    monkeypatch.setattr(module, "_EVERY_S", 0.0)
    with caplog.at_level(logging.INFO, "vigauge"):
        assert list(module.progress(iter("abc"), "hall", "frame", 3)) == ["a", "b", "c"]
    assert caplog.messages[-1] == "hall: 2 of 3 frames"
    assert capsys.readouterr() == ("", "")
