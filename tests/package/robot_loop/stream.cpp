#include <cmath>
#include <hamelin/control/controller.hpp>
#include <hamelin/control/preparation.hpp>
#include <hamelin/integration/integrator.hpp>
#include <iostream>

using namespace hamelin;

// A hand that swings by ±0.25 m: your camera takes its place.
geometry::SE3 hand_at(double time_s) {
  return {Eigen::Matrix3d::Identity(), {0.6, 0.25 * std::sin(2.0 * time_s), 0.6}};
}

int main(int argc, char** argv) {  // stream_cpp SCENE PLUGIN_DIRECTORY
  if (argc != 3) return 2;
  scene::Scene scene = scene::read_scene(argv[1]);
  control::Controller::Options options;
  options.observations.noise_m = 0.001;  // of the camera
  control::Controller controller(scene, {argv[2]}, options);
  control::World& world = controller.world();
  const double period_s = controller.period_s();

  const model::Model arm = control::load_model(scene);  // a simulated arm
  const auto robot = integration::make_integrator("rk4", arm);
  integration::State measured = robot->start(scene.start_q, Eigen::VectorXd::Zero(arm.dof()));

  scene::Obstacle hand;
  hand.name = "hand";
  hand.radius_m = 0.08;
  hand.pose = hand_at(0.0);
  hand.prediction = scene::Prediction::constant_acceleration;
  hand.speed_max_m_s = 0.6;  // poses that jump faster are refused
  world.set_obstacle(hand);

  double now_s = 0.0, clearance_m = 1.0;
  auto state = control::ControlState::running;
  for (int k = 0; k < 20000 && state == control::ControlState::running; ++k) {
    now_s = k * period_s;
    if (k % 16 == 0) {  // any thread may do this: poses arrive 20 ms after they were measured
      const double seen_s = now_s - 0.02;
      world.observe_obstacle("hand", {seen_s, hand_at(seen_s)});
    }
    if (now_s - world.last_observed("hand").value_or(now_s) > 0.2) break;  // the camera is silent
    const control::Answer& answer = controller.tick(now_s, measured.q, measured.v);
    state = answer.state;
    clearance_m = std::min(clearance_m, controller.view().clearance_m());
    if (!robot->step(measured, {.held_torque = answer.torque}, period_s).converged) return 1;
  }
  std::cout << (state == control::ControlState::reached ? "there" : "not there") << " after "
            << now_s << " s, clearance " << clearance_m << " m at least\n";
}
