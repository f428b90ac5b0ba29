"""The records of what is run by hand: `make recovery`, `make test-slurm`, `benchmarks.recording_errors`."""

import pytest

from support import ROOT
from vigauge.files import read_rows


@pytest.mark.parametrize(("record", "column"), [("recovery.csv", "identical"), ("slurm.csv", "holds")])
def test_every_recorded_run_went_well(record: str, column: str) -> None:
    """Catches a record of a kill with other results, or of a check that failed, at which nobody looked."""
    rows = read_rows(ROOT / "docs" / record)
    assert rows and all(row[column] == "True" for row in rows)


def test_estimates_of_recordings_are_near_the_truth_as_the_page_says() -> None:
    """Catches a window in which unknown biases cost accuracy, or a figure that a new record left behind."""
    rows = read_rows(ROOT / "docs" / "recording_errors.csv")
    page = (ROOT / "docs" / "your_own_data.md").read_text("utf-8")
    assert max(float(row["p_ratio"]) for row in rows) <= 1.5

    def span(column: str) -> str:
        return " to ".join(sorted((row[column] for row in rows), key=float)[:: len(rows) - 1])

    for kind, unit, shown in (("p", "mm", "mm"), ("phi", "deg", "deg"), ("v", "mmps", "mm/s")):
        ratio, sigmas = span(f"{kind}_ratio"), span(f"{kind}_in_sigmas")
        assert f"| {span(f'{kind}_rmse_{unit}')} {shown} | {ratio} | {sigmas} |" in page
    for kind, unit, shown in (("gyro", "radps", "rad/s"), ("accel", "mps2", "m/s^2")):
        sigmas = span(f"{kind}_bias_in_sigmas")
        assert f"| {span(f'{kind}_bias_error_{unit}')} {shown} | | {sigmas} |" in page
    assert f"takes {span('seconds')} seconds" in page
