// A problem through native Ceres: the residuals of Eq. (1) with analytic Jacobians, Ceres' own
// trust-region loop, Schur elimination and covariance.
//
//   ceres_solver PROBLEM.bin THREADS FUNCTION_TOLERANCE MAXIMUM_ITERATIONS
//
// Then one request a line on stdin, one line of JSON on stdout for each:
//   prepare GAUGE          nothing to do here: problems are built in every solve, which is not timed
//   loss NAME DELTA        huber or cauchy, of reprojection errors, from now on; squares without it
//   solve GAUGE TYPE       fix, prior or free; dense_schur or sparse_schur; from the file's start every time
//   state PATH             write the last estimate
//   at PATH                read an estimate, where covariances are taken
//   covariance GAUGE TYPE  sparse_qr (fix, prior) or dense_svd (free) of the whole motion block
//   matrix PATH            write the last covariance
//
// What helps Ceres is done: a pose is one block, so that rows have the sizes (2, 3, 6) for which its
// Schur eliminator is compiled; the Jacobian by a pose is given by tangent directions and the
// manifold's derivative is the identity, so no chain rule through quaternions is paid for.
// Pose blocks are (p, q) with q = (w, x, y, z) and left increments; the first one is
// (p, dphi_0) with the total increment of Eq. (9), six plain numbers. Where biases are estimated, the block of a
// keyframe's velocity has them too: (v, gyroscope bias, accelerometer bias).

#include <ceres/ceres.h>
#include <sys/resource.h>

#include <Eigen/Dense>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using Eigen::Map;
using Matrix3 = Eigen::Matrix3d;
using Vector3 = Eigen::Vector3d;
using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Matrix9 = Eigen::Matrix<double, 9, 9, Eigen::RowMajor>;
using Vector9 = Eigen::Matrix<double, 9, 1>;
using Vector15 = Eigen::Matrix<double, 15, 1>;
template <int kRows, int kColumns>
using RowMatrix = Eigen::Matrix<double, kRows, kColumns, Eigen::RowMajor>;

constexpr double kPriorWeight = 1e5;  // Section V-A

Matrix3 Hat(const Vector3& a) {
  Matrix3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

Eigen::Quaterniond ExpQuaternion(const Vector3& phi) {
  const double angle = phi.norm();
  const double half = 0.5 * angle;
  const double scale = angle > 1e-8 ? std::sin(half) / angle : 0.5 - angle * angle / 48.0;
  return {std::cos(half), scale * phi.x(), scale * phi.y(), scale * phi.z()};
}

Vector3 LogQuaternion(Eigen::Quaterniond q) {
  if (q.w() < 0) q.coeffs() *= -1.0;
  const double sine = q.vec().norm();
  const double scale = sine > 1e-8 ? 2.0 * std::atan2(sine, q.w()) / sine : 2.0 / q.w();
  return scale * q.vec();
}

Matrix3 LeftJacobian(const Vector3& phi) {
  const double a2 = phi.squaredNorm(), a = std::sqrt(a2);
  const double b = a > 1e-4 ? (1.0 - std::cos(a)) / a2 : 0.5 - a2 / 24.0;
  const double c = a > 1e-4 ? (a - std::sin(a)) / (a2 * a) : 1.0 / 6.0 - a2 / 120.0;
  const Matrix3 h = Hat(phi);
  return Matrix3::Identity() + b * h + c * h * h;
}

Matrix3 RightJacobianInverse(const Vector3& phi) {
  const double a2 = phi.squaredNorm(), a = std::sqrt(a2);
  const double c = a > 1e-3 ? 1.0 / a2 - (1.0 + std::cos(a)) / (2.0 * a * std::sin(a)) : 1.0 / 12.0 + a2 / 720.0;
  const Matrix3 h = Hat(phi);
  return Matrix3::Identity() + 0.5 * h + c * h * h;
}

struct Camera {
  double fx, fy, cx, cy;
  Matrix3 R_CB;
  Vector3 p_CB;
};

struct State {
  std::vector<double> p, R, v, X, dphi_0, gyro_bias, accel_bias;
};

struct Data {
  int64_t n, k, cameras, m, factors, width;  // width: parameters of a keyframe, 9 or 15
  double sigma_px, gravity;
  State start;
  Matrix3 R_ref;
  std::vector<Camera> camera;
  std::vector<int64_t> obs_keyframe, obs_camera, obs_landmark, first, second;
  std::vector<double> uv, dt, dp, dR, dv, whitener, by_gyro_bias, by_accel_bias, gyro_bias, accel_bias;
  int64_t Speed() const { return width - 6; }  // size of the block of a velocity, and its biases
};

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), stream_(path, std::ios::binary) {
    if (!stream_) throw std::runtime_error(path + ": file must exist");
  }
  void Magic(const char* word) {
    char found[8] = {};
    stream_.read(found, 8);
    if (!stream_ || std::memcmp(found, word, 8) != 0) throw std::runtime_error(path_ + ": must begin with " + word);
  }
  template <typename T>
  std::vector<T> Take(int64_t count) {
    std::vector<T> values(count);
    stream_.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(count * sizeof(T)));
    if (!stream_) throw std::runtime_error(path_ + ": is cut short");
    return values;
  }
  void End() {
    if (stream_.peek() != std::ifstream::traits_type::eof()) throw std::runtime_error(path_ + ": is too long");
  }

 private:
  std::string path_;
  std::ifstream stream_;
};

