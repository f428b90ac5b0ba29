"""A Jacobian as Ceres writes it: the page's C++ compiled and run, its covariance against Ceres' own."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from support import ROOT
from vigauge.adapters import ceres

LAYOUT = vg.Layout.by_keyframe(3, ["position", "rotation"], points=6, side="ceres")

# Points in the frames of three bodies, with a robust loss; Ceres holds the first pose for its covariance.
MAIN = """
struct Seen {
  double z[3];
  template <typename T> bool operator()(const T* p, const T* q, const T* X, T* r) const {
    const T inverse[4] = {q[0], -q[1], -q[2], -q[3]}, d[3] = {X[0] - p[0], X[1] - p[1], X[2] - p[2]};
    ceres::UnitQuaternionRotatePoint(inverse, d, r);
    for (int k = 0; k < 3; ++k) r[k] = (r[k] - T(z[k])) / T(0.1 * (k + 1));
    return true;
  }
};
int main() {
  ceres::Problem problem;
  std::vector<double> p(9), q(12), X(18);
  std::vector<double*> blocks;
  for (int k = 0; k < 9; ++k) p[k] = std::sin(5.0 * k);
  for (int k = 0; k < 18; ++k) X[k] = 4.0 * std::cos(7.0 * k);
  for (int i = 0; i < 3; ++i) {
    const double turn[3] = {0.7 * i, -0.5 + i, 0.9};
    ceres::AngleAxisToQuaternion(turn, &q[4 * i]);
    blocks.push_back(&p[3 * i]);
    blocks.push_back(&q[4 * i]);
  }
  for (int j = 0; j < 6; ++j) blocks.push_back(&X[3 * j]);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 6; ++j) {
      const double inverse[4] = {q[4 * i], -q[4 * i + 1], -q[4 * i + 2], -q[4 * i + 3]};
      const double d[3] = {X[3 * j] - p[3 * i], X[3 * j + 1] - p[3 * i + 1], X[3 * j + 2] - p[3 * i + 2]};
      auto* seen = new Seen;
      ceres::UnitQuaternionRotatePoint(inverse, d, seen->z);
      seen->z[(i + j) % 3] += 0.05 * (j - 2);
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Seen, 3, 3, 4, 3>(seen),
                               new ceres::HuberLoss(0.4), &p[3 * i], &q[4 * i], &X[3 * j]);
    }
  for (int i = 0; i < 3; ++i) problem.SetManifold(&q[4 * i], new ceres::QuaternionManifold);
  WriteJacobian(problem, blocks);
  problem.SetParameterBlockConstant(blocks[0]);
  problem.SetParameterBlockConstant(blocks[1]);
  ceres::Covariance covariance{ceres::Covariance::Options()};
  const std::vector<const double*> last = {blocks[4], blocks[5], blocks[9]};
  if (!covariance.Compute(last, &problem)) return 1;
  std::vector<double> C(81);
  covariance.GetCovarianceMatrixInTangentSpace(last, C.data());
  const auto save = [](const char* name, const std::vector<double>& v) {
    std::ofstream(name, std::ios::binary).write(reinterpret_cast<const char*>(v.data()), 8 * v.size());
  };
  save("p.bin", p), save("q.bin", q), save("X.bin", X), save("C.bin", C);
}
"""


@pytest.mark.oracle
def test_the_pages_cpp_against_the_covariance_of_ceres(tmp_path: Path) -> None:
    """Catches C++ that does not compile, a side or half angle of another kind, weights that get lost."""
    if shutil.which("g++") is None or not Path("/usr/include/ceres/manifold.h").exists():
        pytest.skip("needs g++ and libceres-dev, 2.1 or later")
    page = (ROOT / "docs" / "from_your_estimator.md").read_text("utf-8")
    (code,) = re.findall(r"^```cpp\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    (tmp_path / "write.cpp").write_text("#include <ceres/rotation.h>\n#include <cmath>\n" + code + MAIN)
    for command in (
        ["g++", "-std=c++17", "-I/usr/include/eigen3", "write.cpp", "-o", "write", "-lceres", "-lglog"],
        [str(tmp_path / "write")],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    p, q, X, expected = (np.fromfile(tmp_path / f"{name}.bin") for name in ("p", "q", "X", "C"))
    w, x, y, z = q.reshape(-1, 4).T
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    R = np.stack(rows, axis=1).reshape(-1, 3, 3)
    found = ceres.covariance(
        tmp_path, LAYOUT, (R, p.reshape(-1, 3)), points=X.reshape(-1, 3), group=vg.Euclidean()
    )
    assert found.open == vg.Euclidean().directions
    columns = np.concatenate([found.layout.columns(2), found.layout.points[3]])
    block = found.entries(columns, columns, vg.KeyframeGauge(0))
    assert vg.relative_frobenius(block, expected.reshape(9, 9)) < 1e-8


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rows": [0, 2, 5]}, "rows: must increase from 0 to 3"),
        ({"rows": [0, 3, 2, 3]}, "rows: must increase from 0 to 3"),
        ({"cols": [0, 1, 36]}, "cols: must lie in 0..35: the layout has 36 columns"),
        ({"values": [1.0, np.nan, 1.0]}, "values: must be finite"),
        ({"values": [1.0]}, "values: must have shape"),
    ],
)
def test_files_that_do_not_fit_are_refused(
    tmp_path: Path, changes: dict[str, list[float]], words: str
) -> None:
    for name, values in ({"rows": [0, 2, 3], "cols": [0, 1, 2], "values": [1.0, 2.0, 3.0]} | changes).items():
        np.array(values, float if name == "values" else np.int32).tofile(tmp_path / f"{name}.bin")
    poses, points = (np.tile(np.eye(3), (3, 1, 1)), np.eye(3)), np.zeros((6, 3))
    with pytest.raises(vg.DataError, match=words) as refused:
        ceres.covariance(tmp_path, LAYOUT, poses, points=points)
    assert refused.value.file == str(tmp_path)
    (tmp_path / "cols.bin").write_bytes(b"123456")
    with pytest.raises(vg.DataError, match="whole numbers of 4 bytes .* its end is missing"):
        ceres.covariance(tmp_path, LAYOUT, poses, points=points)
    (tmp_path / "cols.bin").unlink()
    with pytest.raises(vg.DataError, match="cols.bin: file must exist"):
        ceres.covariance(tmp_path, LAYOUT, poses, points=points)
    (tmp_path / "cols.txt").write_text("0 1\n2.5\n")
    with pytest.raises(vg.DataError, match="cols.txt, row 2"):
        ceres.covariance(tmp_path, LAYOUT, poses, points=points)


def test_text_is_read_as_binary_is(tmp_path: Path) -> None:
    J = np.random.default_rng(0).standard_normal((5, 4)) * [1e-9, 1.0, 1e9, 0.0]
    J = scipy.sparse.csr_array(J)
    parts = {"rows": J.indptr, "cols": J.indices, "values": J.data}
    for ending in ("txt", "bin"):
        for name, part in parts.items():
            if ending == "bin":
                part.tofile(tmp_path / f"{name}.bin")
            else:
                (tmp_path / f"{name}.txt").write_text("\n".join(map(repr, part.tolist())))
        np.testing.assert_array_equal(ceres.read_jacobian(tmp_path, 4).toarray(), J.toarray())
