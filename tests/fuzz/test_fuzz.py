"""A short run of the fuzzing harness; ``make fuzz`` is the long one, ``docs/fuzzing.csv`` its record."""

import time
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from support import ROOT
from vigauge.files import read_rows

from .reader import Reader, outcome
from .readers import all_readers
from .run import LONGEST_S

NAMES = [
    "imu data.csv",
    "ground truth data.csv",
    "camera data.csv",
    "sensor.yaml",
    "image",
    "npz",
    "zip of a sequence",
    "g2o",
    "BAL",
    "H.npz",
    "Jacobian of Ceres",
    "calibration of Kalibr",
    "trajectory.tum",
    "trajectory.csv",
    "trajectory.txt",
    "trajectory.npz",
    "sigmas of OpenVINS",
]


@pytest.fixture(scope="module")
def readers() -> Iterator[dict[str, Reader]]:
    with all_readers() as readers:
        yield readers


def test_all_readers_are_fuzzed(readers: dict[str, Reader]) -> None:
    assert list(readers) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_valid_files_are_accepted_and_spoilt_ones_mostly_refused(
    readers: dict[str, Reader], name: str
) -> None:
    """Catches a harness that fuzzes nothing: seeds that are refused, or mutations that spoil nothing."""
    reader = readers[name]
    assert outcome(reader, reader.seeds[0]) == "accepted"
    found = [outcome(reader, reader.input(seed)) for seed in range(200)]
    assert 0 < found.count("accepted") < 150


@pytest.mark.parametrize("name", NAMES)
def test_spoilt_file_is_accepted_or_refused(readers: dict[str, Reader], name: str) -> None:
    """Catches any exception but VigaugeError, and an input that takes seconds."""
    reader = readers[name]

    @settings(max_examples=150, database=None)
    @given(seed=st.integers(min_value=0, max_value=2**40))
    def check(seed: int) -> None:
        begin = time.process_time()
        outcome(reader, reader.input(seed))
        assert time.process_time() - begin < LONGEST_S

    check()


def test_record_of_the_long_run_shows_no_crash() -> None:
    """Catches a record of a reader that is gone, of too few inputs, or one that hides a failure."""
    rows = read_rows(ROOT / "docs" / "fuzzing.csv")
    assert {row["reader"] for row in rows} == set(NAMES)
    for row in rows:
        assert int(row["inputs"]) >= 5_000, row
        assert int(row["accepted"]) + int(row["refused"]) == int(row["inputs"])
        assert int(row["crashes"]) == 0
        assert float(row["longest_s"]) <= LONGEST_S
