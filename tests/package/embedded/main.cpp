#include <hamelin/control/controller.hpp>
#include <hamelin/description/robot_io.hpp>
#include <hamelin/integration/integrator.hpp>
#include <iostream>

int main(int, char** argv) {  // first PREFIX/share/hamelin PREFIX/lib/hamelin/plugins
  using namespace hamelin;
  const std::filesystem::path data = argv[1], robots = data / "robots";
  const model::Model arm(
      description::read_robot(robots / "arm7.urdf", {"flange", robots / "arm7.spheres.json"}));
  const auto integrator = integration::make_integrator("gauss:8", arm);
  integration::State state =
      integrator->start(Eigen::VectorXd::Constant(7, 0.3), Eigen::VectorXd::Zero(7));
  for (int k = 0; k < 1000; ++k)
    if (!integrator->step(state, {}, 1e-3).converged) return 1;
  std::cout << "energy after 1 s of free fall: " << integrator->energy(state).total() << " J\n";

  const scene::Scene scene = scene::read_scene(data / "scenes/shelf.json");
  control::WorldView world(scene, arm, 0.5);  // sees obstacles within 0.5 m
  world.look(scene.start_q, 0.0);
  std::cout << "nearest obstacle: " << world.clearance_m() << " m\n";

  control::Controller controller(scene, arm, planning::find_plugin("hybrid", {argv[2]}), {});
  const control::Answer& answer =
      controller.tick(0.0, scene.start_q, Eigen::VectorXd::Zero(arm.dof()));
  std::cout << "the first torque: " << answer.torque.transpose() << " Nm\n";
}