State TakeState(Reader& in, int64_t n, int64_t k, int64_t width) {
  State s;
  s.p = in.Take<double>(3 * n);
  s.R = in.Take<double>(9 * n);
  s.v = in.Take<double>(3 * n);
  s.X = in.Take<double>(3 * k);
  s.dphi_0 = in.Take<double>(3);
  if (width == 15) s.gyro_bias = in.Take<double>(3 * n), s.accel_bias = in.Take<double>(3 * n);
  return s;
}

Data ReadProblem(const std::string& path) {
  Reader in(path);
  in.Magic("VIGPROB2");
  Data d;
  const auto sizes = in.Take<int64_t>(6);
  d.n = sizes[0], d.k = sizes[1], d.cameras = sizes[2], d.m = sizes[3], d.factors = sizes[4];
  d.width = sizes[5];
  const auto numbers = in.Take<double>(2);
  d.sigma_px = numbers[0], d.gravity = numbers[1];
  d.start = TakeState(in, d.n, d.k, d.width);
  d.R_ref = Map<const RowMatrix3>(in.Take<double>(9).data());
  for (int64_t c = 0; c < d.cameras; ++c) {
    const auto f = in.Take<double>(16);
    const Matrix3 R_BC = Map<const RowMatrix3>(f.data() + 4);
    const Vector3 p_BC = Map<const Vector3>(f.data() + 13);
    d.camera.push_back({f[0], f[1], f[2], f[3], R_BC.transpose(), -R_BC.transpose() * p_BC});
  }
  d.obs_keyframe = in.Take<int64_t>(d.m);
  d.obs_camera = in.Take<int64_t>(d.m);
  d.obs_landmark = in.Take<int64_t>(d.m);
  d.uv = in.Take<double>(2 * d.m);
  d.first = in.Take<int64_t>(d.factors);
  d.second = in.Take<int64_t>(d.factors);
  d.dt = in.Take<double>(d.factors);
  d.dp = in.Take<double>(3 * d.factors);
  d.dR = in.Take<double>(9 * d.factors);
  d.dv = in.Take<double>(3 * d.factors);
  d.whitener = in.Take<double>(d.width * d.width * d.factors);
  if (d.width == 15) {
    d.by_gyro_bias = in.Take<double>(27 * d.factors);
    d.by_accel_bias = in.Take<double>(27 * d.factors);
    d.gyro_bias = in.Take<double>(3 * d.factors);
    d.accel_bias = in.Take<double>(3 * d.factors);
  }
  in.End();
  return d;
}

// Rotation of a pose block, and the chain from left increments to the block's own parameters.
template <int kPose>
Matrix3 Rotation(const double* pose, const Matrix3& R_ref) {
  if constexpr (kPose == 6) {
    return ExpQuaternion(Map<const Vector3>(pose + 3)).toRotationMatrix() * R_ref;
  } else {
    return Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]).toRotationMatrix();
  }
}

