#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <numbers>
#include <optional>
#include <type_traits>

#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Catch::Contains;
using Eigen::MatrixXd;
using Eigen::Vector3d;

// Arguments that must not compile.
namespace must_not_compile {

template <class Made, class... Given>
constexpr bool refused = !std::is_constructible_v<Made, Given...>;

static_assert(refused<Workspace, Model> && refused<Workspace, const Model> &&
              !refused<Workspace, const Model&>);
static_assert(refused<BatchWorkspace, Model> && !refused<BatchWorkspace, Model&>);
static_assert(!refused<InverseKinematics, const Model&, const JointBox&> &&
              refused<InverseKinematics, Model, const JointBox&> &&
              refused<InverseKinematics, const Model&, JointBox> &&
              refused<InverseKinematics, Model, JointBox>);
// A strided view would be copied silently.
static_assert(
    refused<ConstVectorRef, decltype(std::declval<const MatrixXd&>().row(0).transpose())>);
static_assert(refused<ConstVectorRef, Eigen::Map<const VectorXd, 0, Eigen::InnerStride<>>>);
static_assert(refused<ConstVectorRef, decltype(std::declval<const StatesXd&>().col(0))>);
static_assert(refused<ConstVectorRef, MatrixXd> && refused<ConstVectorRef, Eigen::VectorXf>);
static_assert(refused<ConstStatesRef, MatrixXd>);
static_assert(refused<VectorRef, decltype(std::declval<MatrixXd&>().row(0).transpose())>);
static_assert(refused<VectorRef, const VectorXd&>);
// Arguments that must compile.
static_assert(!refused<ConstVectorRef, const VectorXd&> &&
              !refused<ConstVectorRef, Eigen::Matrix<double, 7, 1>>);
static_assert(!refused<ConstVectorRef, decltype(std::declval<const VectorXd&>().segment(1, 3))>);
static_assert(!refused<ConstVectorRef, decltype(std::declval<const MatrixXd&>().col(0))>);
static_assert(!refused<ConstVectorRef, Eigen::Map<const VectorXd>> &&
              !refused<ConstVectorRef, const VectorRef&>);
static_assert(!refused<ConstVectorRef, decltype(2.0 * std::declval<const VectorXd&>())>);

}  // namespace must_not_compile

namespace {

constexpr int n = 6;

// All calls that take joint vectors; the tests change the size of one vector at a time.
struct Calls {
  Model model{test::random_robot(3, n, 4)};
  Workspace ws{model};
  VectorXd q = VectorXd::Constant(n, 0.3), v = VectorXd::Constant(n, -0.2), a = VectorXd::Ones(n),
           out{n};
  Matrix3Xd J{3, n};
  Matrix6Xd F{6, n};
  const std::vector<GyroscopicTerm> terms{{n - 1, Vector3d::Zero(), Vector3d::UnitX()}};

  // f(name of the function, call)
  template <class F_>
  void each(F_&& f) {
    f("inverse_dynamics", [&] { inverse_dynamics(model, ws, q, v, a, out); });
    f("forward_dynamics", [&] { forward_dynamics(model, ws, q, v, a, out); });
    f("bias_torque", [&] { bias_torque(model, ws, q, v, out); });
    f("gravity_torque", [&] { gravity_torque(model, ws, q, out); });
    f("solve_mass", [&] { solve_mass(model, ws, q, a, out); });
    f("momentum", [&] { momentum(model, ws, q, v, out); });
    f("kinetic_energy", [&] { (void)kinetic_energy(model, ws, q, v); });
    f("potential_energy", [&] { (void)potential_energy(model, ws, q); });
    f("forward_kinematics", [&] { forward_kinematics(model, ws, q); });
    f("gyroscopic_torque", [&] { gyroscopic_torque(model, ws, q, v, terms, out); });
    f("operational_inertia", [&] { (void)operational_inertia(model, ws, q, J); });
    f("mass_matrix", [&] {
      MatrixXd M(n, n);
      mass_matrix(model, ws, q, M);
    });
  }
  // Calls that read the poses of forward_kinematics.
  template <class F_>
  void each_of_poses(int link, F_&& f) {
    std::vector<Vector3d> centers(model.shapes().size());
    f("point_position", [&] { (void)point_position(model, ws, link, Vector3d::Zero()); });
    f("link_pose", [&] { (void)link_pose(model, ws, link); });
    f("point_jacobian", [&] { point_jacobian(model, ws, link, Vector3d::Zero(), J); });
    f("frame_jacobian", [&] { frame_jacobian(model, ws, link, Vector3d::Zero(), F); });
    f("point_jacobian_transpose",
      [&] { point_jacobian_transpose(model, ws, link, Vector3d::Zero(), Vector3d::UnitX(), out); });
    f("point_velocity", [&] { (void)point_velocity(model, ws, link, Vector3d::Zero(), v); });
  }
};

}  // namespace

