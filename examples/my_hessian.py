"""The covariance of an estimator of one's own, from its singular sparse Hessian H.

The estimator: a pose graph of position and yaw; five poses, relative measurements, one loop.
"""

import numpy as np
import scipy.sparse

import vigauge as vg

# x, y, z, yaw
poses = np.array([[0, 0, 0, 0.0], [2, 0, 0, 0.8], [3, 2, 1, 1.6], [2, 4, 1, 2.5], [0, 4, 0, 3.1]])
edges = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]
sigma = np.array([0.05, 0.05, 0.05, 0.01])  # m, rad

H = scipy.sparse.csc_array((20, 20))
for i, j in edges:
    # Measured: R_i^T (p_j - p_i) and yaw_j - yaw_i.
    c, s = np.cos(poses[i, 3]), np.sin(poses[i, 3])
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    J = np.zeros((4, 20))
    J[:3, 4 * j : 4 * j + 3], J[3, 4 * j + 3] = R.T, 1
    J[:3, 4 * i : 4 * i + 3], J[3, 4 * i + 3] = -R.T, -1
    J[:3, 4 * i + 3] = -R.T @ np.cross([0, 0, 1], poses[j, :3] - poses[i, :3])
    J = scipy.sparse.csc_array(J / sigma[:, None])
    H = H + J.T @ J

# What the columns are, and where the poses stand. Nothing measured tells a shift, or a turn about z.
layout = vg.Layout.by_keyframe(5, ["position", "rotation:1"])  # a heading alone
turns = np.array([[[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in poses[:, 3]])
covariance = vg.Covariance.from_hessian(H, layout, (turns, poses[:, :3]))
pose_2 = vg.KeyframeGauge(2)  # the gauge: pose 2 is known
rest = np.delete(np.arange(20), np.arange(8, 12))
held = np.linalg.inv(H.toarray()[np.ix_(rest, rest)])  # the same by hand: pose 2 taken out
print(f"sigma of pose 0: {np.sqrt(np.diag(covariance.block(0, 0, pose_2))).round(5)} m, rad")
difference = vg.relative_frobenius(covariance.matrix(pose_2)[np.ix_(rest, rest)], held)
print(f"relative difference from the inverse with pose 2 held: {difference:.0e}")