// Left increments in W, as Eq. (8). Jacobians of cost functions are given by tangent directions, so the
// derivative of Plus is the identity on top of a row of zeros.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* out) const override {
    Map<Vector3>{out} = Map<const Vector3>(x) + Map<const Vector3>(delta);
    const Eigen::Quaterniond q =
        (ExpQuaternion(Map<const Vector3>(delta + 3)) * Eigen::Quaterniond(x[3], x[4], x[5], x[6])).normalized();
    out[3] = q.w(), out[4] = q.x(), out[5] = q.y(), out[6] = q.z();
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* delta) const override {
    Map<Vector3>{delta} = Map<const Vector3>(y) - Map<const Vector3>(x);
    Map<Vector3>{delta + 3} = LogQuaternion(Eigen::Quaterniond(y[3], y[4], y[5], y[6]) *
                                            Eigen::Quaterniond(x[3], x[4], x[5], x[6]).conjugate());
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
};

template <int kPose>
class Reprojection final : public ceres::SizedCostFunction<2, kPose, 3> {
 public:
  Reprojection(const Camera& camera, const double* uv, double sigma_px, const Matrix3& R_ref)
      : camera_(camera), uv_(uv), weight_(1.0 / sigma_px), R_ref_(R_ref) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double* pose = parameters[0];
    const Vector3 ray = Map<const Vector3>(parameters[1]) - Map<const Vector3>(pose);
    const Matrix3 R_CW = camera_.R_CB * Rotation<kPose>(pose, R_ref_).transpose();
    const Vector3 point = R_CW * ray + camera_.p_CB;
    const double depth = 1.0 / point.z(), x = point.x() * depth, y = point.y() * depth;
    residuals[0] = (camera_.fx * x + camera_.cx - uv_[0]) * weight_;
    residuals[1] = (camera_.fy * y + camera_.cy - uv_[1]) * weight_;
    if (!jacobians) return true;
    const double fx = camera_.fx * depth * weight_, fy = camera_.fy * depth * weight_;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_landmark;
    by_landmark.row(0) = fx * (R_CW.row(0) - x * R_CW.row(2));
    by_landmark.row(1) = fy * (R_CW.row(1) - y * R_CW.row(2));
    if (jacobians[0]) {
      Map<Eigen::Matrix<double, 2, kPose, Eigen::RowMajor>> J(jacobians[0]);
      J.template leftCols<3>() = -by_landmark;
      J.template block<1, 3>(0, 3) = by_landmark.row(0).cross(ray.transpose());
      J.template block<1, 3>(1, 3) = by_landmark.row(1).cross(ray.transpose());
      if constexpr (kPose == 6) {
        J.template block<2, 3>(0, 3) =
            (J.template block<2, 3>(0, 3) * LeftJacobian(Map<const Vector3>(pose + 3))).eval();
      } else {
        J.col(6).setZero();
      }
    }
    if (jacobians[1]) Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>{jacobians[1]} = by_landmark;
    return true;
  }

 private:
  const Camera& camera_;
  const double* uv_;
  double weight_;
  const Matrix3& R_ref_;
};

