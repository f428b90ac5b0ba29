"""The one family of errors: what a message says, and that it survives a process boundary."""

import pickle
from pathlib import Path

import pytest

from vigauge.errors import ConfigError, DataError, DegenerateError, SolverError, VigaugeError


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "imu.csv: must increase"),
        ({"row": 7}, "imu.csv, row 7: must increase"),
        ({"field": "t"}, "imu.csv, t: must increase"),
        ({"row": 0, "field": "t", "value": 3}, "imu.csv, row 0, t: must increase (found 3)"),
        ({"value": "x y"}, "imu.csv: must increase (found 'x y')"),
        ({"value": 0}, "imu.csv: must increase (found 0)"),
    ],
)
def test_message_names_file_row_field_value_and_rule(arguments, message):
    """Catches a message that leaves out where the fault is, also for row 0 and a value of 0."""
    assert str(DataError("imu.csv", "must increase", **arguments)) == message


@pytest.mark.parametrize("kind", [DataError, ConfigError])
def test_errors_survive_a_process_boundary(kind):
    """Catches an error of a worker process that cannot be unpickled and is lost."""
    error = kind(Path("a") / "b.csv", "must be finite", row=3, field="x", value=float("inf"))
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is kind
    assert str(copy) == str(error)
    assert (copy.file, copy.rule, copy.row, copy.field, copy.value) == (
        str(Path("a") / "b.csv"),
        "must be finite",
        3,
        "x",
        float("inf"),
    )


@pytest.mark.parametrize("kind", [DataError, ConfigError, SolverError, DegenerateError])
def test_one_family(kind):
    """Catches an error that a caller who catches the package's base class would miss."""
    assert issubclass(kind, VigaugeError)
    assert not issubclass(kind, (ValueError, RuntimeError))


def test_degenerate_problems_are_solver_errors():
    """Catches a singular system that is reported under two unrelated names."""
    assert issubclass(DegenerateError, SolverError)
