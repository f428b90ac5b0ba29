"""The covariance of a COLMAP reconstruction in any gauge, addressed by image or frame id. Needs pycolmap."""

from __future__ import annotations

# zlib before pycolmap, which brings its own copy: the process aborts in writing a PNG otherwise.
import zlib  # noqa: F401  isort: skip
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sparse

from ..arrays import number
from ..covariance.estimate import EstimateCovariance
from ..covariance.information import from_jacobian, from_schur
from ..errors import DataError, DegenerateError, MissingExtraError
from ..gauge.group import Group, Similarity
from ..gauge.layout import Index, Layout
from ..geometry.camera import distort, project
from ..geometry.so3 import Array, hat

try:
    import pycolmap
except ImportError as error:
    raise MissingExtraError(f"needs pycolmap: install it with `pip install pycolmap` ({error})") from error

# Columns up to which the Jacobian is not squared; above, points are eliminated.
_SMALL = 400
# Places of fx, fy, cx, cy, k1, k2, p1, p2 among a camera's parameters; -1 for a distortion of zero.
_MODELS = {
    "SIMPLE_PINHOLE": (0, 0, 1, 2, -1, -1, -1, -1),
    "PINHOLE": (0, 1, 2, 3, -1, -1, -1, -1),
    "SIMPLE_RADIAL": (0, 0, 1, 2, 3, -1, -1, -1),
    "RADIAL": (0, 0, 1, 2, 3, 4, -1, -1),
    "OPENCV": (0, 1, 2, 3, 4, 5, 6, 7),
}


def covariance(reconstruction: Any, *, sigma: float = 1.0, group: Group | None = None) -> EstimateCovariance:
    """The covariance of all registered images and their points, intrinsics and rigs held as they are.

    The reprojection errors are linearised here, all with the same weight: give the reconstruction after its
    bundle adjustment. The columns of an image are those of COLMAP's own covariances: rotation as *half* the
    angle of a turn that acts on cam_from_world from the left, then its translation;
    ``vigauge.as_convention(block, R, p=p, source="colmap", to="ros")`` gives angles and another side. Gauges
    name images, and the scale: ``(vg.KeyframeGauge(image_id), vg.Distance(image_id, other_id))``.

    Where a rig has several sensors, frames take the place of images: their ids are the keys, and the columns
    are those of rig_from_world. The known baselines then tell the scale.

    Parameters
    ----------
    reconstruction : pycolmap.Reconstruction; cameras SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV
    sigma : standard deviation of a keypoint's coordinate, pixels
    group : Similarity (7 directions) if not given

    Raises
    ------
    DataError
        for another camera, one without a place on its rig, a point with less than two images or behind one
    DegenerateError
        where more than the group is unobservable
    """
    sigma = number("sigma", sigma, above=0.0)
    if not isinstance(reconstruction, pycolmap.Reconstruction):
        kind = type(reconstruction).__name__
        raise DataError("reconstruction", "must be a pycolmap.Reconstruction", value=kind)
    ids = sorted(reconstruction.reg_image_ids())
    points = dict(sorted(reconstruction.points3D.items()))
    if not ids or not points:
        raise DataError("reconstruction", "must have registered images, and points that they see")
    images: dict[int, Any] = {key: reconstruction.image(key) for key in ids}
    for key, image in images.items():
        rig, sensor = reconstruction.rig(image.frame.rig_id), image.data_id.sensor_id
        if not (rig.is_ref_sensor(sensor) or rig.has_sensor_from_rig(sensor)):
            rule = "must know where this camera is on its rig: set its sensor_from_rig"
            raise DataError("reconstruction", rule, field=f"image {key}")
        if (model := image.camera.model_name) not in _MODELS:
            rule = f"must have cameras among {', '.join(_MODELS)}; undistort the images first"
            raise DataError("reconstruction", rule, field=f"image {key}", value=model)
    place = {key: k for k, key in enumerate(ids)}
    seen: list[tuple[int, int]] = []
    for k, (key, point) in enumerate(points.items()):
        own = [(place[e.image_id], k) for e in point.track.elements if e.image_id in place]
        seen += own
        if len(set(own)) < 2:
            raise DataError("reconstruction", "points must be seen by two images", field=f"point {key}")
    rigs = any(reconstruction.rig(image.frame.rig_id).num_sensors() > 1 for image in images.values())
    of = [image.frame_id if rigs else key for key, image in images.items()]
    keys = sorted(set(of))
    row = {key: k for k, key in enumerate(keys)}
    on_rig = [i.cam_from_world() * i.frame.rig_from_world.inverse() for i in images.values()]
    moved = {k: i.frame.rig_from_world for k, i in zip(of, images.values(), strict=True)}
    T = np.array([(moved[key] if rigs else images[key].cam_from_world()).matrix() for key in keys])
    X = np.array([point.xyz for point in points.values()])
    # A distortion that a model lacks is the zero behind the parameters.
    intrinsics = [np.append(i.camera.params, 0.0)[[*_MODELS[i.camera.model_name]]] for i in images.values()]
    S = np.array([sensor.matrix() if rigs else np.eye(3, 4) for sensor in on_rig])
    J = _jacobian(T, X, np.array(intrinsics), np.array(seen), [row[key] for key in of], S, ids) / sigma
    R, group = T[:, :, :3].swapaxes(1, 2), group or Similarity()
    poses = R, -np.einsum("nij,nj->ni", R, T[:, :, 3])
    layout = Layout.by_keyframe(len(keys), ["rotation", "position"], side="colmap", keys=keys)
    whole = replace(layout.with_points(len(X)), point_keys=list(points))
    if whole.n <= _SMALL:
        return from_jacobian(J, whole, poses, points=X, group=group)
    motion, structure = J[:, : layout.n], J[:, layout.n :]
    B = motion.T @ structure
    C = sparse.bsr_array(structure.T @ structure, blocksize=(3, 3))
    try:
        C_inverse = sparse.bsr_array((np.linalg.inv(C.data), C.indices, C.indptr))
    except np.linalg.LinAlgError as error:
        raise DegenerateError("a point of the reconstruction lies on one ray: it has no depth") from error
    reduced = motion.T @ motion - B @ (C_inverse @ B.T)
    found = from_schur(reduced, layout, poses, points=X, coupling=B, information=C.data, group=group)
    return replace(found, layout=whole)


