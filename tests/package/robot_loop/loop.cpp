#include <hamelin/control/controller.hpp>
#include <hamelin/control/preparation.hpp>
#include <hamelin/integration/integrator.hpp>
#include <iostream>

using namespace hamelin;

int main(int argc, char** argv) {  // loop_cpp SCENE PLUGIN_DIRECTORY
  if (argc != 3) return 2;
  scene::Scene scene = scene::read_scene(argv[1]);
  control::Controller controller(scene, {argv[2]});
  const double period_s = controller.period_s();

  // A simulated arm: the driver of your robot takes its place.
  const model::Model arm = control::load_model(scene);
  const auto robot = integration::make_integrator("rk4", arm);
  integration::State measured = robot->start(scene.start_q, Eigen::VectorXd::Zero(arm.dof()));

  double now_s = 0.0, clearance_m = 1.0;
  auto state = control::ControlState::running;
  for (int k = 0; k < 20000 && state == control::ControlState::running; ++k) {
    now_s = k * period_s;
    const control::Answer& answer = controller.tick(now_s, measured.q, measured.v);
    state = answer.state;
    clearance_m = std::min(clearance_m, controller.view().clearance_m());
    if (!robot->step(measured, {.held_torque = answer.torque}, period_s).converged) return 1;
  }
  std::cout << (state == control::ControlState::reached ? "there" : "not there") << " after "
            << now_s << " s, clearance " << clearance_m << " m at least\n";
}
