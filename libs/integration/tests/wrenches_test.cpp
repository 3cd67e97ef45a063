#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "hamelin/integration/step_derivatives.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/frames.hpp"
#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

dynamics::Vector6d six(double a, double b, double c, double d, double e, double f) {
  return (dynamics::Vector6d() << a, b, c, d, e, f).finished();
}

// Held wrenches in all terms, on the tip, an inner link and the base.
std::vector<ExternalWrench> held(const Model& model) {
  return {{Model::tip_frame, dynamics::Reference::local_world_aligned,
           six(0.1, -0.2, 0.3, 2.0, -1.0, 0.5)},
          {model.frame("own1"), dynamics::Reference::local, six(-0.3, 0.1, 0.2, 0.5, 1.5, -2.0)},
          {model.frame("lumped2"), dynamics::Reference::world, six(0.2, 0.2, -0.1, -1.0, 0.5, 1.0)},
          {model.frame("own-1"), dynamics::Reference::world, six(9.0, 9.0, 9.0, 9.0, 9.0, 9.0)}};
}

// A spring and a damper between the tip and a point of the world.
struct Spring {
  const Model& model;
  double stiffness = 40.0, damping = 0.0;
  Vector3d anchor{0.3, -0.2, 0.4};

  [[nodiscard]] Channels channels() const {
    Channels out;
    out.wrenches = {{Model::tip_frame, dynamics::Reference::local_world_aligned, {}}};
    out.wrench_law = [this](const dynamics::Workspace& ws, const VectorXd&, const VectorXd& v,
                            std::span<ExternalWrench> wrenches) {
      const Vector3d at = dynamics::frame_pose(model, ws, Model::tip_frame).p();
      const Vector3d velocity =
          dynamics::frame_velocity(model, ws, Model::tip_frame,
                                   dynamics::Reference::local_world_aligned, v)
              .tail<3>();
      wrenches[0].wrench << Vector3d::Zero(), stiffness * (anchor - at) - damping * velocity;
    };
    return out;
  }
  [[nodiscard]] double energy(const VectorXd& q) const {
    dynamics::Workspace ws(model);
    dynamics::forward_kinematics(model, ws, q);
    return 0.5 * stiffness *
           (dynamics::frame_pose(model, ws, Model::tip_frame).p() - anchor).squaredNorm();
  }
};

State run(Integrator& integrator, const Channels& channels, double h, int steps,
          double* work = nullptr) {
  const int n = integrator.model().dof();
  State state = integrator.start(VectorXd::Constant(n, 0.3), VectorXd::Constant(n, -0.2));
  for (int k = 0; k < steps; ++k) {
    const StepReport report = integrator.step(state, channels, h);
    REQUIRE(report.converged);
    if (work != nullptr) *work += report.external_work_J;
  }
  return state;
}

}  // namespace

TEST_CASE("the work of wrenches is what the energy of the arm gains", "[integration][wrenches]") {
  const bool planar = GENERATE(false, true), law = GENERATE(false, true);
  const int prismatic_every = GENERATE(0, 3);
  const Model model = test::model_with_frames(5, 5, prismatic_every, planar);
  const Spring spring{.model = model, .damping = 1.0};
  Channels channels;
  if (law)
    channels = spring.channels();
  else
    channels.wrenches = held(model);
  const auto integrator = make_integrator("gauss:8", model);
  const VectorXd q = VectorXd::Constant(5, 0.3), v = VectorXd::Constant(5, -0.2);
  const double before = integrator->energy(integrator->start(q, v)).total();
  double work = 0.0;
  const State after = run(*integrator, channels, 1e-3, 500, &work);
  CAPTURE(planar, law, prismatic_every, work);
  CHECK(std::abs(work) > 1e-2);
  CHECK(std::abs(integrator->energy(after).total() - before - work) <=
        1e-12 * (1.0 + std::abs(before) + std::abs(work)));
}

TEST_CASE("a spring to the world, by a wrench law, keeps the energy of arm and spring",
          "[integration][wrenches]") {
  const Model model = test::model_with_frames(6, 6, 3, false);
  const Spring spring{.model = model};
  const auto integrator = make_integrator("gauss:8", model);
  const VectorXd q = VectorXd::Constant(6, 0.3), v = VectorXd::Constant(6, -0.2);
  const double before = integrator->energy(integrator->start(q, v)).total() + spring.energy(q);
  const State after = run(*integrator, spring.channels(), 1e-3, 1000);
  CHECK(std::abs(integrator->energy(after).total() + spring.energy(after.q) - before) <=
        1e-12 * (1.0 + std::abs(before)));
}

