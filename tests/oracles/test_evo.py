"""Trajectory errors against evo, the tool that most papers report with."""

import numpy as np
import pytest

from support.simulated import estimate, scene, trial
from vigauge.model.evaluation import align_first_pose, trajectory_errors
from vigauge.model.state import State

metrics = pytest.importorskip("evo.core.metrics")
trajectory = pytest.importorskip("evo.core.trajectory")
pytestmark = pytest.mark.oracle

CONFIGURATIONS = [(shape, points) for shape in ("sine", "arc", "rec") for points in ("plane", "random")]


def evo_path(state: State):
    poses = np.tile(np.eye(4), (state.n_keyframes, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = state.R_WB, state.p_W
    return trajectory.PosePath3D(poses_se3=list(poses))


def evo_rmse(truth: State, aligned: State, relation) -> float:
    ape = metrics.APE(relation)
    ape.process_data((evo_path(truth), evo_path(aligned)))
    return ape.get_statistic(metrics.StatisticsType.rmse)


@pytest.mark.parametrize("which", ["start", "estimate"])
@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_rmse_is_evos_absolute_pose_error(shape, points, which):
    """Catches a mean for a root mean square, or an angle that is not that of the relative rotation."""
    truth = scene(shape, points).truth
    state = estimate(0, shape, points) if which == "estimate" else trial(0, shape, points).initial
    aligned = align_first_pose(state, truth)
    errors = trajectory_errors(state, truth)
    position = evo_rmse(truth, aligned, metrics.PoseRelation.translation_part)
    degrees = evo_rmse(truth, aligned, metrics.PoseRelation.rotation_angle_deg)
    assert errors.p_rmse_m == pytest.approx(position, rel=1e-9)
    assert errors.phi_rmse_deg == pytest.approx(degrees, rel=1e-7)
