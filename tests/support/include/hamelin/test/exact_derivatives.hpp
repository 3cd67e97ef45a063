#pragma once
#include <Eigen/Core>
#include <complex>
#include <vector>

#include "hamelin/model/model.hpp"
#include "hamelin/test/dual.hpp"

namespace hamelin::test {

/// Inverse dynamics and energies for numbers that carry derivatives: complex numbers, whose
/// imaginary part at a step of 1e-30 is the exact derivative, or dual numbers. Newton–Euler in the
/// COM frames with products of exponentials, after K. M. Lynch, F. C. Park, Modern Robotics, 2017,
/// section 8.3.2: neither the frames nor the sweeps of the library.
template <class Number>
class ReferenceDynamics {
 public:
  using C = Number;
  using VectorXc = Eigen::Matrix<C, Eigen::Dynamic, 1>;
  using Matrix6c = Eigen::Matrix<C, 6, 6>;
  using Vector6c = Eigen::Matrix<C, 6, 1>;
  using Matrix3c = Eigen::Matrix<C, 3, 3>;
  using Vector3c = Eigen::Matrix<C, 3, 1>;

  explicit ReferenceDynamics(const model::Model& model) : model_(model) {}

  [[nodiscard]] VectorXc inverse_dynamics(const VectorXc& q, const VectorXc& v,
                                          const VectorXc& a) const {
    const auto& links = model_.robot().links;
    const std::size_t n = links.size();
    std::vector<Matrix6c> Ad(n);
    std::vector<Vector6c> A(n), V(n), dV(n);
    Vector6c twist = Vector6c::Constant(C(0.0)), rate = Vector6c::Constant(C(0.0));
    rate.template tail<3>() = -(model_.base().R().transpose() * model_.gravity()).cast<C>();
    geometry::SE3 before;
    for (std::size_t i = 0; i < n; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      A[i] = (links[i].com.inverse().Ad() * links[i].joint.screw).cast<C>();
      const geometry::SE3 at_zero = links[i].com.inverse() * before;
      Ad[i] = adjoint_of_exp(A[i], -q[k], turns(links[i])) * at_zero.Ad().cast<C>();
      twist = V[i] = Ad[i] * twist + A[i] * v[k];
      rate = dV[i] = Ad[i] * rate + ad(V[i]) * A[i] * v[k] + A[i] * a[k];
      before = links[i].com;
    }
    VectorXc tau(q.size());
    Vector6c wrench = Vector6c::Constant(C(0.0));
    for (std::size_t i = n; i-- > 0;) {
      const auto k = static_cast<Eigen::Index>(i);
      Matrix6c G = Matrix6c::Constant(C(0.0));
      G.template topLeftCorner<3, 3>() = links[i].inertia_kg_m2.cast<C>();
      G.template bottomRightCorner<3, 3>() =
          (links[i].mass_kg * Eigen::Matrix3d::Identity()).cast<C>();
      if (i + 1 < n) wrench = (Ad[i + 1].transpose() * wrench).eval();
      wrench += G * dV[i] - ad(V[i]).transpose() * (G * V[i]);
      tau[k] = wrench.cwiseProduct(A[i]).sum() + links[i].joint.armature * a[k];
    }
    return tau;
  }

  /// ½ vᵀM(q)v
  [[nodiscard]] C kinetic_energy(const VectorXc& q, const VectorXc& v) const {
    const VectorXc rest = VectorXc::Constant(v.size(), C(0.0));
    return (inverse_dynamics(q, rest, v) - inverse_dynamics(q, rest, rest)).cwiseProduct(v).sum() *
           C(0.5);
  }
  /// −Σ m_i g·c_i with the COM positions c_i
  [[nodiscard]] C potential_energy(const VectorXc& q) const {
    C sum(0.0);
    place(q, [&](std::size_t i, const Matrix3c&, const Vector3c& p) {
      const double mass = model_.robot().links[i].mass_kg;
      sum -= (mass * model_.gravity()).cast<C>().cwiseProduct(p).sum();
    });
    return sum;
  }
  /// World position of a point fixed in link `link`'s COM frame.
  [[nodiscard]] Vector3c point(const VectorXc& q, int link,
                               const Eigen::Vector3d& point_link) const {
    Vector3c at;
    place(q, [&](std::size_t i, const Matrix3c& R, const Vector3c& p) {
      if (static_cast<int>(i) == link) at = R * point_link.cast<C>() + p;
    });
    return at;
  }
  /// How a frame on a link moves: the twist [ω; v] of the link at the world's origin, and the
  /// adjoint of the frame's world pose.
  struct Motion {
    Vector6c spatial;
    Matrix6c Ad;
  };
  /// By products of exponentials. @param pose of the frame in the base frame at q = 0
  [[nodiscard]] Motion motion(const VectorXc& q, const VectorXc& v, int link,
                              const geometry::SE3& pose) const {
    Motion out{Vector6c::Constant(C(0.0)), model_.base().Ad().cast<C>()};
    for (int i = 0; i <= link; ++i) {
      const auto& moved = model_.robot().links[static_cast<std::size_t>(i)];
      const Vector6c screw = moved.joint.screw.template cast<C>();
      out.spatial += out.Ad * screw * v[i];
      out.Ad = (out.Ad * adjoint_of_exp(screw, q[i], turns(moved))).eval();
    }
    out.Ad = (out.Ad * pose.Ad().cast<C>()).eval();
    return out;
  }

