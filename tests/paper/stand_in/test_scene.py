"""Ray-casts against what they mean: the first surface on the way, and nothing before it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vigauge.errors import VigaugeError
from vigauge.geometry.camera import distort_pixels
from vigauge_paper.stand_in.flight import R_WB_LEVEL, euroc_cameras
from vigauge_paper.stand_in.scene import FACES_PER_BOX, Box, Scene, hall, point_at_pixel, room

UNIT = st.floats(-1.0, 1.0, width=32)
RAY = st.tuples(UNIT, UNIT, UNIT).filter(lambda ray: np.linalg.norm(ray) > 1e-3)


@pytest.mark.parametrize("scene", [hall(), room()], ids=["hall", "room"])
@given(ray=RAY, start=st.tuples(UNIT, UNIT, UNIT))
def test_ray_ends_on_its_face_and_meets_nothing_before(scene, ray, start):
    """Catches a wrong face or side, a box seen from inside, hits behind, and rays along an axis."""
    origin = np.array([0.0, 0.0, 1.6]) + 0.5 * np.array(start)
    direction = np.array(ray)
    scale, face = scene.raycast(origin, direction[:, None])
    point = origin + scale[0] * direction
    box = scene.all_boxes()[face[0] // FACES_PER_BOX]
    axis, side = face[0] % FACES_PER_BOX // 2, face[0] % 2
    assert scale[0] > 0.0
    assert point[axis] == pytest.approx((box.low, box.high)[side][axis], abs=1e-9)
    assert np.all(np.array(box.low) - 1e-9 <= point) and np.all(point <= np.array(box.high) + 1e-9)
    way = origin + np.linspace(0.0, 1.0 - 1e-6, 400)[:, None] * (scale[0] * direction)
    assert np.all((way > scene.room.low) & (way < scene.room.high))
    for other in scene.boxes:
        inside = np.all((way > np.array(other.low) + 1e-9) & (way < np.array(other.high) - 1e-9), axis=1)
        assert not inside.any()


def test_axis_aligned_rays_meet_the_expected_faces():
    """Catches the sides of a face number exchanged; divisions by zero must not matter."""
    scene = Scene(Box((-4, -5, 0), (4, 5, 3)), (Box((1, -1, 0), (2, 1, 2)),), 0.01, 0.01)
    rays = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [2, 0, 0]]).T
    scale, face = scene.raycast(np.array([0.0, 0.0, 1.0]), rays)
    assert scale.tolist() == [1.0, 4.0, 5.0, 5.0, 2.0, 1.0, 0.5]
    assert face.tolist() == [FACES_PER_BOX, 0, 3, 2, 5, 4, FACES_PER_BOX]


def test_camera_outside_the_room_is_refused():
    """Catches a flight through the wall, whose images would be nonsense."""
    with pytest.raises(VigaugeError, match="inside the room"):
        room().raycast(np.array([0.0, 0.0, -0.1]), np.array([[1.0], [0.0], [0.0]]))


def test_level_body_looks_ahead_with_the_image_upright():
    """Catches a camera that looks at the ceiling, or stands on its side or head."""
    scene = Scene(Box((-9, -9, 0), (9, 9, 9)), (), 0.01, 0.01)
    for camera in euroc_cameras():
        centre = [camera.cx, camera.cy]
        uv = np.array([centre, np.add(centre, [0, -50]), np.add(centre, [50, 0])])
        X_W, depth, _ = point_at_pixel(scene, camera, R_WB_LEVEL, np.array([0.0, 0.0, 4.0]), uv)
        assert np.all(depth > 8.0)
        forward = X_W[0] - [0.0, 0.0, 4.0]
        assert forward[0] / np.linalg.norm(forward) > 0.99  # world x
        assert X_W[1, 2] > X_W[0, 2] + 0.5  # up in the image is up in the world
        assert X_W[2, 1] < X_W[0, 1] - 0.5  # right in the image is -y, looking along x


@given(st.lists(st.tuples(st.floats(0, 751), st.floats(0, 479)), min_size=1, max_size=20))
def test_point_at_pixel_projects_back_onto_the_pixel(pixels):
    """Catches distortion left out or applied twice, and extrinsics the wrong way round."""
    uv, p_W = np.array(pixels), np.array([0.3, -0.4, 1.5])
    for camera in euroc_cameras():
        X_W, depth, _ = point_at_pixel(room(), camera, R_WB_LEVEL, p_W, uv)
        X_C = ((X_W - p_W) @ R_WB_LEVEL - camera.p_BC) @ camera.R_BC
        assert np.allclose(X_C[:, 2], depth, rtol=1e-12)
        ideal = X_C[:, :2] / X_C[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        assert np.allclose(distort_pixels(camera, ideal), uv, rtol=0, atol=1e-8)
