"""What all tests share: one BLAS thread, no display, repeatable examples, and EuRoC where it is."""

import os

# Read when NumPy and Matplotlib are first imported, so set before anything imports them.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

from pathlib import Path  # noqa: E402

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

# The same examples in every run, so that a red run is red again; no deadline on a loaded machine.
# `pytest --hypothesis-profile=default` searches new ones.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")


# Made once a process, in seconds to minutes: who uses one of them is tested in one process.
_DEAR = ("smoke_project", "scratch_project", "rendered")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep tests of a file, or of one dear fixture, in one process; skip real data where there is none."""
    for item in items:
        dear = [name for name in _DEAR if name in getattr(item, "fixturenames", ())]
        group = "smoke_project" if dear and dear[0] != "rendered" else (dear or [item.path.as_posix()])[0]
        item.add_marker(pytest.mark.xdist_group(group))
    if os.environ.get("EUROC_ROOT"):
        return
    skip = pytest.mark.skip(reason="EUROC_ROOT is not set")
    for item in items:
        if item.get_closest_marker("euroc"):
            item.add_marker(skip)


@pytest.fixture(scope="session")
def euroc_root() -> Path:
    """Folder of the real sequences; a root that is named but not there is an error, not a skip."""
    named = os.environ.get("EUROC_ROOT")
    if not named:
        pytest.skip("EUROC_ROOT is not set")
    root = Path(named)
    if not root.is_dir():
        pytest.fail(f"EUROC_ROOT names no folder: {root}")
    return root
