"""Estimates as a folder: trajectory, biases, problem, summary and page, all of it or nothing."""

from __future__ import annotations

import json
import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ...errors import OutputError
from ...files import atomic_folder, write_json, write_rows, write_text
from ...model.archive import save_problems
from ...model.trajectory_files import save_trajectory
from .estimate import Estimate
from .page import page

# What tells a folder of ours, which may be replaced, from any other.
SUMMARY, MADE_BY = "summary.json", "vigauge estimate"
_POSE = 9
_BIASES = (("gyro_bias", "radps"), ("accel_bias", "mps2"))
_SIGMAS = ("position_m", "rotation_rad", "velocity_mps")
_BIAS_COLUMNS = [f"{kind}_{axis}_{unit}" for kind, unit in _BIASES for axis in "xyz"]


def require_free(target: Path) -> None:
    """Whether results may be written to ``target``, before the work is done.

    Raises OutputError where something else is there, or nothing can be written.
    """
    if os.path.lexists(target) and not _is_ours(target):
        raise OutputError(
            f"{target}: is there and no result of `{MADE_BY}`, so it is left as it is; choose another --out"
        )
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=target.parent, prefix=f".{target.name}."):
            pass
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror}; choose another --out") from error


def write_estimates(target: Path, estimates: dict[str, Estimate], refused: dict[str, str]) -> None:
    """Write estimates, each into a folder of its name; one alone has the name "" and is ``target`` itself.

    A folder that an earlier run made is replaced. ``refused``: why other windows have none.

    Raises OutputError as :func:`require_free`.
    """
    require_free(target)
    whole: dict[str, Any] = {"made_by": MADE_BY}
    if "" in estimates:
        whole |= summary(estimates[""])
    else:
        whole |= {"windows": {name: summary(one) for name, one in estimates.items()}, "refused": refused}
    with atomic_folder(target) as temporary:
        for name, one in estimates.items():
            _write_one(temporary / name, one)
        write_json(temporary / SUMMARY, whole)


def _is_ours(target: Path) -> bool:
    try:
        made_by = json.loads((target / SUMMARY).read_text(encoding="utf-8"))["made_by"]
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return bool(made_by == MADE_BY)


def _write_one(folder: Path, one: Estimate) -> None:
    save_trajectory(folder / "trajectory.tum", one.state, times_ns=one.t_ns)
    for suffix in (".csv", ".npz"):
        path = folder / f"trajectory{suffix}"
        save_trajectory(path, one.state, one.keyframes, times_ns=one.t_ns, gauge=one.gauge_name)
    names = ["t_ns", *_BIAS_COLUMNS, *(f"sigma_{name}" for name in _BIAS_COLUMNS)]
    values = np.hstack([one.biases, one.sigma[:, _POSE:]]).tolist()
    rows = [
        dict(zip(names, [t, *row], strict=True)) for t, row in zip(one.t_ns.tolist(), values, strict=True)
    ]
    write_rows(folder / "biases.csv", rows)
    save_problems(folder / "problem.npz", [one.problem.with_initial(one.state)])
    write_text(folder / "page.html", page(one))


def summary(one: Estimate) -> dict[str, Any]:
    """What is in ``summary.json`` of an estimate: plain numbers, lists and sentences."""
    sigma = one.sigma
    rms = np.sqrt(np.mean(np.sum(sigma[:, :_POSE].reshape(-1, 3, 3) ** 2, axis=2), axis=0))
    biases = one.biases.mean(axis=0)
    mean_sigma = sigma[:, _POSE:].mean(axis=0)
    fit = one.noise
    return {
        "sequence": one.sequence,
        "window_s": [one.part.start_s, one.part.end_s],
        "tracker": one.report.tracker,
        "frames": one.part.frames,
        "keyframes": one.state.n_keyframes,
        "landmarks": one.state.n_landmarks,
        "observations": len(one.problem.obs_uv),
        "path_m": float(np.sum(np.linalg.norm(np.diff(one.state.p_W, axis=0), axis=1))),
        "gauge": one.gauge_name,
        "loss": str(one.problem.loss) if one.problem.loss is not None else "none",
        "sigma_rms": dict(zip(_SIGMAS, rms.tolist(), strict=True)),
        "biases": {
            "gyro_radps": biases[:3].tolist(),
            "gyro_sigma_radps": mean_sigma[:3].tolist(),
            "accel_mps2": biases[3:].tolist(),
            "accel_sigma_mps2": mean_sigma[3:].tolist(),
        },
        "noise": {
            "sigma_px": fit.sigma_px,
            "density_factor": fit.density_factor,
            "visual_chi_square_stated": fit.at_stated.visual,
            "inertial_chi_square_stated": fit.at_stated.inertial,
            "visual_chi_square": fit.at_used.visual,
            "inertial_chi_square": fit.at_used.inertial,
        },
        "observable": list(one.observable),
        "warnings": list(one.warnings),
        "truth": [truth.to_mapping() for truth in one.truths],
        "truth_used": False,
    }


def lines(one: Estimate, target: Path) -> list[str]:
    """The estimate in some ten lines for a terminal."""
    s = summary(one)
    sigma, biases, noise = s["sigma_rms"], s["biases"], s["noise"]
    stated, chi = one.noise.at_stated, one.noise.at_used

    def three(kind: str, unit: str) -> str:
        pairs = zip(biases[f"{kind}_{unit}"], biases[f"{kind}_sigma_{unit}"], strict=True)
        return "bias (sigma) " + ", ".join(f"{value:+.4f} ({error:.4f})" for value, error in pairs)

    mm, deg = 1e3 * sigma["position_m"], np.degrees(sigma["rotation_rad"])
    entries = [
        ("front-end", " ".join(f"{s[name]} {name}" for name in ("keyframes", "landmarks", "observations"))),
        ("sigma (rms)", f"{mm:.1f} mm, {deg:.3f} deg, {1e3 * sigma['velocity_mps']:.1f} mm/s"),
        ("gauge", one.gauge_name),
        ("gyroscope", f"{three('gyro', 'radps')} rad/s"),
        ("accelerometer", f"{three('accel', 'mps2')} m/s^2"),
        ("noise", f"{noise['sigma_px']:.2f} px, stated densities x {noise['density_factor']:.2g}"),
        ("chi-squares", f"images {chi.visual:.2f}, inertial {chi.inertial:.2f} per redundancy"),
        ("as stated", f"images {stated.visual:.2g} (at 1 px), inertial {stated.inertial:.2g}"),
        *(("known", text) for text in one.observable),
        *(("truth, unused", str(truth)) for truth in one.truths),
        ("written", f"{target}{os.sep}"),
        *(("warning", text) for text in one.warnings),
    ]
    head = f"{one.sequence}: {one.part}, path {s['path_m']:.2f} m"
    return [head, *(f"  {name:14s} {text}" for name, text in entries)]
