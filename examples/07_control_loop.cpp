// Your own loop: measure, ask for a torque, send it. A ball appears on the way.
#include <fmt/core.h>

#include <algorithm>
#include <hamelin/control/controller.hpp>
#include <hamelin/control/preparation.hpp>
#include <hamelin/integration/integrator.hpp>

int main(int, char** argv) {  // 07_control_loop FOLDER_OF_PLANNERS
  using namespace hamelin;
  const scene::Scene scene = scene::read_scene("data/scenes/clutter.json");
  control::Controller::Options options;
  options.guide_thread = false;  // searches in this thread: the same result in each run
  control::Controller controller(scene, {argv[1]}, options);
  const double period_s = controller.period_s();

  // A simulated arm, in place of the driver of your robot.
  const model::Model arm = control::load_model(scene);
  const auto robot = integration::make_integrator("rk4", arm);
  integration::State measured = robot->start(scene.start_q, Eigen::VectorXd::Zero(arm.dof()));

  scene::Obstacle ball;
  ball.name = "ball";
  ball.shape = scene::Shape::sphere;
  ball.radius_m = 0.1;
  ball.pose = geometry::SE3(Eigen::Matrix3d::Identity(), Eigen::Vector3d(1.5, 0.0, 0.5));

  double clearance_m = 1.0;
  for (int k = 0; k < 20000; ++k) {
    if (k == 100) controller.world().set_obstacle(ball);  // any thread may do this
    const control::Answer& answer = controller.tick(k * period_s, measured.q, measured.v);
    controller.run_guide();
    clearance_m = std::min(clearance_m, controller.view().clearance_m());
    if (answer.state == control::ControlState::reached) {
      fmt::print("reached after {:.3f} s, clearance {:.6f} m at least\n", k * period_s,
                 clearance_m);
      return 0;
    }
    integration::Channels channels;
    channels.held_torque = answer.torque;
    if (!robot->step(measured, channels, period_s).converged) return 1;
  }
  return 1;
}