TEST_CASE("all schemes converge to one motion under wrenches, with their order",
          "[integration][wrenches]") {
  const auto name = GENERATE(from_range(integrator_names()));
  const bool law = GENERATE(false, true);
  CAPTURE(name, law);
  const Model model = test::model_with_frames(7, 4, 0, false);
  const Spring spring{.model = model, .damping = 0.5};
  Channels channels;
  if (law)
    channels = spring.channels();
  else
    channels.wrenches = held(model);
  constexpr double duration = 0.2;
  const auto exact = make_integrator("gauss:12", model);
  const VectorXd expected = run(*exact, channels, duration / 400, 400).q;
  const auto error = [&](int steps) {
    const auto integrator = make_integrator(name, model);
    return (run(*integrator, channels, duration / steps, steps).q - expected).norm();
  };
  const double coarse = error(20), fine = error(40);
  const int order = make_integrator(name, model)->order();
  CAPTURE(order, coarse, fine);
  if (find_scheme(name)->step_control || fine < 1e-11)
    CHECK(fine <= 1e-8);
  else
    CHECK(coarse / fine > 0.8 * std::pow(2.0, order));
}

TEST_CASE("the derivative of a step under held wrenches agrees with differences",
          "[integration][wrenches]") {
  const std::string scheme = GENERATE("hamel-variational", "gauss");
  const Model model = test::model_with_frames(8, 5, 2, false);
  Channels channels;
  channels.wrenches = held(model);
  for (auto& each : channels.wrenches) each.wrench *= 20.0;
  const auto integrator = make_integrator(scheme, model);
  const Index n = 5;
  Rng rng(3);
  const VectorXd q = test::random_joints(rng, 5, 1.5), v = test::random_joints(rng, 5, 1.5);
  constexpr double h = 0.02;
  State after = integrator->start(q, v);
  const VectorXd p = after.p;
  REQUIRE(integrator->step(after, channels, h).converged);
  StepDerivatives out(n);
  make_step_differentiator(model, make_options(scheme))->differentiate(after, channels, out);
  const auto moved = [&](const VectorXd& at) {
    State state = integrator->start(at.head(n), VectorXd::Zero(n));
    state.p = at.tail(n);
    REQUIRE(integrator->step(state, channels, h).converged);
    return (VectorXd(2 * n) << state.q, state.p).finished();
  };
  const VectorXd at = (VectorXd(2 * n) << q, p).finished();
  constexpr double d = 1e-5;
  MatrixXd expected(2 * n, 2 * n);
  for (Index k = 0; k < 2 * n; ++k) {
    const VectorXd unit = VectorXd::Unit(2 * n, k);
    expected.col(k) = (moved(at + d * unit) - moved(at - d * unit)) / (2.0 * d);
  }
  CHECK((out.by_state - expected).norm() <= 1e-7 * expected.norm());
  channels.wrench_law = [](const dynamics::Workspace&, const VectorXd&, const VectorXd&,
                           std::span<ExternalWrench>) {};
  CHECK(
      test::error_of([&] {
        make_step_differentiator(model, make_options(scheme))->differentiate(after, channels, out);
      }).find("channels.wrench_law: given, expected held wrenches") != std::string::npos);
}

TEST_CASE("what a wrench law throws leaves the step, and the state is unchanged",
          "[integration][wrenches]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model = test::model_with_frames(9, 4, 0, false);
  const auto integrator = make_integrator(name, model);
  State state = integrator->start(VectorXd::Constant(4, 0.1), VectorXd::Zero(4));
  Channels channels;
  channels.wrenches = held(model);
  REQUIRE(integrator->step(state, channels, 1e-3).converged);
  const State before = state;
  int calls = 0;
  channels.wrench_law = [&calls](const dynamics::Workspace&, const VectorXd&, const VectorXd&,
                                 std::span<ExternalWrench>) {
    if (++calls == 3) throw std::runtime_error("the sensor is gone");
  };
  CHECK_THROWS_WITH(
      [&] {
        for (int k = 0; k < 3; ++k) (void)integrator->step(state, channels, 1e-3);
      }(),
      "the sensor is gone");
  CHECK(calls == 3);
  channels.wrench_law = nullptr;
  State again = before;
  REQUIRE(integrator->step(again, channels, 1e-3).converged);
}

TEST_CASE("a frame that does not exist is refused before a step", "[integration][wrenches]") {
  const Model model = test::model_with_frames(9, 4, 0, false);
  const auto integrator = make_integrator("gauss", model);
  State state = integrator->start(VectorXd::Zero(4), VectorXd::Zero(4));
  Channels channels;
  channels.wrenches = {{77, dynamics::Reference::local, dynamics::Vector6d::Ones()}};
  CHECK(test::error_of([&] {
          (void)integrator->step(state, channels, 1e-3);
        }).find("step: channels.wrenches: frame 77 given") != std::string::npos);
}
