"""What a run says on the terminal, with a small workflow in the place of the paper's."""

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest

from recovery.kill import ROOT
from snakemake_logger_plugin_vigauge import error_sentence

pytestmark = pytest.mark.workflow

# As in the paper's workflow, jobs write into their logs.
SNAKEFILE = """
rule all:
    input: "data/b.csv"
rule a:
    output: "data/a.csv", "data/a.npz"
    log: "logs/a.log"
    message: "Making a"
    shell: "(touch {output}; echo 'a: 120 of 300 trials'; sleep 3) &> {log}"
rule b:
    input: "data/a.csv"
    output: "data/b.csv"
    log: "logs/b.log"
    message: "Making b"
    shell: "({b}) &> {log}"
"""
FINE = "touch {output}"
BAD_ROW = "echo 'error: data/a.csv, row 3: must be finite (found nan)'; echo 'a last word'; exit 2"


def command(folder: Path, b: str, *arguments: str) -> list[str]:
    (folder / "Snakefile").write_text(SNAKEFILE.replace("{b}", b), "utf-8")
    return [sys.executable, "-m", "snakemake", "--cores", "1", "--logger", "vigauge", *arguments]


def lines(folder: Path, b: str, *arguments: str) -> list[str]:
    """What is printed where standard error is no terminal."""
    done = subprocess.run(command(folder, b, *arguments), cwd=folder, capture_output=True, text=True)
    assert not re.search(r"[\r\x1b]", done.stderr), "control characters in a file"
    return done.stderr.splitlines()


def test_one_line_a_stage(tmp_path: Path) -> None:
    """Catches walls of reasons, and a count, a time or a file that is missing."""
    begin, a, b, everything = lines(tmp_path, FINE)
    assert begin == "Stages to make: 3; each prints a line when it ends"
    assert re.fullmatch(r"\[1/3\] +[3-9]\.\d s  Making a: data/a.csv and 1 more", a)
    assert re.fullmatch(r"\[2/3\] +\d+\.\d s  Making b: data/b.csv", b)
    assert re.fullmatch(r"\[3/3\] +\d+\.\d s  all: all is made", everything)
    (again,) = lines(tmp_path, FINE)
    assert again.startswith("Nothing to be done")


def test_a_failure_says_why_and_how_to_repeat_it(tmp_path: Path) -> None:
    """Catches a failure whose reason is only in a file, that is told twice, or whose command is wrong."""
    _, _, failed, sentence, log, again = lines(tmp_path, BAD_ROW)
    assert re.fullmatch(r"failed after \d+\.\d s: Making b", failed)
    assert sentence == "  error: data/a.csv, row 3: must be finite (found nan)"
    assert log == "  log: logs/b.log"
    repeated = subprocess.run(
        again.removeprefix("  again: "), shell=True, cwd=tmp_path, capture_output=True, text=True
    )
    assert repeated.returncode == 1
    assert [line for line in repeated.stderr.splitlines() if line in (sentence, again)] == [sentence, again]


@pytest.mark.parametrize(
    ("log", "sentence"),
    [
        ("", "it left no message"),
        ("halfway\n\n", "no error message; its last line: halfway"),
        ("Traceback:\nvigauge.errors.FetchError: no name\nbye", "vigauge.errors.FetchError: no name"),
        ("solve.py: error: the following arguments are required", "solve.py: error: the following arguments"),
        ("  error [units]: a.csv: in m/s^2\n  unusable", "error [units]: a.csv: in m/s^2"),
        ("10 trials\n/usr/bin/bash: line 1: 7 Killed  python -m a", "/usr/bin/bash: line 1: 7 Killed"),
    ],
)
def test_the_sentence_of_an_error(tmp_path: Path, log: str, sentence: str) -> None:
    """Catches a last line that passes for the reason."""
    (tmp_path / "a.log").write_text(log, "utf-8")
    assert error_sentence(str(tmp_path / "a.log")).startswith(sentence)
    # The stage's own reason goes before that of a cluster, which goes before none.
    said = error_sentence(str(tmp_path / "a.log"), "job 7 has failed:\nTIMEOUT\n    its call")
    assert said.startswith("job 7 has failed: TIMEOUT" if "message" in sentence else sentence)
    assert "its call" not in said


def test_a_log_that_was_never_written(tmp_path: Path) -> None:
    assert error_sentence(str(tmp_path / "a.log")) == "it left no message"


def test_an_error_of_the_workflow_itself_is_shown(tmp_path: Path) -> None:
    """Catches a run that ends in silence."""
    assert "nowhere.csv" in "\n".join(lines(tmp_path, FINE, "--", "nowhere.csv"))


def test_a_dry_run_still_gives_reasons(tmp_path: Path) -> None:
    done = subprocess.run(command(tmp_path, FINE, "-n"), cwd=tmp_path, capture_output=True, text=True)
    assert "Reason: Missing output files: data/b.csv" in done.stdout


def test_on_a_terminal_a_bar_stands_below_the_lines(tmp_path: Path) -> None:
    """Catches a bar that stays between the lines, and one that does not know how far its stage is."""
    ours, theirs = pty.openpty()
    with subprocess.Popen(command(tmp_path, FINE), cwd=tmp_path, stdout=theirs, stderr=theirs) as run:
        os.close(theirs)
        shown = b""
        try:
            while part := os.read(ours, 4096):
                shown += part
        except OSError:  # Linux says so that the other end is closed
            pass
    os.close(ours)
    assert run.returncode == 0
    text = shown.decode()
    assert re.search(r"\r\x1b\[K░{20} 0/3, Making a 40 % \(\d s\)", text)
    left = [re.sub(r".*\r\x1b\[K", "", line) for line in text.replace("\r\n", "\n").split("\n")]
    assert [line[:5] for line in left if line] == ["Stage", "[1/3]", "[2/3]", "[3/3]"]


def test_the_default_profile_chooses_it() -> None:
    """Catches a plain `snakemake --cores 2` that prints Snakemake's own walls again."""
    assert "logger: [vigauge]" in (ROOT / "profiles" / "default" / "config.yaml").read_text("utf-8")
