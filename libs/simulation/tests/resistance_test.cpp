#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>

#include "hamelin/control/preparation.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/chains.hpp"

using namespace hamelin;
using Eigen::VectorXd;

// A joint's dry friction and armature, given by a scene, in free motion.
namespace {

/// A rod about a horizontal axis through its end: I = m l²/3.
constexpr double length_m = 0.5, mass_kg = 1.2, inertia_kg_m2 = mass_kg * length_m * length_m / 3.0;

model::Robot pendulum() {
  const double about_com = mass_kg * length_m * length_m / 12.0;
  model::Robot robot = test::chain_along_y(
      1, length_m, Eigen::Vector3d(about_com, 0.1 * about_com, about_com).asDiagonal(), "x");
  robot.links[0].mass_kg = mass_kg;
  return robot;
}

/// Writes a robot file and makes scenes with it. The file is removed with the object.
class ScratchScene {
 public:
  explicit ScratchScene(const model::Robot& robot)
      : robot_(std::filesystem::temp_directory_path() /
               ("hamelin_resistance_" + robot.name + ".json")) {
    write_file_atomically(robot_, description::robot_to_json(robot).dump());
  }
  ~ScratchScene() {
    std::error_code ignored;
    std::filesystem::remove(robot_, ignored);
  }
  ScratchScene(const ScratchScene&) = delete;
  ScratchScene& operator=(const ScratchScene&) = delete;
  [[nodiscard]] scene::Scene with(const Json& model) const {
    return scene::scene_from_json(
        {{"schema", "hamelin.scene/1"}, {"robot", {{"file", robot_.string()}}}, {"model", model}},
        ".", "scene");
  }

 private:
  std::filesystem::path robot_;
};

}  // namespace

TEST_CASE("dry friction slows a wheel as the closed form predicts", "[simulation][friction]") {
  // I dv/dt = −c tanh(v/s) is solved by sinh(v/s) = sinh(v₀/s) e^{−ct/(Is)}
  const double c = 0.2, s = 0.05, v0 = 2.0, t = 0.5 * inertia_kg_m2 * v0 / c;
  const double expected =
      s * std::asinh(std::sinh(v0 / s) * std::exp(-c * t / (inertia_kg_m2 * s)));
  REQUIRE(expected == Approx(1.0).margin(0.01));
  const model::Model wheel(pendulum(), geometry::SE3{}, Eigen::Vector3d::Zero());
  integration::Channels channels;
  channels.coulomb = VectorXd::Constant(1, c);
  channels.coulomb_speed = s;
  for (const auto& name : integration::integrator_names()) {
    CAPTURE(name);
    const auto integrator = integration::make_integrator(name, wheel);
    const auto error = [&](int steps) {
      auto state = integrator->start(VectorXd::Zero(1), VectorXd::Constant(1, v0));
      double dissipated = 0.0;
      for (int k = 0; k < steps; ++k) {
        const auto report = integrator->step(state, channels, t / steps);
        REQUIRE(report.converged);
        REQUIRE(report.dissipated_J >= 0.0);
        dissipated += report.dissipated_J;
      }
      VectorXd v(1);
      integrator->velocity(state, v);
      // The lost energy equals the booked one, up to the scheme's energy error.
      const double lost = 0.5 * inertia_kg_m2 * (v0 * v0 - v[0] * v[0]);
      CHECK(dissipated == Approx(lost).epsilon(0.02));
      return std::abs(v[0] - expected);
    };
    // At this speed the torque is constant to 1e-17, so that schemes of any order are exact to
    // rounding.
    CHECK(error(200) < 1e-3);
  }
}

TEST_CASE(
    "a pendulum with dry friction loses energy at every step, and rests where friction holds it",
    "[simulation][friction]") {
  const std::string name = GENERATE(as<std::string>{}, "hamel-variational", "rk4");
  CAPTURE(name);
  const model::Model arm(pendulum());
  const double c = 0.4, h = 1e-3;
  integration::Channels channels;
  channels.coulomb = VectorXd::Constant(1, c);
  const auto integrator = integration::make_integrator(name, arm);
  // The rod is released along y, where gravity has its longest lever: m g l/2 = 2.9 Nm.
  auto state = integrator->start(VectorXd::Zero(1), VectorXd::Zero(1));
  const double start = integrator->energy(state).total();
  double dissipated = 0.0, before = start;
  for (int k = 0; k < 20000; ++k) {
    const auto report = integrator->step(state, channels, h);
    REQUIRE(report.converged);
    REQUIRE(report.dissipated_J >= 0.0);
    dissipated += report.dissipated_J;
    const double now = integrator->energy(state).total();
    REQUIRE(now <= before + 1e-5);  // the scheme's own energy error
    before = now;
  }
  CHECK(start - before == Approx(dissipated).epsilon(1e-3));
  CHECK(dissipated > 1.0);
  VectorXd v(1), torque(1);
  integrator->velocity(state, v);
  dynamics::Workspace ws(arm);
  dynamics::gravity_torque(arm, ws, state.q, torque);
  // It creeps at the speed at which friction balances gravity's torque.
  CHECK(std::abs(torque[0]) < c);
  CHECK(v[0] == Approx(-channels.coulomb_speed * std::atanh(torque[0] / c)).epsilon(0.02));
}

