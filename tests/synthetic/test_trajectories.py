"""The three shapes of Section IV-A: length, speed, and that all six degrees of freedom move."""

from dataclasses import replace

import numpy as np
import pytest

from support.simulated import SETTINGS, scene
from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.synthetic.trajectories import TRAJECTORIES, make_trajectory

DENSE = np.linspace(0.0, SETTINGS.duration_s, 5001)


def test_the_three_shapes_of_the_paper():
    """Catches a shape that was renamed: names are part of every result file."""
    assert TRAJECTORIES == ("sine", "arc", "rec")


@pytest.mark.parametrize("shape", TRAJECTORIES)
def test_length_and_mean_speed(shape):
    """Catches a wrong scale: 5 m at 2 m/s (Section V-B), to half a percent."""
    p_W = make_trajectory(shape, SETTINGS).p_W(DENSE)
    length = np.linalg.norm(np.diff(p_W, axis=0), axis=1).sum()
    assert length == pytest.approx(5.0, rel=5e-3)
    assert length / SETTINGS.duration_s == pytest.approx(2.0, rel=5e-3)


@pytest.mark.parametrize("shape", TRAJECTORIES)
def test_all_six_degrees_of_freedom_move(shape):
    """Catches a planar motion or a fixed axis of rotation, which hide degenerate directions."""
    motion = make_trajectory(shape, SETTINGS)
    p_W, R_WB = motion.p_W(DENSE), motion.R_WB(DENSE)
    assert np.ptp(p_W, axis=0).min() > 0.1
    turned = so3.log(R_WB[0].T @ R_WB)
    assert np.ptp(turned, axis=0).min() > np.radians(3.0)
    assert np.linalg.norm(turned, axis=1).max() < np.radians(60.0)


@pytest.mark.parametrize("shape", TRAJECTORIES)
def test_motion_is_one_that_can_be_flown(shape):
    """Catches wiggles between the spline's points: accelerations and rates stay those of a vehicle."""
    motion = make_trajectory(shape, SETTINGS)
    assert np.linalg.norm(motion.a_W(DENSE), axis=1).max() < 30.0
    assert np.linalg.norm(motion.omega_B(DENSE), axis=1).max() < 3.0
    speed = np.linalg.norm(motion.v_W(DENSE), axis=1)
    assert speed.min() > 1.0
    assert speed.max() < 3.0


def test_shapes_look_like_their_names():
    """Catches one shape under another's name."""
    sine, arc, rec = (make_trajectory(shape, SETTINGS).p_W(DENSE) for shape in TRAJECTORIES)
    crossings = np.count_nonzero(np.diff(np.sign(sine[:, 1] - sine[:, 1].mean())))
    assert crossings >= 3
    heading = np.unwrap(np.arctan2(*np.diff(arc[:, :2], axis=0).T[::-1]))
    assert np.degrees(heading[-1] - heading[0]) == pytest.approx(200.0, abs=8.0)
    assert np.linalg.norm(rec[-1] - rec[0]) < 0.05 * 5.0  # once round
    assert np.linalg.norm(sine[-1] - sine[0]) > 3.0


def test_length_scales_with_duration_and_speed():
    """Catches a length that is written into the shape."""
    longer = replace(SETTINGS, duration_s=5.0, mean_speed_mps=1.5)
    t = np.linspace(0.0, 5.0, 5001)
    length = np.linalg.norm(np.diff(make_trajectory("arc", longer).p_W(t), axis=0), axis=1).sum()
    assert length == pytest.approx(7.5, rel=0.02)


def test_unknown_shapes_are_refused():
    """Catches a misspelt configuration: the message lists what there is."""
    with pytest.raises(DataError, match="sine, arc, rec"):
        make_trajectory("circle", SETTINGS)


def test_camera_looks_ahead():
    """Catches camera axes mixed up: z forward along +x of the world, y down."""
    R_WB = scene("arc").trajectory.R_WB(DENSE)
    assert R_WB[:, 0, 2].min() > 0.8
    assert R_WB[:, 2, 1].max() < -0.8


@pytest.mark.parametrize("shape", ["sine", "arc", "rec"])
def test_view_turns_with_the_path_by_its_share(shape: str) -> None:
    """Catches a view that turns the other way, or by another amount than asked for."""
    t = np.linspace(0.0, SETTINGS.duration_s, 400)
    still = replace(SETTINGS, rotation_amplitude_deg=0.0)
    path = make_trajectory(shape, still)
    heading = np.unwrap(np.arctan2(path.v_W(t)[:, 1], path.v_W(t)[:, 0]))
    view = make_trajectory(shape, replace(still, view_follows_path=0.5)).R_WB(t)[:, :, 2]
    yaw = np.unwrap(np.arctan2(view[:, 1], view[:, 0]))
    assert np.abs(view[:, 2]).max() < 1e-6, "the view stays level"
    middle = slice(20, -20)  # the heading at the ends is one-sided
    turned = yaw[middle] - yaw[200]
    assert np.abs(turned - 0.5 * (heading[middle] - heading[200])).max() < 0.12
    assert np.ptp(turned) > 0.3 * np.ptp(heading[middle])
