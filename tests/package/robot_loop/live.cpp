#include <atomic>
#include <hamelin/control/controller.hpp>
#include <hamelin/control/preparation.hpp>
#include <hamelin/integration/integrator.hpp>
#include <iostream>
#include <thread>

using namespace hamelin;
using namespace std::chrono_literals;

struct Robot {  // a simulated arm: the driver of your robot takes its place
  model::Model arm;
  std::unique_ptr<integration::Integrator> simulation = integration::make_integrator("rk4", arm);
  integration::State state;
  void apply(const Eigen::VectorXd& torque, double period_s) {
    if (!simulation->step(state, {.held_torque = torque}, period_s).converged) std::exit(1);
  }
};

int main(int argc, char** argv) {  // live_cpp SCENE PLUGIN_DIRECTORY
  if (argc != 3) return 2;
  scene::Scene scene = scene::read_scene(argv[1]);
  control::Controller controller(scene, {argv[2]});
  Robot robot{control::load_model(scene)};
  robot.state = robot.simulation->start(scene.start_q, Eigen::VectorXd::Zero(robot.arm.dof()));

  std::atomic<double> now_s{0.0};
  std::thread user([&] {  // goals and world may be changed by any thread
    scene::Obstacle ball;
    ball.name = "ball";
    ball.radius_m = 0.08;
    ball.pose = {Eigen::Matrix3d::Identity(), {0.5, 0.6, 0.6}};
    controller.world().set_obstacle(ball);
    std::this_thread::sleep_for(500ms);
    controller.world().move_obstacle("ball", ball.pose, {0.0, -0.1, 0.0}, now_s);
    controller.set_goal(scene::joint_goal(scene.start_q));
  });

  const auto start = std::chrono::steady_clock::now();
  const double period_s = controller.period_s();
  double clearance_m = 1.0;
  bool home = false;
  for (int k = 0; k < 20000 && !home; ++k) {
    std::this_thread::sleep_until(start + k * period_s * 1s);
    now_s = k * period_s;
    const control::Answer& answer = controller.tick(now_s, robot.state.q, robot.state.v);
    home = answer.goals_number == 1 && answer.state == control::ControlState::reached;
    clearance_m = std::min(clearance_m, controller.view().clearance_m());
    robot.apply(answer.torque, period_s);
  }
  user.join();
  std::cout << (home ? "home" : "not home") << " after " << now_s << " s, clearance " << clearance_m
            << " m at least\n";
}