template <int kPose>
class Inertial final : public ceres::SizedCostFunction<9, kPose, 3, 7, 3> {
 public:
  Inertial(const Data& d, int64_t row)
      : dt_(d.dt[row]),
        g_(0.0, 0.0, -d.gravity),
        dp_(&d.dp[3 * row]),
        dv_(&d.dv[3 * row]),
        dR_(Map<const RowMatrix3>(&d.dR[9 * row])),
        W_(Map<const Matrix9>(&d.whitener[81 * row])),
        R_ref_(d.R_ref) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Map<const Vector3> p_i(parameters[0]), v_i(parameters[1]), p_j(parameters[2]), v_j(parameters[3]);
    const Matrix3 R_iT = Rotation<kPose>(parameters[0], R_ref_).transpose();
    const Matrix3 R_j = Rotation<7>(parameters[2], R_ref_);
    const Vector3 shift = R_iT * (p_j - p_i - v_i * dt_ - 0.5 * g_ * dt_ * dt_);
    const Vector3 change = R_iT * (v_j - v_i - g_ * dt_);
    const Matrix3 error = dR_.transpose() * R_iT * R_j;
    const Vector3 turn = LogQuaternion(Eigen::Quaterniond(error));
    Vector9 r;
    r << shift - Map<const Vector3>(dp_), turn, change - Map<const Vector3>(dv_);
    Map<Vector9>{residuals} = W_ * r;
    if (!jacobians) return true;
    const Matrix3 by_turn = RightJacobianInverse(turn) * R_j.transpose();
    if (jacobians[0]) {
      Eigen::Matrix<double, 9, 6> J = Eigen::Matrix<double, 9, 6>::Zero();
      J.block<3, 3>(0, 0) = -R_iT;
      J.block<3, 3>(0, 3) = Hat(shift) * R_iT;
      J.block<3, 3>(3, 3) = -by_turn;
      J.block<3, 3>(6, 3) = Hat(change) * R_iT;
      if constexpr (kPose == 6) J.rightCols<3>() = (J.rightCols<3>() * LeftJacobian(Map<const Vector3>(parameters[0] + 3))).eval();
      Map<Eigen::Matrix<double, 9, kPose, Eigen::RowMajor>> out(jacobians[0]);
      out.setZero();
      out.template leftCols<6>() = W_ * J;
    }
    if (jacobians[1]) {
      Map<Eigen::Matrix<double, 9, 3, Eigen::RowMajor>>{jacobians[1]} =
          -(W_.leftCols<3>() * dt_ + W_.rightCols<3>()) * R_iT;
    }
    if (jacobians[2]) {
      Map<Eigen::Matrix<double, 9, 7, Eigen::RowMajor>> out(jacobians[2]);
      out.setZero();
      out.leftCols<3>() = W_.leftCols<3>() * R_iT;
      out.block<9, 3>(0, 3) = W_.middleCols<3>(3) * by_turn;
    }
    if (jacobians[3]) {
      Map<Eigen::Matrix<double, 9, 3, Eigen::RowMajor>>{jacobians[3]} = W_.rightCols<3>() * R_iT;
    }
    return true;
  }

 private:
  double dt_;
  Vector3 g_;
  const double *dp_, *dv_;
  Matrix3 dR_;
  Matrix9 W_;
  const Matrix3& R_ref_;
};