TEST_CASE("a joint vector of another size is refused with the names of function and argument",
          "[dynamics][unit]") {
  Calls calls;
  for (const int size : {0, n - 1, n + 1}) {
    calls.q = VectorXd::Zero(size);
    calls.each([&](const std::string& function, auto&& call) {
      CAPTURE(function, size);
      CHECK_THROWS_WITH(
          call(), function + ": q: " + std::to_string(size) + " given, expected 6 (one per joint)");
    });
    calls.q = VectorXd::Zero(n);
  }
  forward_kinematics(calls.model, calls.ws, calls.q);
  calls.out.resize(n - 1);
  CHECK_THROWS_WITH(gravity_torque(calls.model, calls.ws, calls.q, calls.out),
                    Contains("gravity_torque: tau: 5 given"));
  CHECK(calls.out.size() == n - 1);
  CHECK_THROWS_WITH(solve_mass(calls.model, calls.ws, calls.q, calls.v, calls.out),
                    Contains("solve_mass: x: 5 given"));
  CHECK_THROWS_WITH(
      forward_dynamics(calls.model, calls.ws, calls.q, calls.v.head(3), calls.a, calls.out),
      Contains("forward_dynamics: v: 3 given"));
  MatrixXd M(n, n - 1);
  CHECK_THROWS_WITH(mass_matrix(calls.model, calls.ws, calls.q, M),
                    Contains("mass_matrix: M (columns): 5 given"));
  calls.out.resize(n);
  calls.J.resize(3, n + 1);
  CHECK_THROWS_WITH(operational_inertia(calls.model, calls.ws, calls.q, calls.J),
                    Contains("J (columns): 7 given"));
  CHECK_THROWS_WITH(point_jacobian(calls.model, calls.ws, 0, Vector3d::Zero(), calls.J),
                    Contains("point_jacobian: J"));
  std::vector<Vector3d> centers(calls.model.shapes().size() + 1);
  CHECK_THROWS_WITH(shape_centers(calls.model, calls.ws, centers),
                    Contains("shape_centers: centers: room for"));
}

TEST_CASE("a link that the chain does not have is refused", "[dynamics][unit]") {
  Calls calls;
  forward_kinematics(calls.model, calls.ws, calls.q);
  for (const int link : {-1, n, 1000})
    calls.each_of_poses(link, [&](const std::string& function, auto&& call) {
      CAPTURE(function, link);
      CHECK_THROWS_WITH(call(), function + ": link: " + std::to_string(link) +
                                    " given, expected an index from 0 to 5");
    });
  calls.each_of_poses(n - 1, [&](const std::string&, auto&& call) { CHECK_NOTHROW(call()); });
  const std::vector<GyroscopicTerm> past{{n, Vector3d::Zero(), Vector3d::UnitX()}};
  CHECK_THROWS_WITH(gyroscopic_torque(calls.model, calls.ws, calls.q, calls.v, past, calls.out),
                    Contains("gyroscopic_torque: link: 6 given"));
}

