"""Files of other tools for the tests, with their residuals as those tools define them."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.long_double import jacobian, turned

OFFSET = np.array([0.2, -0.1, 0.3, *Rotation.from_rotvec([0.3, -0.5, 0.2]).as_quat()])


def words(*values: Any) -> str:
    return " ".join(map(repr, np.concatenate([np.ravel(value) for value in values]).tolist()))


def information(rng: np.random.Generator, size: int) -> np.ndarray:
    A = rng.standard_normal((size, size))
    return np.asarray(A @ A.T + size * np.eye(size))


def compose(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Poses as rows x y z qx qy qz qw."""
    R, S = Rotation.from_quat(a[3:]), Rotation.from_quat(b[3:])
    return np.concatenate([a[:3] + R.apply(b[:3]), (R * S).as_quat()])


def inverse(a: np.ndarray) -> np.ndarray:
    R = Rotation.from_quat(a[3:]).inv()
    return np.concatenate([-R.apply(a[:3]), R.as_quat()])


def moved(pose: np.ndarray, step: np.ndarray) -> np.ndarray:
    """g2o's VertexSE3: the pose times (shift, vector part of a quaternion)."""
    return compose(pose, np.concatenate([step, [np.sqrt(1.0 - step[3:] @ step[3:])]]))


class Space:
    """A loop of poses with points, its file, and the residuals of g2o's EdgeSE3 and EdgeSE3PointXYZ."""

    def __init__(self, noise: float) -> None:
        rng = np.random.default_rng(8)
        turns = Rotation.from_rotvec(rng.uniform(-2.0, 2.0, (5, 3))).as_quat()
        self.poses = np.concatenate([rng.uniform(-3.0, 3.0, (5, 3)), turns], axis=1)
        self.points = rng.uniform(-4.0, 4.0, (3, 3))
        self.numbers, self.point_numbers = [7, 0, 30, 3, 11], [100, 50, 70]
        self.edges, self.sights = [], []
        for i, j in [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0), (0, 2)]:
            wrong = moved(compose(inverse(self.poses[i]), self.poses[j]), noise * rng.uniform(-1, 1, 6))
            self.edges.append((i, j, wrong, information(rng, 6)))
        for i in range(5):
            for k in range(3):
                seen = compose(
                    inverse(compose(self.poses[i], OFFSET)), np.array([*self.points[k], 0, 0, 0, 1])
                )
                self.sights.append((i, k, seen[:3] + noise * rng.uniform(-1, 1, 3), information(rng, 3)))

    def write(self, path: Path) -> Path:
        lines = [f"PARAMS_SE3OFFSET 3 {words(OFFSET)}", "FIX 7  # a gauge"]
        lines += [
            f"VERTEX_SE3:QUAT {n} {words(pose)}" for n, pose in zip(self.numbers, self.poses, strict=True)
        ]
        lines += [
            f"VERTEX_TRACKXYZ {n} {words(X)}" for n, X in zip(self.point_numbers, self.points, strict=True)
        ]
        for i, j, z, omega in self.edges:
            numbers = words(z, omega[np.triu_indices(6)])
            lines.append(f"EDGE_SE3:QUAT {self.numbers[i]} {self.numbers[j]} {numbers}")
        for i, k, z, omega in self.sights:
            numbers = words(z, omega[np.triu_indices(3)])
            lines.append(f"EDGE_SE3_TRACKXYZ {self.numbers[i]} {self.point_numbers[k]} 3 {numbers}")
        path.write_text("\n".join(lines) + "\n")
        return path

    def residuals(self, step: np.ndarray) -> np.ndarray:
        poses = [moved(pose, d) for pose, d in zip(self.poses, step[:30].reshape(5, 6), strict=True)]
        points = self.points + step[30:].reshape(3, 3)
        out = []
        for i, j, z, omega in self.edges:
            delta = compose(inverse(z), compose(inverse(poses[i]), poses[j]))
            error = np.concatenate([delta[:3], delta[3:6] * np.sign(delta[6])])
            out.append(np.linalg.cholesky(omega).T @ error)
        for i, k, z, omega in self.sights:
            seen = compose(inverse(compose(poses[i], OFFSET)), np.array([*points[k], 0, 0, 0, 1]))[:3]
            out.append(np.linalg.cholesky(omega).T @ (seen - z))
        return np.concatenate(out)


