"""From arrays to a covariance: states, observations and inertial samples of one's own, no file."""

import numpy as np

import vigauge as vg

# The truth: 5 s on a circle of 2 m at 0.6 rad/s, looking ahead; 200 samples and 2 keyframes a second.
rng = np.random.default_rng(0)
t_ns = np.arange(0, 1001) * 5_000_000
angle, zero = 0.6e-9 * t_ns, 0.0 * t_ns
out = np.stack([np.cos(angle), np.sin(angle), zero], axis=1)
ahead = np.stack([-np.sin(angle), np.cos(angle), zero], axis=1)
R_WB = np.stack([ahead, -out, zero[:, None] + [0, 0, 1]], axis=2)  # body: x ahead, y left, z up

# The samples, with white noise: density times the square root of the rate.
noise = vg.ImuNoise(gyro_density=2e-4, accel_density=2e-3)
gyro = [0, 0, 0.6] + rng.normal(0, 2e-4 * 200**0.5, (1001, 3))
accel = [0, 2 * 0.6**2, 9.81] + rng.normal(0, 2e-3 * 200**0.5, (1001, 3))
samples, ends = vg.ImuSamples(t_ns, gyro, accel), zip(t_ns[:-100:100], t_ns[100::100], strict=True)
factors = vg.InertialFactors.chain([vg.preintegrate(samples, int(a), int(b), noise) for a, b in ends])

# What a camera that looks ahead sees of 150 points, to one pixel.
R_BC = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
camera = vg.Camera(300, 300, 320, 240, 640, 480, (0, 0, 0, 0), R_BC, np.zeros(3))
p, v, R, X = 2 * out[::100], 1.2 * ahead[::100], R_WB[::100], rng.uniform([-8, -8, -3], [8, 8, 3], (150, 3))
X_C = np.einsum("nji,nkj->nki", R @ R_BC, X - p[:, None])
uv = X_C[..., :2] / X_C[..., 2:] * 300 + [320, 240]
seen = (X_C[..., 2] > 0.5) & np.all((uv > 0) & (uv < [640, 480]), axis=2)
keyframe, landmark = np.nonzero(seen := seen & (seen.sum(axis=0) >= 3))
kept, landmark = np.unique(landmark, return_inverse=True)  # numbered without gaps
pixels = uv[seen] + rng.normal(0, 1.0, (len(landmark), 2))

start = vg.State.start(p + rng.normal(0, 0.05, p.shape), R, v, X[kept] + rng.normal(0, 0.1, (len(kept), 3)))
observations = keyframe, np.zeros_like(keyframe), landmark, pixels
problem = vg.Problem.from_observations(start, (camera,), *observations, 1.0, factors, 9.81)
solution = vg.solve(problem, vg.FreeGauge())
covariance = vg.motion_covariance(problem, solution.state, vg.KeyframeGauge(index=0))
print(f"{solution.status}: {len(kept)} landmarks, {len(pixels)} pixels, {solution.iterations} iterations")
print(f"sigma of the last position: {np.sqrt(np.diag(covariance)[30:33]).round(5)} m")
