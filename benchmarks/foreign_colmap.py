"""COLMAP's own covariance of a reconstruction, in the gauge that its bundle adjustment holds: two cameras."""

from __future__ import annotations

# zlib before pycolmap, which brings its own copy.
import zlib  # noqa: F401  isort: skip
from typing import Any

import numpy as np
import pycolmap

import vigauge as vg
from vigauge.adapters.pycolmap import covariance
from vigauge.gauge.layout import Index
from vigauge.geometry.so3 import Array

from .foreign_rows import least, row
from .results import Row


def colmap_row(images: int = 12, points: int = 200) -> Row:
    """Poses of images around points; intrinsics are known."""
    pycolmap.set_random_seed(1)
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=images, num_cameras_per_rig=1, num_frames_per_rig=1, num_points3D=points
    )
    reconstruction = pycolmap.synthesize_dataset(options)
    theirs, peer_s = least(lambda: of_colmap(reconstruction))
    gauge, columns = two_camera_gauge(covariance(reconstruction), reconstruction, theirs)

    def mine() -> Array:
        found = covariance(reconstruction)
        return np.concatenate([found.entries(own, own, gauge).ravel() for own in columns.values()])

    expected = np.concatenate([theirs.get_cam_cov_from_world(key).ravel() for key in columns])
    note = "vigauge.adapters.pycolmap; first pose and a coordinate of the second held"
    what = "all 6 x 6 blocks, two cameras held"
    case = f"COLMAP's synthetic data, 7 directions, n = {6 * images + 3 * points}"
    return row(case, what, least(mine), "pycolmap", (expected, peer_s), note)


def of_colmap(reconstruction: Any) -> Any:
    """What ``estimate_ba_covariance`` gives for poses and points, of known intrinsics, without damping."""
    config = pycolmap.BundleAdjustmentConfig()
    for key in reconstruction.reg_image_ids():
        config.add_image(key)
    for key in reconstruction.cameras:
        config.set_constant_cam_intrinsics(key)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    adjuster = pycolmap.create_default_ceres_bundle_adjuster(
        pycolmap.BundleAdjustmentOptions(), config, reconstruction
    )
    options = pycolmap.BACovarianceOptions(params=pycolmap.BACovarianceOptionsParams.POSES_AND_POINTS)
    options.damping = 0.0
    return pycolmap.estimate_ba_covariance(options, reconstruction, adjuster)


def two_camera_gauge(
    found: vg.EstimateCovariance, reconstruction: Any, theirs: Any
) -> tuple[Array, dict[int, Index]]:
    """(n, 7) V of that gauge, and the columns of each image that it leaves free."""
    given = {key: theirs.get_cam_cov_from_world(key) for key in sorted(reconstruction.reg_image_ids())}
    (first,) = (key for key, block in given.items() if block is None)
    (second,) = (key for key, block in given.items() if block is not None and len(block) == 5)
    # COLMAP holds the coordinate along which the second camera is farthest, seen from the first.
    poses = [reconstruction.image(key).cam_from_world() for key in (first, second)]
    axis = 3 + int(np.argmax(np.abs((poses[0] * poses[1].inverse()).translation)))
    columns = {key: found.layout.columns(key) for key in given}
    held = [*columns.pop(first), columns[second][axis]]
    columns[second] = np.delete(columns[second], axis)
    V = np.zeros((found.layout.n, 7))
    V[held, range(7)] = 1.0
    return V, columns
