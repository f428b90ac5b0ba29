"""The C++ program around native Ceres: found, compiled, or told what it lacks."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from vigauge.errors import VigaugeError
from vigauge.files import atomic_path

SOURCE = Path(__file__).with_name("ceres_solver.cpp")
FLAGS = ("-std=c++17", "-O3", "-march=native", "-DNDEBUG")


class Unavailable(VigaugeError):
    """A solver cannot be had on this machine; the message says what is missing."""


@dataclass(frozen=True)
class Toolchain:
    """A compiler and the folders of Eigen's and Ceres' headers."""

    compiler: str
    eigen: Path


def find_toolchain(
    compiler: str = "g++", include: tuple[Path, ...] = (Path("/usr"), Path("/usr/local"))
) -> Toolchain:
    """Compiler and headers; raises Unavailable with one sentence on what to install."""
    missing = []
    found = shutil.which(compiler)
    if found is None:
        missing.append(compiler)
    roots = [root / "include" for root in include]
    eigen = next((r / "eigen3" for r in roots if (r / "eigen3/Eigen/Dense").is_file()), None)
    if eigen is None or not any((r / "ceres/ceres.h").is_file() for r in roots):
        missing.append("libceres-dev")
    if found is None or eigen is None or missing:
        raise Unavailable(
            f"native Ceres is left out: {' and '.join(missing)} must be installed "
            f"(on Debian and Ubuntu: apt-get install {' '.join(missing)})"
        )
    return Toolchain(found, eigen)


def build(folder: Path) -> Path:
    """The compiled program, made anew when its source or the compiler changes.

    Raises Unavailable where a part is missing or does not compile.
    """
    tools = find_toolchain()
    version = subprocess.run([tools.compiler, "--version"], capture_output=True, text=True, check=True).stdout
    key = hashlib.sha256(SOURCE.read_bytes() + version.encode() + " ".join(FLAGS).encode()).hexdigest()[:12]
    program = folder / f"ceres_solver_{key}"
    if not program.is_file():
        with atomic_path(program) as temporary:
            command = [
                tools.compiler,
                *FLAGS,
                "-isystem",
                str(tools.eigen),
                str(SOURCE),
                "-o",
                str(temporary),
            ]
            done = subprocess.run([*command, "-lceres", "-lglog"], capture_output=True, text=True)
            if done.returncode:
                first = next(
                    (line for line in done.stderr.splitlines() if "error" in line), done.stderr[:200]
                )
                raise Unavailable(f"native Ceres is left out: ceres_solver.cpp does not compile: {first}")
    return program


def describe(program: Path | None) -> dict[str, str]:
    """Versions of the compiler, Ceres and Eigen, and the BLAS that Ceres loads."""
    if program is None:
        return {}
    tools = find_toolchain()
    out = {"flags": " ".join(FLAGS)}
    text = subprocess.run([tools.compiler, "--version"], capture_output=True, text=True, check=True).stdout
    out["compiler"] = text.splitlines()[0]
    for name, file, pattern in (
        ("ceres", tools.eigen.parent / "ceres/version.h", r"CERES_VERSION_(?:MAJOR|MINOR|REVISION) +(\d+)"),
        (
            "eigen",
            tools.eigen / "Eigen/src/Core/util/Macros.h",
            r"#define EIGEN_(?:WORLD|MAJOR|MINOR)_VERSION (\d+)",
        ),
    ):
        if file.is_file():
            out[name] = ".".join(re.findall(pattern, file.read_text(encoding="utf-8", errors="replace")))
    if shutil.which("ldd"):
        text = subprocess.run(["ldd", str(program)], capture_output=True, text=True, check=True).stdout
        libraries = re.findall(r"(lib\w*(?:blas|atlas|lapack)\S*) => (\S+)", text)
        out["blas"] = ", ".join(sorted(f"{name} ({Path(path).resolve().name})" for name, path in libraries))
    return out