TEST_CASE("a workspace of another model is refused, one of a copy is not", "[dynamics][unit]") {
  Calls calls;
  // `other` has the same robot, but is not the same model.
  const Model other(test::random_robot(3, n, 4)), copy(calls.model);
  const auto refuses = [&](const Model& model) {
    Calls foreign;
    foreign.ws = Workspace(model);
    const auto check = [&](const std::string& function, auto&& call) {
      CAPTURE(function);
      CHECK_THROWS_WITH(
          call(), Contains(function + ": the workspace was made for another model (of 6 joints)"));
    };
    foreign.each(check);
    foreign.each_of_poses(0, check);
    check("tip_pose", [&] { (void)tip_pose(foreign.model, foreign.ws); });
  };
  refuses(other);
  calls.ws = Workspace(copy);
  calls.each([&](const std::string&, auto&& call) { CHECK_NOTHROW(call()); });
  BatchWorkspace batch(other);
  StatesXd x = StatesXd::Zero(n, 4), y(n, 4);
  CHECK_THROWS_WITH(forward_dynamics(calls.model, batch, x, x, x, y),
                    Contains("made for another model"));
}

TEST_CASE("a workspace that was moved from is refused, and so is one of a model that was",
          "[dynamics][unit]") {
  Calls calls;
  forward_kinematics(calls.model, calls.ws, calls.q);
  Workspace taken(std::move(calls.ws));
  const auto check = [&](const std::string& function, auto&& call) {
    CAPTURE(function);
    CHECK_THROWS_WITH(call(), function +
                                  ": the workspace was moved from, expected one made for "
                                  "this 'random'");
  };
  calls.each(check);
  calls.each_of_poses(0, check);
  check("tip_pose", [&] { (void)tip_pose(calls.model, calls.ws); });
  CHECK_NOTHROW(tip_pose(calls.model, taken));
  calls.ws = std::move(taken);
  calls.each_of_poses(0, [&](const std::string&, auto&& call) { CHECK_NOTHROW(call()); });

  BatchWorkspace batch(calls.model);
  const BatchWorkspace other(std::move(batch));
  StatesXd x = StatesXd::Zero(n, 4), y(n, 4);
  CHECK_THROWS_WITH(forward_dynamics(calls.model, batch, x, x, x, y), Contains("moved from"));

  // Neither has an id, but that does not make them belong together.
  Model model(test::random_robot(3, n, 4));
  Workspace ws(model), ws_taken(std::move(ws));
  const Model model_taken(std::move(model));
  CHECK_THROWS_WITH(gravity_torque(model, ws, VectorXd::Zero(n), calls.out),
                    Contains("moved from"));
  CHECK_THROWS_WITH(Workspace(model), Contains("the model was moved from"));
  CHECK_THROWS_WITH(BatchWorkspace(model), Contains("the model was moved from"));
}

TEST_CASE("poses are refused before forward_kinematics", "[dynamics][unit]") {
  Calls calls;
  std::vector<Vector3d> shapes(calls.model.shapes().size());
  const auto each = [&](auto&& f) {
    calls.each_of_poses(0, f);
    f("tip_pose", [&] { (void)tip_pose(calls.model, calls.ws); });
    f("shape_centers", [&] { shape_centers(calls.model, calls.ws, shapes); });
    f("shape_half_axes", [&] { shape_half_axes(calls.model, calls.ws, shapes); });
  };
  const auto refused = [](const std::string& function, auto&& call) {
    CAPTURE(function);
    CHECK_THROWS_WITH(call(), function +
                                  ": the workspace has no poses yet, expected a call of "
                                  "forward_kinematics before");
  };
  const auto accepted = [](const std::string& function, auto&& call) {
    CAPTURE(function);
    CHECK_NOTHROW(call());
  };
  each(refused);
  gravity_torque(calls.model, calls.ws, calls.q, calls.out);
  each(refused);
  forward_kinematics(calls.model, calls.ws, calls.q);
  each(accepted);
  calls.ws = Workspace(calls.model);
  each(refused);
  gyroscopic_torque(calls.model, calls.ws, calls.q, calls.v, calls.terms, calls.out);
  each(accepted);
}