def _jacobian(
    T: Array, X: Array, intrinsics: Array, elements: Index, rows: list[int], S: Array, ids: list[int]
) -> Any:
    """(2M, 6N + 3K) derivative of the pixels of the elements (image, point) by COLMAP's increments.

    Image k sees through the camera S[k] (3, 4) on what has the pose T[rows[k]] (3, 4).
    """
    image, point = elements.T
    at = np.array(rows)[image]
    R, t = T[at, :, :3], T[at, :, 3]
    turned = np.einsum("mij,mj->mi", R, X[point])
    in_camera = np.einsum("mij,mj->mi", S[image, :, :3], turned + t) + S[image, :, 3]
    if np.any(behind := in_camera[:, 2] <= 0.0):
        where = f"image {ids[image[np.argmax(behind)]]}"
        raise DataError("reconstruction", "must have its points in front of its images", field=where)
    fx, fy, _, _, k1, k2, p1, p2 = intrinsics[image].T
    xy, D = project(in_camera, 1.0, 1.0, 0.0, 0.0)
    D = np.stack([fx, fy], axis=1)[:, :, None] * (distort(xy, (k1, k2, p1, p2))[1] @ D @ S[image, :, :3])
    values = np.concatenate([-2.0 * D @ hat(turned), D, D @ R], axis=2)
    columns = np.column_stack([6 * at, 6 * len(T) + 3 * point]).repeat([6, 3], axis=1)
    columns += np.array([*range(6), *range(3)])
    triplets = values.ravel(), np.repeat(columns, 2, axis=0).ravel(), 9 * np.arange(2 * len(at) + 1)
    return sparse.csr_array(triplets, shape=(2 * len(at), 6 * len(T) + 3 * len(X)))