 private:
  /// Calls f(i, R, p) with the world pose of each link's COM frame.
  template <class F>
  void place(const VectorXc& q, F&& f) const {
    const auto& links = model_.robot().links;
    Matrix3c R = model_.base().R().cast<C>();
    Vector3c p = model_.base().p().cast<C>();
    for (std::size_t i = 0; i < links.size(); ++i) {
      Matrix3c turn;
      Vector3c shift;
      exp(links[i].joint.screw.template cast<C>(), q[static_cast<Eigen::Index>(i)], turns(links[i]),
          turn, shift);
      p = (R * shift + p).eval();
      R = (R * turn).eval();
      f(i, Matrix3c(R * links[i].com.R().cast<C>()), Vector3c(R * links[i].com.p().cast<C>() + p));
    }
  }

  static bool turns(const model::Link& link) {
    return link.joint.type != model::JointType::prismatic;
  }
  static Matrix3c hat(const Vector3c& w) {
    Matrix3c m;
    m << C(0.0), -w[2], w[1], w[2], C(0.0), -w[0], -w[1], w[0], C(0.0);
    return m;
  }
  static Matrix6c ad(const Vector6c& m) {
    Matrix6c out = Matrix6c::Constant(C(0.0));
    out.template topLeftCorner<3, 3>() = out.template bottomRightCorner<3, 3>() =
        hat(m.template head<3>());
    out.template bottomLeftCorner<3, 3>() = hat(m.template tail<3>());
    return out;
  }
  /// exp(A s) = (R, p) for a screw without pitch, of a revolute or a prismatic joint.
  static void exp(const Vector6c& A, const C& s, bool turns, Matrix3c& R, Vector3c& p) {
    using std::cos, std::sin;
    const Vector3c w = A.template head<3>(), u = A.template tail<3>();
    const Matrix3c W = hat(w), one = Eigen::Matrix3d::Identity().cast<C>();
    if (turns) {
      R = one + W * sin(s) + (W * W).eval() * (C(1.0) - cos(s));
      p = (one - R) * (W * u);
    } else {
      R = one;
      p = u * s;
    }
  }
  static Matrix6c adjoint_of_exp(const Vector6c& A, const C& s, bool turns) {
    Matrix3c R;
    Vector3c p;
    exp(A, s, turns, R, p);
    Matrix6c out = Matrix6c::Constant(C(0.0));
    out.template topLeftCorner<3, 3>() = out.template bottomRightCorner<3, 3>() = R;
    out.template bottomLeftCorner<3, 3>() = hat(p) * R;
    return out;
  }

  const model::Model& model_;
};

/// Derivatives of inverse dynamics by complex steps, side by side: by q, v and a.
inline Eigen::MatrixXd complex_steps(const model::Model& model, const Eigen::VectorXd& q,
                                     const Eigen::VectorXd& v, const Eigen::VectorXd& a) {
  using Complex = ReferenceDynamics<std::complex<double>>;
  constexpr double step = 1e-30;
  const Complex reference(model);
  const Eigen::Index n = q.size();
  Eigen::MatrixXd out(n, 3 * n);
  Complex::VectorXc x[] = {q.cast<Complex::C>(), v.cast<Complex::C>(), a.cast<Complex::C>()};
  for (Eigen::Index k = 0; k < 3 * n; ++k) {
    auto& entry = x[k / n][k % n];
    entry += Complex::C(0.0, step);
    out.col(k) = reference.inverse_dynamics(x[0], x[1], x[2]).imag() / step;
    entry -= Complex::C(0.0, step);
  }
  return out;
}

}  // namespace hamelin::test
