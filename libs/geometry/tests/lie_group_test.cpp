#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <type_traits>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/geometry/se2.hpp"
#include "hamelin/geometry/se3.hpp"
#include "hamelin/geometry/so2.hpp"
#include "hamelin/geometry/so3.hpp"

using namespace hamelin::geometry;
using hamelin::Rng;
using std::numbers::pi;

namespace {

// Otherwise angles() needs both thresholds.
static_assert(inverse_exp_series_threshold == exp_series_threshold);

template <class G>
constexpr int angular_dof = std::is_same_v<G, SO3> || std::is_same_v<G, SE3> ? 3 : 1;

/// A random twist whose rotation is `angle` [rad].
template <class G>
typename G::Tangent twist(Rng& rng, double angle) {
  typename G::Tangent x;
  for (int i = 0; i < G::dof; ++i) x[i] = rng.normal();
  const double norm = x.template head<angular_dof<G>>().norm();
  x.template head<angular_dof<G>>() *= angle / norm;
  return x;
}

template <class G>
typename G::Point point(Rng& rng) {
  typename G::Point p;
  for (int i = 0; i < p.size(); ++i) p[i] = rng.normal();
  return p;
}

/// Angles at which every law is tested [rad].
std::vector<double> angles() {
  std::vector<double> list{0.0, 1e-8, 1e-4, 0.1};
  for (const double threshold : {2.0 * SO3::log_threshold, exp_series_threshold}) {
    list.insert(list.end(), {threshold * (1.0 - 1e-12), threshold, threshold * (1.0 + 1e-12)});
  }
  list.insert(list.end(), {2.0, 3.0, pi - 1e-6});
  return list;
}

/// exp of a matrix by power series, scaling and squaring, without any formula of the groups.
template <class Matrix>
Matrix power_series_exp(const Matrix& m) {
  const Matrix small = m / 16.0;
  Matrix sum = Matrix::Identity(), term = Matrix::Identity();
  for (int k = 1; k < 20; ++k) {
    term = (term * small / k).eval();
    sum += term;
  }
  for (int k = 0; k < 4; ++k) sum = (sum * sum).eval();
  return sum;
}

template <class Matrix>
double gap(const Matrix& a, const Matrix& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1.0, b.cwiseAbs().maxCoeff());
}

constexpr double rounding = 2e-14;

}  // namespace

