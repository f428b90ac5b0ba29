"""The covariance of an estimator of one's own, from its singular Hessian H and its null directions U.

The estimator: a pose graph of position and yaw; five poses, relative measurements, one loop.
"""

import numpy as np

import vigauge as vg

# x, y, z, yaw
poses = np.array([[0, 0, 0, 0.0], [2, 0, 0, 0.8], [3, 2, 1, 1.6], [2, 4, 1, 2.5], [0, 4, 0, 3.1]])
edges = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]
sigma = np.array([0.05, 0.05, 0.05, 0.01])  # m, rad

H = np.zeros((20, 20))
for i, j in edges:
    # Measured: R_i^T (p_j - p_i) and yaw_j - yaw_i.
    c, s = np.cos(poses[i, 3]), np.sin(poses[i, 3])
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    J = np.zeros((4, 20))
    J[:3, 4 * j : 4 * j + 3], J[3, 4 * j + 3] = R.T, 1
    J[:3, 4 * i : 4 * i + 3], J[3, 4 * i + 3] = -R.T, -1
    J[:3, 4 * i + 3] = -R.T @ np.cross([0, 0, 1], poses[j, :3] - poses[i, :3])
    J /= sigma[:, None]
    H += J.T @ J

# Nothing measured tells a shift, or a turn of everything about z.
U = np.zeros((20, 4))
for k in range(5):
    U[4 * k : 4 * k + 3, :3] = np.eye(3)
    U[4 * k : 4 * k + 3, 3], U[4 * k + 3, 3] = np.cross([0, 0, 1], poses[k, :3]), 1

V = np.eye(20)[:, 8:12]  # the gauge: pose 2 is known
covariance = vg.covariance_from_hessian(H, U, V)
rest = np.delete(np.arange(20), np.arange(8, 12))
held = np.linalg.inv(H[np.ix_(rest, rest)])  # the same by hand: pose 2 taken out
print(f"sigma of pose 0: {np.sqrt(np.diag(covariance)[:4]).round(5)} m, rad")
difference = vg.relative_frobenius(covariance[np.ix_(rest, rest)], held)
print(f"relative difference from the inverse with pose 2 held: {difference:.0e}")
