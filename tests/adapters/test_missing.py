"""The adapters where their packages are not installed."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("package", ["gtsam", "pycolmap"])
def test_what_is_missing_is_named(package: str) -> None:
    """Catches an adapter that needs its package before it is asked for, or does not say how to get it."""
    code = f"""
import sys
sys.modules[{package!r}] = None  # as if not installed
import vigauge as vg, vigauge.adapters
try:
    import vigauge.adapters.{package}
except vg.MissingExtraError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert f"install it with `pip install {package}`" in done.stdout, done.stderr


def test_nothing_is_imported_unasked() -> None:
    code = "import sys, vigauge.adapters; print({'gtsam', 'pycolmap'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "set()", done.stderr