// The same with biases: the increments follow those of the first keyframe to first order, and six more
// residuals are the steps of their random walk.
template <int kPose>
class BiasedInertial final : public ceres::SizedCostFunction<15, kPose, 9, 7, 9> {
 public:
  BiasedInertial(const Data& d, int64_t row)
      : dt_(d.dt[row]),
        g_(0.0, 0.0, -d.gravity),
        dp_(&d.dp[3 * row]),
        dv_(&d.dv[3 * row]),
        dR_(Map<const RowMatrix3>(&d.dR[9 * row])),
        W_(Map<const RowMatrix<15, 15>>(&d.whitener[225 * row])),
        R_ref_(d.R_ref) {
    by_bias_ << Map<const RowMatrix<9, 3>>(&d.by_gyro_bias[27 * row]), Map<const RowMatrix<9, 3>>(&d.by_accel_bias[27 * row]);
    bias_ << Map<const Vector3>(&d.gyro_bias[3 * row]), Map<const Vector3>(&d.accel_bias[3 * row]);
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    const Map<const Vector3> p_i(parameters[0]), v_i(parameters[1]), p_j(parameters[2]), v_j(parameters[3]);
    const Map<const Vector6> b_i(parameters[1] + 3), b_j(parameters[3] + 3);
    const Matrix3 R_iT = Rotation<kPose>(parameters[0], R_ref_).transpose();
    const Matrix3 R_j = Rotation<7>(parameters[2], R_ref_);
    const Vector9 moved = by_bias_ * (b_i - bias_);
    const Vector3 turned = moved.segment<3>(3);
    const Matrix3 dR = dR_ * ExpQuaternion(turned).toRotationMatrix();
    const Vector3 shift = R_iT * (p_j - p_i - v_i * dt_ - 0.5 * g_ * dt_ * dt_);
    const Vector3 change = R_iT * (v_j - v_i - g_ * dt_);
    const Matrix3 error = dR.transpose() * R_iT * R_j;
    const Vector3 turn = LogQuaternion(Eigen::Quaterniond(error));
    Vector15 r;
    r << shift - Map<const Vector3>(dp_) - moved.head<3>(), turn, change - Map<const Vector3>(dv_) - moved.tail<3>(), b_j - b_i;
    Map<Vector15>{residuals} = W_ * r;
    if (!jacobians) return true;
    const Matrix3 inverse = RightJacobianInverse(turn), by_turn = inverse * R_j.transpose();
    if (jacobians[0]) {
      Eigen::Matrix<double, 9, 6> J = Eigen::Matrix<double, 9, 6>::Zero();
      J.block<3, 3>(0, 0) = -R_iT;
      J.block<3, 3>(0, 3) = Hat(shift) * R_iT;
      J.block<3, 3>(3, 3) = -by_turn;
      J.block<3, 3>(6, 3) = Hat(change) * R_iT;
      if constexpr (kPose == 6) J.rightCols<3>() = (J.rightCols<3>() * LeftJacobian(Map<const Vector3>(parameters[0] + 3))).eval();
      Map<RowMatrix<15, kPose>> out(jacobians[0]);
      out.setZero();
      out.template leftCols<6>() = W_.leftCols<9>() * J;
    }
    if (jacobians[1]) {
      Eigen::Matrix<double, 15, 9> J = Eigen::Matrix<double, 15, 9>::Zero();
      J.block<3, 3>(0, 0) = -R_iT * dt_;
      J.block<3, 3>(6, 0) = -R_iT;
      J.block<9, 6>(0, 3) = -by_bias_;
      J.block<3, 6>(3, 3) = -inverse.transpose() * LeftJacobian(turned).transpose() * by_bias_.middleRows<3>(3);
      J.block<6, 6>(9, 3) = -Eigen::Matrix<double, 6, 6>::Identity();
      Map<RowMatrix<15, 9>>{jacobians[1]} = W_ * J;
    }
    if (jacobians[2]) {
      Map<RowMatrix<15, 7>> out(jacobians[2]);
      out.setZero();
      out.leftCols<3>() = W_.leftCols<3>() * R_iT;
      out.block<15, 3>(0, 3) = W_.middleCols<3>(3) * by_turn;
    }
    if (jacobians[3]) {
      Map<RowMatrix<15, 9>> out(jacobians[3]);
      out.leftCols<3>() = W_.middleCols<3>(6) * R_iT;
      out.rightCols<6>() = W_.rightCols<6>();
    }
    return true;
  }

 private:
  double dt_;
  Vector3 g_;
  const double *dp_, *dv_;
  Matrix3 dR_;
  Eigen::Matrix<double, 15, 15> W_;
  Eigen::Matrix<double, 9, 6> by_bias_;
  Eigen::Matrix<double, 6, 1> bias_;
  const Matrix3& R_ref_;
};

// Eq. (11): first position and the z part of dphi_0.
class GaugePrior final : public ceres::SizedCostFunction<4, 6> {
 public:
  explicit GaugePrior(const double* reference) : p_(reference) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double scale = std::sqrt(kPriorWeight);
    const int columns[4] = {0, 1, 2, 5};
    for (int i = 0; i < 4; ++i) residuals[i] = scale * (parameters[0][columns[i]] - (i < 3 ? p_[i] : 0.0));
    if (jacobians && jacobians[0]) {
      std::fill(jacobians[0], jacobians[0] + 24, 0.0);
      for (int i = 0; i < 4; ++i) jacobians[0][6 * i + columns[i]] = scale;
    }
    return true;
  }

 private:
  const double* p_;
};

// The parameters, and the Ceres problem of one gauge over them.
class Estimator {
 public:
  explicit Estimator(const Data& d) : d_(d), pose_(7 * d.n), speed_(d.Speed() * d.n), landmark_(3 * d.k) {}

