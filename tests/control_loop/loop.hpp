#pragma once
#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/scene/payload.hpp"

namespace hamelin::test {

inline constexpr double not_finite = std::numeric_limits<double>::quiet_NaN();
inline const std::filesystem::path data_folder = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";

/// A scene of data/, controlled by one torque per millisecond as a robot is. No paths are searched,
/// which a thread does in its own time.
inline scene::Scene sampled(const std::string& name) {
  scene::Scene scene = scene::read_scene(data_folder / "scenes" / name);
  scene.actuation.type = scene::ActuationType::sampled;
  scene.actuation.control_period_s = scene.step_s = 0.001;
  scene.guide.type = scene::GuideType::none;
  return scene;
}

/// The message with which an update is refused.
inline std::string refusal(const std::function<void()>& update) {
  try {
    update();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

/// A body for the tip.
inline scene::Payload small_can() {
  scene::Payload can;
  can.name = "can";
  can.mass_kg = 0.3;
  can.inertia_kg_m2 = 1e-3 * Eigen::Matrix3d::Identity();
  can.spheres.push_back({{0.0, 0.0, 0.05}, 0.02});
  return can;
}

/// Options of a controller whose arm is to carry something.
inline control::Controller::Options with_room() {
  control::Controller::Options options;
  options.payload_reach_m = 0.3;
  options.payload_shapes_max = 8;
  return options;
}

/// An arm that is simulated by an integrator alone, and a controller that moves it.
struct Loop {
  explicit Loop(const scene::Scene& scene, control::Controller::Options options = {},
                const Json& params = Json::object())
      : arm(control::load_model(scene)),
        plugin(planning::find_plugin(scene.planner->name,
                                     {HAMELIN_TEST_PLUGIN_DIR, HAMELIN_TEST_ONLY_PLUGIN_DIR})),
        controller(scene, arm, plugin, planning::check_params(plugin, params), std::move(options)),
        integrator(integration::make_integrator("hamel-variational", arm)),
        state(integrator->start(scene.start_q, Eigen::VectorXd::Zero(arm.dof()))),
        v(Eigen::VectorXd::Zero(arm.dof())) {}

  const control::Answer& tick() { return controller.tick(state.time_s, state.q, v); }

  void step(const Eigen::VectorXd& torque) {
    channels.held_torque = torque;
    REQUIRE(integrator->step(state, channels, 0.001).converged);
    state.time_s = 0.001 * static_cast<double>(state.k);
    integrator->velocity(state, v);
  }

  model::Model arm;
  planning::Plugin plugin;
  control::Controller controller;
  std::unique_ptr<integration::Integrator> integrator;
  integration::State state;
  integration::Channels channels;
  Eigen::VectorXd v;
};

}  // namespace hamelin::test