TEMPLATE_TEST_CASE("a displacement obeys the laws of a Lie group", "[geometry][property]", SO2, SO3,
                   SE2, SE3) {
  using G = TestType;
  using Tangent = typename G::Tangent;
  using Adjoint = typename G::Adjoint;
  const auto seed = GENERATE(range(0u, 20u));
  const double angle = GENERATE(from_range(angles()));
  CAPTURE(seed, angle);
  Rng rng(seed);
  const Tangent x = twist<G>(rng, angle), y = twist<G>(rng, rng.uniform(0.0, pi)),
                z = twist<G>(rng, 1.0);
  const G a = G::exp(x), b = G::exp(y), c = G::exp(z);
  const auto p = point<G>(rng);
  const Adjoint one = Adjoint::Identity();

  SECTION("products are associative, with identity and inverse, and act on points") {
    CHECK(gap(((a * b) * c).matrix(), (a * (b * c)).matrix()) < rounding);
    CHECK(gap((a * a.inverse()).matrix(), G{}.matrix()) < rounding);
    CHECK((a * G{}) == a);
    CHECK((a.inverse() == a) == (angle == 0.0 && x.tail(G::dof - angular_dof<G>).norm() == 0.0));
    CHECK(gap(((a * b) * p).eval(), (a * b.act(p)).eval()) < rounding);
  }
  SECTION("the matrix of a product is the product of the matrices") {
    CHECK(gap((a * b).matrix(), typename G::Matrix(a.matrix() * b.matrix())) < rounding);
  }
  SECTION("exp is the matrix exponential") {
    CHECK(gap(typename G::Matrix(a.matrix()), power_series_exp(G::hat(x))) < rounding);
  }
  SECTION("log inverts exp, to relative precision at small angles") {
    const Tangent back = a.log();
    // Near π the rotation vector's direction is accurate, and its angle is right to rounding.
    CHECK(gap(back, x) < rounding);
    CHECK((back - x).template head<angular_dof<G>>().norm() <= 1e-14 * std::max(angle, 1e-300));
  }
  SECTION("exp inverts log") {
    const G product = a * b;
    CHECK(gap(G::exp(product.log()).matrix(), product.matrix()) < rounding);
  }
  SECTION("Ad is a homomorphism") {
    CHECK(gap((a * b).Ad(), Adjoint(a.Ad() * b.Ad())) < rounding);
    CHECK(gap(Adjoint(a.Ad() * a.inverse().Ad()), one) < rounding);
  }
  SECTION("Ad is conjugation") {
    const Tangent by_matrices = G::vee(a.matrix() * G::hat(y) * a.inverse().matrix());
    CHECK(gap(a.Ad(y), by_matrices) < rounding);
    CHECK(gap(Tangent(a.Ad() * y), by_matrices) < rounding);
  }
  SECTION("ad is the commutator") {
    const Tangent by_matrices = G::vee(G::hat(x) * G::hat(y) - G::hat(y) * G::hat(x));
    CHECK(gap(G::ad(x, y), by_matrices) < rounding);
    CHECK(gap(Tangent(G::ad(x) * y), by_matrices) < rounding);
  }
  SECTION("the bracket satisfies the Jacobi identity") {
    const Tangent sum = G::ad(x, G::ad(y, z)) + G::ad(y, G::ad(z, x)) + G::ad(z, G::ad(x, y));
    CHECK(sum.norm() < 1e-12);
  }
  SECTION("the dual maps give the same power") {
    CHECK(a.Ad_T(y).dot(z) == Approx(y.dot(a.Ad(z))).margin(1e-13));
    CHECK(G::ad_T(x, y).dot(z) == Approx(y.dot(G::ad(x, z))).margin(1e-13));
  }
  SECTION("hat and vee invert each other") {
    CHECK(G::vee(G::hat(x)) == x);
  }
  SECTION("dexp is the right-trivialised derivative of exp") {
    constexpr double step = 1e-5;
    const G forth = G::exp(x + step * y), back = G::exp(x - step * y);
    const Tangent difference = (forth * back.inverse()).log() / (2.0 * step);
    CHECK(gap(Tangent(G::dexp(x) * y), difference) < 1e-8);
  }
  SECTION("dexp is its power series") {
    Adjoint sum = one, term = one;
    for (int k = 1; k < 60; ++k) {
      term = (term * G::ad(x) / (k + 1.0)).eval();
      sum += term;
    }
    CHECK(gap(G::dexp(x), sum) < rounding);
  }
  SECTION("dexp_inv inverts dexp") {
    CHECK(gap(Adjoint(G::dexp(x) * G::dexp_inv(x)), one) < 1e-13);
    CHECK(gap(Adjoint(G::dexp_inv(x) * G::dexp(x)), one) < 1e-13);
  }
  SECTION("Ad of exp is dexp(x) dexp(-x)⁻¹") {
    CHECK(gap(a.Ad(), Adjoint(G::dexp(x) * G::dexp_inv(-x))) < 1e-13);
  }
}

TEMPLATE_TEST_CASE("log is right at rotations by π exactly", "[geometry][unit]", SO3, SE3) {
  using G = TestType;
  const auto seed = GENERATE(range(0u, 50u));
  CAPTURE(seed);
  Rng rng(seed);
  Eigen::Vector3d axis(rng.normal(), rng.normal(), rng.normal());
  if (seed < 3) axis = Eigen::Vector3d::Unit(static_cast<int>(seed));
  axis.normalize();
  // A half turn without trigonometry: 2aaᵀ − 1.
  const Eigen::Matrix3d R = 2.0 * axis * axis.transpose() - Eigen::Matrix3d::Identity();
  G g;
  if constexpr (std::is_same_v<G, SO3>) {
    g = SO3(R);
  } else {
    g = SE3(R, Eigen::Vector3d(0.3, -2.0, 0.7));
  }
  const typename G::Tangent x = g.log();
  CHECK(x.template head<3>().norm() == Approx(pi).epsilon(1e-15));
  CHECK(x.template head<3>().cross(axis).norm() < 1e-14);
  const Eigen::Vector3d omega = x.template head<3>();
  CHECK(omega.maxCoeff() >= -omega.minCoeff());
  CHECK(gap(G::exp(x).matrix(), g.matrix()) < rounding);
}