  void Load(const State& s) {
    for (int64_t i = 0; i < d_.n; ++i) {
      std::copy_n(&s.p[3 * i], 3, &pose_[7 * i]);
      if (i == 0) {
        std::copy_n(s.dphi_0.data(), 3, &pose_[3]);
      } else {
        const Eigen::Quaterniond q(Matrix3(Map<const RowMatrix3>(&s.R[9 * i])));
        pose_[7 * i + 3] = q.w(), pose_[7 * i + 4] = q.x(), pose_[7 * i + 5] = q.y(), pose_[7 * i + 6] = q.z();
      }
    }
    for (int64_t i = 0; i < d_.n; ++i) {
      std::copy_n(&s.v[3 * i], 3, Speed(i));
      if (d_.width == 9) continue;
      std::copy_n(&s.gyro_bias[3 * i], 3, Speed(i) + 3);
      std::copy_n(&s.accel_bias[3 * i], 3, Speed(i) + 6);
    }
    landmark_ = s.X;
  }

  void SetLoss(const std::string& name, double delta) {
    if (name != "huber" && name != "cauchy") throw std::runtime_error("loss must be huber or cauchy, not " + name);
    loss_ = name, delta_ = delta;
  }

  void Save(const std::string& path) const {
    std::ofstream out(path, std::ios::binary);
    const auto put = [&out](const void* from, size_t bytes) { out.write(static_cast<const char*>(from), bytes); };
    put("VIGSTAT1", 8);
    put(&d_.n, 8);
    put(&d_.k, 8);
    for (int64_t i = 0; i < d_.n; ++i) put(&pose_[7 * i], 24);
    for (int64_t i = 0; i < d_.n; ++i) {
      const RowMatrix3 R = i ? Rotation<7>(&pose_[7 * i], d_.R_ref) : Rotation<6>(pose_.data(), d_.R_ref);
      put(R.data(), 72);
    }
    const int64_t stride = d_.Speed();
    for (int64_t i = 0; i < d_.n; ++i) put(&speed_[stride * i], 24);
    put(landmark_.data(), 8 * landmark_.size());
    put(&pose_[3], 24);
    for (int64_t at = 3; at < stride; at += 3) {
      for (int64_t i = 0; i < d_.n; ++i) put(&speed_[stride * i + at], 24);
    }
    if (!out.flush()) throw std::runtime_error(path + ": cannot be written");
  }

  std::unique_ptr<ceres::Problem> Build(const std::string& gauge) {
    auto problem = std::make_unique<ceres::Problem>();
    auto* manifold = new PoseManifold;
    for (int64_t i = 0; i < d_.n; ++i) {
      if (i == 0) {
        problem->AddParameterBlock(&pose_[0], 6);
      } else {
        problem->AddParameterBlock(&pose_[7 * i], 7, manifold);
      }
      problem->AddParameterBlock(Speed(i), static_cast<int>(d_.Speed()));
    }
    if (d_.n == 1) delete manifold;
    ceres::LossFunction* loss = nullptr;
    if (loss_ == "huber") loss = new ceres::HuberLoss(delta_);
    if (loss_ == "cauchy") loss = new ceres::CauchyLoss(delta_);
    for (int64_t r = 0; r < d_.m; ++r) {
      const int64_t i = d_.obs_keyframe[r];
      const Camera& camera = d_.camera[d_.obs_camera[r]];
      double* X = &landmark_[3 * d_.obs_landmark[r]];
      ceres::CostFunction* cost = nullptr;
      if (i == 0) {
        cost = new Reprojection<6>(camera, &d_.uv[2 * r], d_.sigma_px, d_.R_ref);
      } else {
        cost = new Reprojection<7>(camera, &d_.uv[2 * r], d_.sigma_px, d_.R_ref);
      }
      problem->AddResidualBlock(cost, loss, &pose_[7 * i], X);
    }
    for (int64_t r = 0; r < d_.factors; ++r) {
      const int64_t i = d_.first[r], j = d_.second[r];
      if (j == 0) throw std::runtime_error("inertial factors must not end at the first keyframe");
      ceres::CostFunction* cost = nullptr;
      if (d_.width == 15) {
        cost = i ? static_cast<ceres::CostFunction*>(new BiasedInertial<7>(d_, r)) : new BiasedInertial<6>(d_, r);
      } else {
        cost = i ? static_cast<ceres::CostFunction*>(new Inertial<7>(d_, r)) : new Inertial<6>(d_, r);
      }
      problem->AddResidualBlock(cost, nullptr, &pose_[7 * i], Speed(i), &pose_[7 * j], Speed(j));
    }
    if (gauge == "fix") {
      problem->SetManifold(&pose_[0], new ceres::SubsetManifold(6, {0, 1, 2, 5}));
    } else if (gauge == "prior") {
      problem->AddResidualBlock(new GaugePrior(d_.start.p.data()), nullptr, &pose_[0]);
    } else if (gauge != "free") {
      throw std::runtime_error("gauge must be fix, prior or free, not " + gauge);
    }
    return problem;
  }

