"""Problems and states on disk: nothing lost, same bytes, and broken files refused."""

import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.random_problem import random_problem, with_noise_of_its_own
from vigauge.errors import DataError, OutputError
from vigauge.geometry.camera import Camera
from vigauge.model.archive import (
    load_arrays,
    load_problems,
    load_states,
    save_arrays,
    save_problems,
    save_states,
)
from vigauge.model.factors import BiasPrior
from vigauge.model.loss import Cauchy, Huber
from vigauge.model.problem import InertialFactors, Problem
from vigauge.model.state import State
from vigauge.solver.residuals import cost

PRIOR = BiasPrior(3, np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.3]), 0.05, 0.2)


def equal(a, b) -> bool:
    """Equality of dataclasses with arrays, dtypes included."""
    if isinstance(a, np.ndarray):
        return type(b) is np.ndarray and a.dtype == b.dtype and np.array_equal(a, b)
    if isinstance(a, (State, Problem, InertialFactors, Camera, BiasPrior)):
        names = type(a).__dataclass_fields__
        return type(a) is type(b) and all(equal(getattr(a, name), getattr(b, name)) for name in names)
    if isinstance(a, tuple):
        return type(b) is tuple and len(a) == len(b) and all(map(equal, a, b))
    return a == b


def problems() -> list[Problem]:
    one = random_problem(2, n_keyframes=2, n_landmarks=1)
    left, right = one.cameras
    fisheye = replace(left, lens="equidistant", distortion=(0.003, 7e-4, -0.002, 2e-4))
    fifth = replace(right, distortion=(*right.distortion, 0.01))
    return [
        random_problem(1),
        replace(random_problem(1, biases=True), loss=Cauchy(2.5), factors=(PRIOR,)),
        with_noise_of_its_own(replace(one, loss=Huber(1.345), cameras=(fisheye, fifth)), 2),
    ]


def test_problems_round_trip(tmp_path):
    """Catches a lost field, a lost digit or another type; problems of different size in one file."""
    save_problems(tmp_path / "p.npz", problems())
    loaded = load_problems(tmp_path / "p.npz")
    assert len(loaded) == 3
    for before, after in zip(problems(), loaded, strict=True):
        assert equal(before, after)
        assert cost(after, after.initial) == cost(before, before.initial)


def test_states_round_trip(tmp_path):
    """Catches a first rotation that comes back with another reference or increment."""
    states = [
        random_problem(seed, biases=seed == 3).initial for seed in range(12)
    ]  # more than ten: 10 sorts before 2
    save_states(tmp_path / "s.npz", states)
    assert all(map(equal, states, load_states(tmp_path / "s.npz")))
    save_states(tmp_path / "none.npz", [])
    assert load_states(tmp_path / "none.npz") == []


def test_same_content_same_bytes(tmp_path, monkeypatch):
    """Catches a time stamp in the archive: a rerun would look like a change."""
    save_problems(tmp_path / "a.npz", problems())
    monkeypatch.setattr(time, "time", lambda: 2.0e9)
    monkeypatch.setattr(time, "localtime", lambda *_: time.gmtime(2.0e9))
    save_problems(tmp_path / "b.npz", problems())
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def archive_of(tmp_path: Path) -> Path:
    save_problems(tmp_path / "p.npz", problems())
    return tmp_path / "p.npz"


def test_a_missing_file_is_named(tmp_path):
    """Catches a bare traceback for a stage that was not run."""
    for load in (load_problems, load_states, load_arrays):
        with pytest.raises(DataError, match="must exist") as caught:
            load(tmp_path / "nothing.npz")
        assert caught.value.file == str(tmp_path / "nothing.npz")


@pytest.mark.parametrize("content", [b"", b"<html>not found</html>", b"PK\x03\x04broken"])
def test_a_file_that_is_no_archive_is_refused(tmp_path, content):
    """Catches a web page or an empty file taken for data."""
    path = tmp_path / "p.npz"
    path.write_bytes(content)
    with pytest.raises(DataError, match="npz archive"):
        load_problems(path)