TEST_CASE("inverse kinematics refuses targets and starts that are not numbers",
          "[dynamics][unit]") {
  const Model model(test::random_robot(3, n, 4));
  const JointBox box(n, {}, {}, 0.0);
  InverseKinematics kinematics(model, box);
  Workspace ws(model);
  const VectorXd start = VectorXd::Constant(n, 0.2);
  forward_kinematics(model, ws, VectorXd::Constant(n, 0.3));
  const auto tip = tip_pose(model, ws);
  const TipTarget good{tip.p(), tip.R()};
  VectorXd q = start;
  CHECK(kinematics.solve(good, q));
  const auto refuses = [&](const char* message, auto&& spoil) {
    TipTarget target = good;
    q = start;
    spoil(target);
    const VectorXd before = q;
    CHECK_THROWS_WITH(kinematics.solve(target, q), Contains(message));
    CHECK((q.size() != n || !q.allFinite() || q == before));
  };
  const double nan = std::nan("");
  refuses("target: the position", [&](TipTarget& t) { t.position[1] = nan; });
  refuses("target: the position", [&](TipTarget& t) { t.position[2] = HUGE_VAL; });
  refuses("not a rotation matrix", [&](TipTarget& t) { t.rotation(2, 2) = nan; });
  refuses("not a rotation matrix", [&](TipTarget& t) { t.rotation *= 2.0; });
  refuses("not a rotation matrix", [&](TipTarget& t) { t.rotation.col(0) *= -1.0; });
  refuses("tolerance_m", [&](TipTarget& t) { t.tolerance_m = nan; });
  refuses("tolerance_rad", [&](TipTarget& t) { t.tolerance_rad = 0.0; });
  refuses("q: a number is not finite", [&](TipTarget&) { q[3] = nan; });
  refuses("q: expected one number per joint", [&](TipTarget&) { q.resize(n - 1); });
  TipTarget position = good;
  position.turns = false;
  position.rotation.setConstant(nan);
  position.tolerance_rad = nan;  // both have no effect
  q = start;
  CHECK(kinematics.solve(position, q));
  const JointBox other(n + 1, {}, {}, 0.0);
  CHECK_THROWS_WITH(InverseKinematics(model, other), Contains("box: made for 7 joints"));
  JointBox own(n, {}, {}, 0.0);
  InverseKinematics in_own(model, own);
  CHECK_THROWS_WITH(in_own.solve(good, own.lower), Contains("a vector of the box"));
}

TEST_CASE("a box of joint vectors has its lower side below its upper side", "[dynamics][unit]") {
  const auto limits = [](double x) { return VectorXd::Constant(2, x); };
  const double nan = std::nan(""), infinite = HUGE_VAL;
  CHECK_THROWS_WITH(JointBox(2, VectorXd::Zero(3), {}, 0.0), Contains("q_lower: 3 given"));
  CHECK_THROWS_WITH(JointBox(2, {}, limits(nan), 0.0), Contains("q_upper: the one of joint 0"));
  CHECK_THROWS_WITH(JointBox(2, limits(1.0), limits(-1.0), 0.0), Contains("is above"));
  CHECK_THROWS_WITH(JointBox(2, {}, {}, nan), Contains("reserve"));
  CHECK_THROWS_WITH(JointBox(2, {}, {}, -0.1), Contains("reserve"));
  const auto sides = [](const JointBox& box) { return std::pair(box.lower[1], box.upper[1]); };
  constexpr double pi = std::numbers::pi;
  CHECK(sides(JointBox(2, {}, {}, 0.1)) == std::pair(-pi, pi));
  CHECK(sides(JointBox(2, limits(-infinite), limits(infinite), 0.1)) == std::pair(-pi, pi));
  CHECK(sides(JointBox(2, limits(-1.0), limits(2.0), 0.25)) == std::pair(-0.75, 1.75));
  // a range that is narrower than both reserves; only one limit, beyond a half turn
  CHECK(sides(JointBox(2, limits(1.0), limits(1.5), 0.5)) == std::pair(1.25, 1.25));
  CHECK(sides(JointBox(2, limits(4.0), {}, 0.0)) == std::pair(4.0, 4.0 + 2.0 * pi));
  CHECK(sides(JointBox(2, {}, limits(-4.0), 0.0)) == std::pair(-4.0 - 2.0 * pi, -4.0));
}

