#include <cmath>
#include <hamelin/control/controller.hpp>
#include <hamelin/control/preparation.hpp>
#include <hamelin/integration/integrator.hpp>
#include <iostream>

using namespace hamelin;

int main(int argc, char** argv) {  // follow_cpp SCENE PLUGIN_DIRECTORY
  if (argc != 3) return 2;
  scene::Scene scene = scene::read_scene(argv[1]);
  scene.goals = {scene::follow_goal()};  // with the default bounds of what is believed
  control::Controller controller(scene, {argv[2]});
  const double period_s = controller.period_s();

  const model::Model arm = control::load_model(scene);  // a simulated arm
  const auto robot = integration::make_integrator("rk4", arm);
  integration::State measured = robot->start(scene.start_q, Eigen::VectorXd::Zero(arm.dof()));

  const control::Answer* answer = &controller.tick(0.0, measured.q, measured.v);
  const geometry::SE3 start = controller.tip();
  double now_s = 0.0, clearance_m = 1.0;
  for (int k = 1; k <= 4000; ++k) {
    if (!robot->step(measured, {.held_torque = answer->torque}, period_s).converged) return 1;
    now_s = k * period_s;
    if (k % 16 == 0) {  // any thread may do this: your camera, script or joystick takes its place
      const Eigen::Vector3d aside(0.0, 0.05 * std::sin(2.0 * now_s), 0.0);
      controller.set_target(control::TargetPose{now_s, {start.R(), start.p() + aside}});
    }
    answer = &controller.tick(now_s, measured.q, measured.v);
    clearance_m = std::min(clearance_m, controller.view().clearance_m());
    if (answer->target->lost) break;  // no pose for 0.2 s: the arm holds its place
  }
  const double error_m = (controller.tip().p() - answer->target->pose.p()).norm();
  std::cout << (error_m < 0.005 ? "there" : "not there") << " after " << now_s << " s, clearance "
            << clearance_m << " m at least\n";
}