TEST_CASE(
    "free motion uses friction and armature of the scene, and by default the robot's own armature",
    "[simulation][scene]") {
  model::Robot robot = test::planar3();
  for (std::size_t i = 0; i < 3; ++i) {
    robot.links[i].joint.friction = 0.1 * static_cast<double>(i + 1);
    robot.links[i].joint.armature = 0.01 * static_cast<double>(i + 1);
  }
  const ScratchScene scratch(robot);
  const auto armature = [](const model::Model& model) {
    VectorXd x(model.dof());
    for (int i = 0; i < model.dof(); ++i)
      x[i] = model.robot().links[static_cast<std::size_t>(i)].joint.armature;
    return x;
  };
  const auto motion = [&](const scene::Scene& scene) {
    return simulation::free_motion(scene, control::load_model(scene));
  };
  CHECK(motion(scratch.with(nullptr)).coulomb.size() == 0);
  CHECK(armature(control::load_model(scratch.with(nullptr))) == Eigen::Vector3d(0.01, 0.02, 0.03));
  const auto robots =
      scratch.with({{"friction", "robot"}, {"friction_speed", 0.1}, {"armature", 0}});
  CHECK(motion(robots).coulomb == Eigen::Vector3d(0.1, 0.2, 3 * 0.1));
  CHECK(motion(robots).coulomb_speed == 0.1);
  CHECK(armature(control::load_model(robots)) == Eigen::Vector3d::Zero());
  const auto own = scratch.with({{"friction", {0.0, 0.5, 0.0}}, {"armature", 0.2}});
  CHECK(motion(own).coulomb == Eigen::Vector3d(0.0, 0.5, 0.0));
  CHECK(armature(control::load_model(own)) == Eigen::Vector3d::Constant(0.2));
  CHECK_THROWS_WITH(motion(scratch.with({{"friction", {1.0, 2.0}}})),
                    Catch::Contains("scene: /model/friction: 2 values given, expected 1 or 3"));
  CHECK_THROWS_WITH(motion(scratch.with({{"armature", {1.0, 2.0}}})),
                    Catch::Contains("scene: /model/armature: 2 values given, expected 1 or 3"));

  // Friction and armature have an effect.
  auto scene = own;
  scene.duration_s = 1.0;
  const auto result = simulation::integrate(control::load_model(scene), motion(scene), {});
  CHECK(result.dissipated_J > 1e-3);
  CHECK(result.energy_error_max_J < 1e-4);
}

TEST_CASE("all integrators move an arm with armature as rk4 does", "[simulation][armature]") {
  const bool planar = GENERATE(true, false);
  CAPTURE(planar);
  model::Robot robot = planar ? test::planar3() : test::spatial_chain(4);
  const int n = robot.dof();
  const VectorXd q0 = VectorXd::LinSpaced(n, 0.5, -0.7), v0 = VectorXd::LinSpaced(n, 1.0, -2.0);
  const double h = 1e-4, duration_s = 0.2;
  const auto end = [&](const std::string& name, const model::Model& model) {
    const auto integrator = integration::make_integrator(name, model);
    auto state = integrator->start(q0, v0);
    for (int k = 0; k < static_cast<int>(std::lround(duration_s / h)); ++k)
      REQUIRE(integrator->step(state, {}, h).converged);
    return state.q;
  };
  const VectorXd without = end("rk4", model::Model(robot));
  for (int i = 0; i < n; ++i)
    robot.links[static_cast<std::size_t>(i)].joint.armature = (planar ? 0.5 : 0.02) * (i + 1);
  const model::Model model(robot);
  const VectorXd expected = end("rk4", model);
  const double effect = (expected - without).norm();
  REQUIRE(effect > 1e-3);
  for (const auto& name : integration::integrator_names()) {
    CAPTURE(name);
    CHECK((end(name, model) - expected).norm() < 0.02 * effect);  // first order is enough for that
  }
}