TEST_CASE("a new model at the address of a destroyed one is another model", "[dynamics][unit]") {
  std::optional<Model> place(std::in_place, test::random_robot(1, n));
  Workspace ws(*place);
  const Model* const address = &*place;
  place.emplace(test::random_robot(2, n, 2));
  REQUIRE(&*place == address);
  VectorXd tau(n);
  CHECK_THROWS_WITH(gravity_torque(*place, ws, VectorXd::Zero(n), tau),
                    Contains("made for another model"));
  const Model moved(std::move(*place));
  Workspace again(moved);
  CHECK_NOTHROW(gravity_torque(moved, again, VectorXd::Zero(n), tau));
  CHECK_THROWS_WITH(gravity_torque(*place, again, VectorXd::Zero(n), tau),
                    Contains("another model"));
}

TEST_CASE("segments, columns and maps are used in place", "[dynamics][unit][allocation]") {
  const Model model(test::random_robot(5, n, 3));
  Workspace ws(model);
  const VectorXd x = VectorXd::LinSpaced(4 * n, -1.0, 1.0);
  VectorXd whole(n), parts = VectorXd::Zero(3 * n);
  MatrixXd columns(n, 3);
  for (int j = 0; j < 3; ++j) columns.col(j) = x.segment(j * n, n);
  const VectorXd q = x.segment(0, n), v = x.segment(n, n), tau = x.segment(2 * n, n);
  forward_dynamics(model, ws, q, v, tau, whole);
  const auto calls = [&] {
    forward_dynamics(model, ws, x.segment(0, n), x.segment(n, n), x.segment(2 * n, n),
                     parts.segment(0, n));
    forward_dynamics(model, ws, columns.col(0), columns.col(1), columns.col(2),
                     parts.segment(n, n));
    forward_dynamics(model, ws, VectorXd::Map(x.data(), n), VectorXd::Map(x.data() + n, n),
                     VectorXd::Map(x.data() + 2 * n, n), VectorXd::Map(parts.data() + 2 * n, n));
  };
  CHECK(test::allocations_in(calls) == 0);
  for (int j = 0; j < 3; ++j) CHECK(parts.segment(j * n, n) == whole);
  forward_dynamics(model, ws, 1.0 * q, v + VectorXd::Zero(n), tau, whole);  // expressions
  CHECK(parts.head(n) == whole);
  // A transposed row of a transposed matrix has no stride.
  forward_dynamics(model, ws, columns.transpose().row(0).transpose(), v, tau, whole);
  CHECK(parts.head(n) == whole);
}

TEST_CASE("blocks of states with one row stride are used in place",
          "[dynamics][unit][allocation]") {
  const Model model(test::random_robot(5, n, 3));
  BatchWorkspace ws(model);
  const StatesXd q = StatesXd::Random(n, 12), v = StatesXd::Random(n, 12),
                 tau = StatesXd::Random(n, 12);
  StatesXd whole(n, 12), parts(n, 12);
  forward_dynamics(model, ws, q, v, tau, whole);
  CHECK(test::allocations_in([&] {
          for (int k = 0; k < 12; k += 4)
            forward_dynamics(model, ws, q.middleCols(k, 4), v.middleCols(k, 4),
                             tau.middleCols(k, 4), parts.middleCols(k, 4));
        }) == 0);
  CHECK((parts - whole).norm() < 1e-12 * whole.norm());
  StatesXd narrow(n, 4);
  CHECK_THROWS_WITH(
      forward_dynamics(model, ws, q.leftCols(4), v.leftCols(4), tau.leftCols(4), narrow),
      "forward_dynamics: a: 6 x 4 numbers with row stride 4 given, expected 6 x 4 (joints x "
      "states) with "
      "row stride 12");
  CHECK_THROWS_WITH(inverse_dynamics(model, ws, q, v.leftCols(5), tau, whole),
                    Contains("inverse_dynamics: v: 6 x 5"));
}

TEST_CASE("the instruction set is an argument", "[dynamics][unit][isa]") {
  const Model model(test::random_robot(5, n));
  CHECK_THROWS_WITH(Workspace(model, Isa{7}), Contains("this machine or this build does not have"));
  CHECK_THROWS_WITH(BatchWorkspace(model, Isa{7}),
                    Contains("this machine or this build does not have"));
  CHECK_NOTHROW(Workspace(model, Isa::baseline));
}