@pytest.mark.parametrize("keep", [0.1, 0.5, 0.9, 0.999])
def test_a_truncated_archive_is_refused(tmp_path, keep):
    """Catches half a file from a killed copy."""
    path = archive_of(tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(DataError, match="npz archive"):
        load_problems(path)


def test_a_flipped_bit_is_refused(tmp_path):
    """Catches silent corruption: the archive's checksum is read."""
    path = archive_of(tmp_path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(DataError, match="npz archive"):
        load_problems(path)


def test_pickles_are_refused(tmp_path):
    """Catches objects that would run code when loaded."""
    np.savez(tmp_path / "p.npz", kind=np.array("problems"), bad=np.array([{"a": 1}], dtype=object))
    with pytest.raises(DataError, match="pickles"):
        load_problems(tmp_path / "p.npz")


def test_a_bare_array_is_refused(tmp_path):
    """Catches an .npy file under another name, which has no fields at all."""
    with (tmp_path / "p.npz").open("wb") as stream:
        np.save(stream, np.eye(3))
    with pytest.raises(DataError, match="npz archive"):
        load_arrays(tmp_path / "p.npz")


def test_problems_are_not_states(tmp_path):
    """Catches a file of another kind read field by field."""
    with pytest.raises(DataError, match="must hold states") as caught:
        load_states(archive_of(tmp_path))
    assert caught.value.field == "kind"
    save_arrays(tmp_path / "x.npz", {"p_W": np.eye(3)})
    with pytest.raises(DataError, match="must hold problems"):
        load_problems(tmp_path / "x.npz")


def changed(path: Path, field: str, value) -> Path:
    arrays = load_arrays(path)
    if value is None:
        del arrays[field]
    else:
        arrays[field] = value
    save_arrays(path, arrays)
    return path


@pytest.mark.parametrize(
    ("field", "value", "named"),
    [
        ("1/obs_uv", None, "obs_uv"),
        ("0/initial.p_W", None, "initial.p_W"),
        ("count", None, "count"),
        ("count", np.array(2), "2/"),
        ("count", np.array(4), "entry 3"),
        ("x/obs_uv", np.eye(3), "x/obs_uv"),
        ("0/initial.p_W", np.zeros((4, 2)), "p_W"),
        ("0/initial.p_W", np.array(1.0), "p_W"),
        ("0/initial.p_W", np.zeros((0, 3)), "p_W"),
        ("0/initial.R_WB", np.full((4, 3, 3), np.nan), "R_WB"),
        ("0/initial.dphi_0", np.zeros(2), "dphi_0"),
        ("0/initial.R_WB0_ref", np.zeros((3, 3)), "R_WB0_ref"),
        ("0/initial.dphi_0", np.zeros(3), "dphi_0"),
        ("0/sigma_px", np.array([1.0, 2.0]), "sigma_px"),
        ("0/sigma_px", np.array(-1.0), "sigma_px"),
        ("0/cameras.size", np.array([[752, 480]]), "cameras"),
        ("0/cameras.lens", np.array(["radial-tangential", "omni"]), "lens"),
        ("0/cameras.p_BC", np.array([["a", "b", "c"], ["a", "b", "c"]]), "p_BC"),
        ("0/obs_keyframe", np.zeros(3, dtype=np.int64), "obs_keyframe"),
        ("0/obs_landmark", np.zeros(3), "obs_landmark"),
        ("0/inertial.dt", np.array([-1.0, 0.1, 0.1, 0.1]), "dt"),
        ("1/initial.gyro_bias", None, "gyro_bias"),
        ("1/initial.accel_bias", np.zeros((3, 3)), "accel_bias"),
        ("1/inertial.by_gyro_bias", None, "by_gyro_bias"),
        ("1/inertial.covariance", np.tile(np.eye(9), (4, 1, 1)), "covariance"),
        ("0/initial.gyro_bias", np.zeros((4, 3)), "accel_bias"),
        ("1/bias_priors.keyframe", np.array([4]), "keyframes"),
        ("1/bias_priors.numbers", None, "bias_priors.numbers"),
        ("1/bias_priors.numbers", np.ones((1, 7)), "bias_priors.numbers"),
        ("1/bias_priors.numbers", np.zeros((1, 8)), "gyro_sigma"),
        ("1/loss", None, "loss"),
        ("1/loss", np.array("tukey"), "loss: entry 1: must be one of huber, cauchy"),
        ("1/loss.delta", None, "loss.delta"),
        ("1/loss.delta", np.array(np.nan), "delta"),
    ],
)
def test_a_missing_or_wrong_field_is_named(tmp_path, field, value, named):
    """Catches an index or type error far from the file it came from, and numbers let through."""
    path = changed(archive_of(tmp_path), field, value)
    with pytest.raises(DataError) as caught:
        load_problems(path)
    assert caught.value.file == str(path)
    assert named in str(caught.value)


def test_states_are_checked_too(tmp_path):
    """Catches a state that is let through where a problem would be refused."""
    save_states(tmp_path / "s.npz", [random_problem(1).initial])
    path = changed(tmp_path / "s.npz", "0/v_W", np.zeros((3, 3)))
    with pytest.raises(DataError, match="v_W") as caught:
        load_states(path)
    assert caught.value.file == str(path)


def test_a_failed_save_leaves_the_old_archive(tmp_path, monkeypatch):
    """Catches a half-written archive in the place of a good one."""
    path = archive_of(tmp_path)
    before = path.read_bytes()

    def full_disk(file, **arrays):
        Path(file).write_bytes(b"half")
        raise OSError("no space left")

    monkeypatch.setattr(np, "savez", full_disk)
    with pytest.raises(OutputError, match="no space"):
        save_problems(path, problems()[:1])
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["p.npz"]
    assert zipfile.is_zipfile(path)
