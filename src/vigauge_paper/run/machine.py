"""What a result was computed on: versions, processor, threads."""

import os
import platform
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_info

PACKAGES = (
    "vigauge",
    "numpy",
    "scipy",
    "pandas",
    "matplotlib",
    "opencv-python-headless",
    "pycolmap",
    "snakemake",
)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def processor() -> str:
    """Model name of the processor, as the operating system gives it."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    return {"python": platform.python_version()} | {name: _version(name) for name in PACKAGES}


def describe_machine() -> dict[str, Any]:
    """Processor, cores, operating system, BLAS libraries and the threads they may use now."""
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        # Libraries are found in an order that changes from run to run.
        "blas": sorted(
            (
                {
                    key: info[key]
                    for key in ("internal_api", "version", "architecture", "num_threads")
                    if key in info
                }
                for info in threadpool_info()
            ),
            key=lambda library: [str(value) for value in library.values()],
        ),
    }


def reference_seconds(clock: Callable[[], float]) -> float:
    """Seconds of a fixed computation, the best of 20 Cholesky factors: the speed of the processor now."""
    matrix = np.eye(400) + 1.0 / 400
    seconds = []
    for _ in range(20):
        begin = clock()
        np.linalg.cholesky(matrix)
        seconds.append(clock() - begin)
    return min(seconds)
