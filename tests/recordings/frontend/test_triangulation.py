"""Triangulation with pycolmap and its checks."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import vigauge
from support.stereo_tracks import World, make_world, pixels
from vigauge.recordings.frontend.settings import TriangulationSettings
from vigauge.recordings.frontend.stereo import StereoGeometry
from vigauge.recordings.frontend.tracks import Tracks
from vigauge.recordings.frontend.triangulation import Verdict, parallax, triangulate, triangulate_pair
from vigauge_paper.stand_in.flight import euroc_cameras

SETTINGS = TriangulationSettings(parallax_deg=0.5)


def triangulated(world: World, tracks: Tracks | None = None, settings: TriangulationSettings = SETTINGS):
    return triangulate(world.cameras, world.p_M, world.R_MB, tracks or world.tracks, settings)


def single(views: list[tuple[int, int, np.ndarray]]) -> Tracks:
    """One track from (keyframe, camera, pixel)."""
    keyframe, camera, uv = zip(*views, strict=True)
    return Tracks(np.array(keyframe), np.array(camera), np.zeros(len(uv), dtype=np.int64), np.array(uv), 1)


def test_exact_views_give_exact_points() -> None:
    """Extrinsics inverted, cameras exchanged, rays not normalised: anything wrong in the geometry."""
    world = make_world(0, 6, 120)
    result = triangulated(world)
    assert np.count_nonzero(result.good) > 110
    np.testing.assert_allclose(result.points_W[result.good], world.X_M[result.good], atol=1e-6)
    assert np.all(np.isnan(result.points_W[~result.good]))
    assert sum(result.rejected().values()) == np.count_nonzero(~result.good)


def test_one_view_that_is_wrong_is_dropped_and_the_point_saved() -> None:
    """A landmark lost, or bent, by one bad observation out of many."""
    world = make_world(1, 6, 40)
    uv = world.tracks.uv.copy()
    first = np.searchsorted(world.tracks.track, np.arange(40))
    uv[first + 2] += [15.0, -12.0]
    result = triangulated(world, replace(world.tracks, uv=uv))
    assert np.count_nonzero(result.good) > 35
    np.testing.assert_allclose(result.points_W[result.good], world.X_M[result.good], atol=1e-6)
    good = result.good[world.tracks.track]
    dropped = np.flatnonzero(~result.used & good)
    np.testing.assert_array_equal(np.intersect1d(dropped, first + 2), dropped)


def pair_of_views(depth_m: float, lateral_m: float) -> tuple[World, np.ndarray]:
    """Two keyframes ``lateral_m`` apart across the view, and a point ``depth_m`` ahead between them."""
    left = euroc_cameras()[0]
    ahead, across = left.R_BC @ [0.0, 0.0, 1.0], left.R_BC @ [1.0, 0.0, 0.0]
    p_M = np.array([-0.5 * lateral_m * across, 0.5 * lateral_m * across])
    world = make_world(2, 2, 1)
    point = depth_m * ahead + left.p_BC
    return replace(world, p_M=p_M, R_MB=np.tile(np.eye(3), (2, 1, 1))), point


@pytest.mark.parametrize(("lateral_m", "good"), [(0.3, True), (0.05, False)])
def test_parallax_decides_at_its_threshold(lateral_m: float, good: bool) -> None:
    """Degrees taken for radians: far points, which cost iterations, would pass."""
    world, point = pair_of_views(5.0, lateral_m)
    views = [(k, 0, pixels(world.cameras[0], world.p_M[k], world.R_MB[k], point[None])[0]) for k in (0, 1)]
    result = triangulated(world, single(views), TriangulationSettings(parallax_deg=2.0))
    assert result.verdict[0] == (Verdict.GOOD if good else Verdict.PARALLAX)


def test_point_behind_the_cameras_is_refused() -> None:
    """pycolmap gives it without complaint: rays that meet behind the cameras."""
    world, point = pair_of_views(-3.0, 0.4)
    camera = world.cameras[0]
    views = []
    for k in (0, 1):
        behind_C = camera.R_BC.T @ (point - world.p_M[k] - camera.p_BC)
        views.append((k, 0, behind_C[:2] / behind_C[2] * [camera.fx, camera.fy] + [camera.cx, camera.cy]))
    result = triangulated(world, single(views))
    assert result.verdict[0] in (Verdict.DEPTH, Verdict.REPROJECTION, Verdict.NO_SOLUTION)
    assert np.all(np.isnan(result.points_W))


@pytest.mark.parametrize(
    ("depth_m", "verdict"), [(0.2, Verdict.DEPTH), (30.0, Verdict.DEPTH), (5.0, Verdict.GOOD)]
)
def test_depth_range_is_kept(depth_m: float, verdict: Verdict) -> None:
    """A point on the lens or at the horizon."""
    world, point = pair_of_views(depth_m, 0.02 * depth_m + 0.05)
    views = [(k, 0, pixels(world.cameras[0], world.p_M[k], world.R_MB[k], point[None])[0]) for k in (0, 1)]
    settings = TriangulationSettings(parallax_deg=0.0, least_depth_m=0.5, largest_depth_m=20.0)
    assert triangulated(world, single(views), settings).verdict[0] == verdict


def test_rays_that_do_not_meet_are_refused() -> None:
    """Large vertical disparity, which a two-view solver swallows."""
    world, point = pair_of_views(3.0, 0.4)
    views = [(k, 0, pixels(world.cameras[0], world.p_M[k], world.R_MB[k], point[None])[0]) for k in (0, 1)]
    views[1] = (1, 0, views[1][2] + [0.0, 40.0])
    assert triangulated(world, single(views)).verdict[0] == Verdict.REPROJECTION


def test_stereo_alone_is_too_few_keyframes_unless_allowed() -> None:
    """The two views of one keyframe counted as two keyframes."""
    world = make_world(3, 1, 30, depth_m=(1.0, 3.0))
    strict = triangulated(world)
    assert set(strict.verdict) == {Verdict.TOO_FEW_VIEWS}
    loose = triangulated(world, settings=replace(SETTINGS, keyframes=1))
    assert np.count_nonzero(loose.good) > 15
    np.testing.assert_allclose(loose.points_W[loose.good], world.X_M[loose.good], atol=1e-6)


def test_track_without_observations_is_counted_not_fatal() -> None:
    """A gap in the track numbers, which dropping observations leaves behind."""
    world = make_world(4, 3, 10)
    result = triangulated(world, world.tracks.where(world.tracks.track != 4))
    assert result.verdict[4] == Verdict.TOO_FEW_VIEWS
    nothing = triangulated(world, world.tracks.where(np.zeros(len(world.tracks.track), dtype=bool)))
    assert not np.any(nothing.good)


@given(st.integers(0, 10_000))
def test_parallax_is_the_largest_angle_between_any_two_rays(seed: int) -> None:
    """Only neighbours compared, or rays of different tracks mixed up."""
    rng = np.random.default_rng(seed)
    track = np.sort(rng.integers(0, 4, 12))
    rays = rng.standard_normal((12, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    expected = [
        max(
            [float(np.arccos(np.clip(a @ b, -1, 1))) for a in rays[track == t] for b in rays[track == t]]
            + [0.0]
        )
        for t in range(5)
    ]
    np.testing.assert_allclose(parallax(rays, track, 5), expected, atol=1e-6)


def test_stereo_pairs_give_points_in_the_left_camera() -> None:
    """Points in the body instead of the camera, or rays that meet behind taken for points ahead."""
    world = make_world(5, 1, 60, depth_m=(0.8, 4.0))
    left, right = world.cameras
    uv = [pixels(c, world.p_M[0], world.R_MB[0], world.X_M) for c in world.cameras]
    both = np.isfinite(uv[0][:, 0]) & np.isfinite(uv[1][:, 0])
    points = triangulate_pair(StereoGeometry(left, right), uv[0][both], uv[1][both])
    np.testing.assert_allclose(points @ left.R_BC.T + left.p_BC, world.X_M[both], atol=1e-6)
    # Disparity that cannot be: the rays part ahead and meet behind.
    parting = triangulate_pair(StereoGeometry(left, right), uv[0][both], uv[1][both] + [250.0, 0.0])
    assert np.all(np.isnan(parting))


WRITERS = {
    "npz": "import numpy as np; np.savez_compressed('a.npz', x=np.zeros(1000))",
    "png": "import cv2, numpy as np; assert cv2.imwrite('a.png', np.zeros((64, 64), np.uint8))",
    "pdf": "import matplotlib.figure as m; f = m.Figure(); f.subplots().plot([1, 2]); f.savefig('a.pdf')",
    "gzip": "import gzip; gzip.compress(b'x' * 10000)",
}


@pytest.mark.parametrize("writer", sorted(WRITERS))
def test_files_can_be_written_after_the_front_end_was_imported(writer: str, tmp_path: Path) -> None:
    """pycolmap loaded before zlib aborts the process at the first compressed file.

    pytest has zlib loaded, so only a fresh interpreter shows it.
    """
    code = f"import vigauge.recordings.frontend.triangulation\n{WRITERS[writer]}"
    source = str(Path(vigauge.__file__).parents[1])
    environment = os.environ | {"PYTHONPATH": source, "MPLCONFIGDIR": str(tmp_path)}
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stderr.decode()


def test_zlib_comes_before_pycolmap_in_the_source() -> None:
    """An import sorter that puts pycolmap first; other imports may hide it from the test above."""
    text = (
        Path(vigauge.__file__)
        .with_name("recordings")
        .joinpath("frontend", "triangulation.py")
        .read_text("utf-8")
    )
    imports = [line.split()[1] for line in text.splitlines() if line.startswith("import ")]
    assert imports.index("zlib") < imports.index("pycolmap")