class Plane:
    """As Space, in the plane: EdgeSE2 and EdgeSE2PointXY; VertexSE2 adds x, y and the angle."""

    def __init__(self) -> None:
        rng = np.random.default_rng(9)
        self.poses, self.points = rng.uniform(-3.0, 3.0, (5, 3)), rng.uniform(-4.0, 4.0, (2, 2))
        self.joined = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]
        zero = self.residuals(np.zeros(19), whiten=False)
        self.measured = zero + 0.1 * rng.uniform(-1, 1, len(zero))
        self.omegas = [information(rng, size) for size in [3] * 5 + [2] * 10]

    def residuals(self, step: np.ndarray, whiten: bool = True) -> np.ndarray:
        poses = self.poses + step[:15].reshape(5, 3)
        points = self.points + step[15:].reshape(2, 2)
        out = []

        def seen(i: int, point: np.ndarray) -> np.ndarray:
            c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
            return np.array([[c, s], [-s, c]]) @ (point - poses[i, :2])

        for e, (i, j) in enumerate(self.joined):
            raw = np.append(seen(i, poses[j, :2]), poses[j, 2] - poses[i, 2])
            if whiten:  # EdgeSE2 turns the difference into the measured frame
                raw = raw - self.measured[3 * e : 3 * e + 3]
                c, s = np.cos(self.measured[3 * e + 2]), np.sin(self.measured[3 * e + 2])
                raw[:2] = np.array([[c, s], [-s, c]]) @ raw[:2]
            out.append(raw)
        for e, (i, k) in enumerate((i, k) for i in range(5) for k in range(2)):
            out.append(seen(i, points[k]) - (self.measured[15 + 2 * e : 17 + 2 * e] if whiten else 0.0))
        if whiten:
            halves = [np.linalg.cholesky(omega).T for omega in self.omegas]
            out = [half @ part for half, part in zip(halves, out, strict=True)]
        return np.concatenate(out)

    def write(self, path: Path) -> Path:
        lines = [f"VERTEX_SE2 {3 * n} {words(pose)}" for n, pose in enumerate(self.poses)]
        lines += [f"VERTEX_XY {n + 1} {words(point)}" for n, point in enumerate(self.points)]
        for e, (i, j) in enumerate(self.joined):
            numbers = words(self.measured[3 * e : 3 * e + 3], self.omegas[e][np.triu_indices(3)])
            lines.append(f"EDGE_SE2 {3 * i} {3 * j} {numbers}")
        for e, (i, k) in enumerate((i, k) for i in range(5) for k in range(2)):
            numbers = words(self.measured[15 + 2 * e : 17 + 2 * e], self.omegas[5 + e][np.triu_indices(2)])
            lines.append(f"EDGE_SE2_XY {3 * i} {k + 1} {numbers}")
        path.write_text("\n".join(lines) + "\n")
        return path


CAMERAS, POINTS = 4, 25


class Adjustment:
    """Cameras around points, all seen by all, at an estimate that is not quite the best."""

    def __init__(self, cameras: int = CAMERAS, points: int = POINTS) -> None:
        rng = np.random.default_rng(4)
        self.cameras, self.points = cameras, points
        self.X = rng.uniform(-1.0, 1.0, (points, 3))
        self.turns = Rotation.from_rotvec(rng.uniform(-0.7, 0.7, (cameras, 3)))
        self.t = np.array([0.0, 0.0, -5.0]) + rng.uniform(-0.5, 0.5, (cameras, 3))
        self.own = np.column_stack([rng.uniform(400, 600, cameras), rng.uniform(-0.1, 0.1, (cameras, 2))])
        self.R = self.turns.inv().as_matrix()
        self.p = -np.einsum("nij,nj->ni", self.R.astype(np.longdouble), self.t)
        pixels = self.pixels(np.zeros(self.n)).astype(float)
        self.pixels_seen = pixels + rng.standard_normal(len(pixels))

    @property
    def n(self) -> int:
        return 9 * self.cameras + 3 * self.points

    def pixels(self, step: np.ndarray) -> np.ndarray:
        """P = R X + t; p = -P / P.z; f r(p) p, r = 1 + k1 |p|^2 + k2 |p|^4; by left increments."""
        head = 9 * self.cameras
        cameras, X = step[:head].reshape(-1, 9), self.X + step[head:].reshape(-1, 3)
        out = []
        for n, d in enumerate(cameras):
            P = (X - self.p[n] - d[:3]) @ turned(d[3:6]) @ self.R[n]
            xy = -P[:, :2] / P[:, 2:]
            r2 = np.sum(xy**2, axis=1, keepdims=True)
            f, k1, k2 = self.own[n] + d[6:]
            out.append(f * (1.0 + k1 * r2 + k2 * r2**2) * xy)
        return np.concatenate(out).ravel()

    def jacobian(self) -> np.ndarray:
        return jacobian(self.pixels, self.n)

    def null_space(self) -> np.ndarray:
        """(n, 7) shifts, turns about the origin and the scale of all cameras and points."""
        T = np.zeros((self.n, 7), np.longdouble)
        at = T[: 9 * self.cameras].reshape(-1, 9, 7), T[9 * self.cameras :].reshape(-1, 3, 7)
        for part, place in zip(at, (self.p, self.X), strict=True):
            part[:, :3, :3], part[:, :3, 6] = np.eye(3), place
            part[:, :3, 3:6] = np.cross(np.eye(3)[None], place[:, None]).swapaxes(1, 2)
        at[0][:, 3:6, 3:6] = np.eye(3)
        return T

    def write(self, path: Path) -> Path:
        lines = [f"{self.cameras} {self.points} {self.cameras * self.points}"]
        for k, (x, y) in enumerate(self.pixels_seen.reshape(-1, 2).tolist()):
            lines.append(f"{k // self.points} {k % self.points}     {x!r} {y!r}")
        cameras = np.column_stack([self.turns.as_rotvec(), self.t, self.own])
        lines += map(repr, [*cameras.ravel().tolist(), *self.X.ravel().tolist()])
        path.write_text("\n".join(lines) + "\n")
        return path