TEST_CASE("planar groups are the space groups about z", "[geometry][property]") {
  const auto seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  const Eigen::Vector3d x = twist<SE2>(rng, rng.uniform(0.0, 3.0)), y = twist<SE2>(rng, 1.0);
  const auto lift = [](const Eigen::Vector3d& t) {
    return (Vector6d() << 0.0, 0.0, t[0], t[1], t[2], 0.0).finished();
  };
  const auto drop = [](const Vector6d& t) { return Eigen::Vector3d(t.segment<3>(2)); };
  CHECK(gap(SE2::exp(x).log(), drop(SE3::exp(lift(x)).log())) < rounding);
  CHECK(gap(SE2::ad(x, y), drop(SE3::ad(lift(x), lift(y)))) < rounding);
  CHECK(gap(SE2::exp(x).Ad(y), drop(SE3::exp(lift(x)).Ad(lift(y)))) < rounding);
  CHECK(gap(Eigen::Vector3d(SE2::dexp(x) * y), drop(SE3::dexp(lift(x)) * lift(y))) < rounding);
  CHECK(gap(Eigen::Vector3d(SE2::dexp_inv(x) * y), drop(SE3::dexp_inv(lift(x)) * lift(y))) <
        rounding);
  CHECK(gap(SO2::exp(SO2::Tangent(x[0])).R(),
            Eigen::Matrix2d(SE3::exp(lift(x)).R().topLeftCorner<2, 2>())) < rounding);
}

TEST_CASE("the coefficients keep full precision on both sides of their thresholds",
          "[geometry][unit]") {
  // The closed forms in long double are the reference; the digits that they lose by cancellation
  // lie beyond those of a double.
  for (const double theta : {0.3, 0.49999, 0.50001, 0.7, 0.99999, 1.0, 1.00001, 1.5, 3.0}) {
    CAPTURE(theta);
    using Real = long double;
    const Real t = static_cast<Real>(theta * theta), angle = std::sqrt(t);
    const Real sinc = std::sin(angle) / angle, a = (1 - std::cos(angle)) / t, b = (1 - sinc) / t;
    const ExpCoefficients c = exp_coefficients(theta * theta);
    CHECK(c.sinc == Approx(static_cast<double>(sinc)).epsilon(1e-15));
    CHECK(c.a == Approx(static_cast<double>(a)).epsilon(1e-15));
    CHECK(c.b == Approx(static_cast<double>(b)).epsilon(1e-15));
    CHECK(c.da == Approx(static_cast<double>((sinc - 2 * a) / t)).epsilon(1e-14));
    CHECK(c.db == Approx(static_cast<double>((a - 3 * b) / t)).epsilon(1e-14));
    const Real gamma = angle / 2 / std::tan(angle / 2), e = (1 - gamma) / t;
    const InverseExpCoefficients i = inverse_exp_coefficients(theta * theta);
    CHECK(i.gamma == Approx(static_cast<double>(gamma)).epsilon(1e-15));
    CHECK(i.e == Approx(static_cast<double>(e)).epsilon(1e-14));
    CHECK(i.de == Approx(static_cast<double>((Real(0.25) - (gamma + 2) * e) / t)).epsilon(1e-13));
  }
}

TEST_CASE("the rotation between two directions is the least one, opposite ones included",
          "[geometry][unit]") {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  for (const double angle : {0.0, 1e-9, 0.3, 1.5, 3.0, std::numbers::pi - 1e-5, std::numbers::pi}) {
    CAPTURE(angle);
    const Eigen::Vector3d to(2.0 * std::sin(angle), 0.0, 2.0 * std::cos(angle));
    const Eigen::Matrix3d R = rotation_between(3.0 * z, to);
    CHECK((R * z - to.normalized()).norm() < 1e-9);
    CHECK((R * R.transpose()).isIdentity(1e-9));
    CHECK(R.determinant() > 0.0);
    CHECK(SO3(R).log().norm() == Approx(angle).margin(1e-9));
  }
}

TEST_CASE("quaternions and rotation matrices agree, and a quaternion must be unit",
          "[geometry][unit]") {
  const Eigen::Vector4d q = Eigen::Vector4d(0.5, -0.5, 0.5, 0.5);
  CHECK(quaternion_wxyz(rotation_from_wxyz(q)) == q);
  CHECK(quaternion_wxyz(rotation_from_wxyz(-q)) == q);
  CHECK(rotation_from_wxyz({1.0, 0.0, 0.0, 0.0}) == Eigen::Matrix3d::Identity());
  CHECK(gap(rotation_from_wxyz((1.0 + 5e-7) * q), rotation_from_wxyz(q)) < rounding);
  CHECK_THROWS_AS(rotation_from_wxyz((1.0 + 2e-6) * q), hamelin::Error);
  CHECK_THROWS_AS(rotation_from_wxyz(Eigen::Vector4d::Zero()), hamelin::Error);
  CHECK_THROWS_AS(rotation_from_wxyz(Eigen::Vector4d::Constant(std::nan(""))), hamelin::Error);
}