  ceres::ParameterBlockOrdering* Ordering() {
    auto* ordering = new ceres::ParameterBlockOrdering;
    for (int64_t j = 0; j < d_.k; ++j) ordering->AddElementToGroup(&landmark_[3 * j], 0);
    for (int64_t i = 0; i < d_.n; ++i) {
      ordering->AddElementToGroup(&pose_[7 * i], 1);
      ordering->AddElementToGroup(Speed(i), 1);
    }
    return ordering;
  }

  // (9N, 9N), all positions, all rotations, all velocities, and all biases (15N, 15N) where those are estimated;
  // held parameters have zero rows.
  std::vector<double> Motion(const ceres::Covariance& covariance, const ceres::Problem& problem) {
    const int64_t first = problem.ParameterBlockTangentSize(&pose_[0]);
    const int64_t n = d_.n, order = first + 6 * (n - 1) + d_.Speed() * n, rows = d_.width * n;
    std::vector<double> theirs(order * order);
    if (!covariance.GetCovarianceMatrixInTangentSpace(MotionBlocks(), theirs.data())) {
      throw std::runtime_error("the covariance is not to be had");
    }
    std::vector<int64_t> place;  // of their rows among ours
    for (int64_t i = 0; i < n; ++i) {
      const bool held = i == 0 && first == 2;
      for (int axis = 0; axis < 3 && !held; ++axis) place.push_back(3 * i + axis);
      for (int axis = 0; axis < (held ? 2 : 3); ++axis) place.push_back(3 * n + 3 * i + axis);
      for (int64_t kind = 2; kind < d_.width / 3; ++kind) {
        for (int axis = 0; axis < 3; ++axis) place.push_back(3 * n * kind + 3 * i + axis);
      }
    }
    std::vector<double> out(rows * rows, 0.0);
    for (int64_t a = 0; a < order; ++a) {
      for (int64_t b = 0; b < order; ++b) out[rows * place[a] + place[b]] = theirs[order * a + b];
    }
    return out;
  }

  std::vector<const double*> MotionBlocks() const {
    std::vector<const double*> blocks;
    for (int64_t i = 0; i < d_.n; ++i) blocks.push_back(&pose_[7 * i]), blocks.push_back(&speed_[d_.Speed() * i]);
    return blocks;
  }

 private:
  const Data& d_;
  double* Speed(int64_t i) { return &speed_[d_.Speed() * i]; }
  std::vector<double> pose_, speed_, landmark_;
  std::string loss_;
  double delta_ = 0.0;
};

double Seconds() {
  using Clock = std::chrono::steady_clock;
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

double PeakMib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

std::string Solve(Estimator& estimator, const Data& d, const std::string& gauge, const std::string& type, int threads,
                  double tolerance, int limit) {
  estimator.Load(d.start);
  auto problem = estimator.Build(gauge);
  ceres::Solver::Options options;  // trust region, damping, Jacobi scaling: Ceres' defaults
  if (type == "dense_schur") {
    options.linear_solver_type = ceres::DENSE_SCHUR;
  } else if (type == "sparse_schur") {
    options.linear_solver_type = ceres::SPARSE_SCHUR;
  } else {
    throw std::runtime_error("type must be dense_schur or sparse_schur, not " + type);
  }
  options.linear_solver_ordering.reset(estimator.Ordering());
  options.num_threads = threads;
  options.function_tolerance = tolerance;
  options.max_num_iterations = limit;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  const double begin = Seconds();
  ceres::Solve(options, problem.get(), &summary);
  const double seconds = Seconds() - begin;
  std::ostringstream out;
  out << std::setprecision(17) << "{\"seconds\": " << seconds << ", \"iterations\": " << summary.num_linear_solves
      << ", \"cost\": " << summary.final_cost << ", \"converged\": "
      << (summary.termination_type == ceres::CONVERGENCE ? "true" : "false") << ", \"preprocess\": "
      << summary.preprocessor_time_in_seconds << ", \"linear_solver\": " << summary.linear_solver_time_in_seconds
      << ", \"jacobian\": " << summary.jacobian_evaluation_time_in_seconds << ", \"residual\": "
      << summary.residual_evaluation_time_in_seconds << ", \"peak_mib\": " << PeakMib() << "}";
  return out.str();
}

std::string TakeCovariance(Estimator& estimator, const std::string& gauge, const std::string& type, int threads,
                           std::vector<double>* matrix) {
  auto problem = estimator.Build(gauge);
  ceres::Covariance::Options options;
  options.num_threads = threads;
  if (type == "dense_svd") {
    options.algorithm_type = ceres::DENSE_SVD;
    options.null_space_rank = gauge == "free" ? 4 : 0;
  } else if (type == "sparse_qr") {
    options.algorithm_type = ceres::SPARSE_QR;
  } else {
    throw std::runtime_error("type must be sparse_qr or dense_svd, not " + type);
  }
  const double begin = Seconds();
  ceres::Covariance covariance(options);
  if (!covariance.Compute(estimator.MotionBlocks(), problem.get())) {
    throw std::runtime_error("Ceres cannot compute the covariance");
  }
  *matrix = estimator.Motion(covariance, *problem);
  std::ostringstream out;
  out << std::setprecision(17) << "{\"seconds\": " << Seconds() - begin << ", \"peak_mib\": " << PeakMib() << "}";
  return out.str();
}

}  // namespace

int main(int count, char** arguments) try {
  if (count != 5) throw std::runtime_error("usage: ceres_solver PROBLEM.bin THREADS FUNCTION_TOLERANCE ITERATIONS");
  const Data data = ReadProblem(arguments[1]);
  const int threads = std::stoi(arguments[2]);
  const double tolerance = std::stod(arguments[3]);
  const int limit = std::stoi(arguments[4]);
  Estimator estimator(data);
  estimator.Load(data.start);
  std::vector<double> covariance;
  std::cout << "{\"ready\": true}" << std::endl;
  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream words(line);
    std::string verb, first, second;
    words >> verb >> first >> second;
    std::string answer = "{}";
    if (verb == "solve") {
      answer = Solve(estimator, data, first, second, threads, tolerance, limit);
    } else if (verb == "loss") {
      estimator.SetLoss(first, std::stod(second));
    } else if (verb == "state") {
      estimator.Save(first);
    } else if (verb == "at") {
      Reader in(first);
      in.Magic("VIGSTAT1");
      const auto sizes = in.Take<int64_t>(2);
      if (sizes[0] != data.n || sizes[1] != data.k) throw std::runtime_error(first + ": is of another problem");
      const State state = TakeState(in, data.n, data.k, data.width);
      in.End();
      estimator.Load(state);
    } else if (verb == "covariance") {
      answer = TakeCovariance(estimator, first, second, threads, &covariance);
    } else if (verb == "prepare") {
      // Said by the protocol for solvers that keep their graph from run to run.
    } else if (verb == "matrix") {
      std::ofstream out(first, std::ios::binary);
      out.write(reinterpret_cast<const char*>(covariance.data()), static_cast<std::streamsize>(8 * covariance.size()));
      if (!out.flush()) throw std::runtime_error(first + ": cannot be written");
    } else {
      throw std::runtime_error("unknown request " + verb);
    }
    std::cout << answer << std::endl;
  }
  return 0;
} catch (const std::exception& error) {
  std::cerr << "ceres_solver: " << error.what() << std::endl;
  return 1;
}
