#include <hamelin/control/controller.hpp>
#include <hamelin/control/preparation.hpp>
#include <hamelin/integration/integrator.hpp>
#include <hamelin/sensing/depth_camera.hpp>
#include <iostream>

using namespace hamelin;

int main(int argc, char** argv) {  // points_cpp SCENE PLUGIN_DIRECTORY
  if (argc != 3) return 2;
  scene::Scene scene = scene::read_scene(argv[1]);
  const model::Model arm = control::load_model(scene);  // a simulated arm
  const auto robot = integration::make_integrator("rk4", arm);
  integration::State measured = robot->start(scene.start_q, Eigen::VectorXd::Zero(arm.dof()));

  // A simulated camera on the right of the arm: it sees the scene's map, and the arm in it.
  const scene::Environment room = scene::make_environment(scene, arm, 0.2);
  sensing::DepthRenderer renderer({.width = 80, .height = 60, .fov_rad = 1.4, .noise_m = 0.002});
  renderer.set_map(room);
  Rng noise(1);
  Eigen::Matrix3d R;
  R << 1, 0, 0, 0, -0.6, 0.8, 0, -0.8, -0.6;  // x, y and z of its frame as columns
  const geometry::SE3 camera{R, {0.4, -0.9, 1.1}};
  const auto look = [&](double time_s) {
    control::PointFrame frame;
    frame.points = renderer.render(camera, {}, noise);
    frame.sensor = camera;
    frame.time_s = time_s;
    frame.range_m = 3.0;
    return frame;
  };

  scene.map->file.clear();  // the controller knows nothing of the map but the size of its voxels
  scene.map->resolution_m = 0.02;
  control::Controller controller(scene, {argv[2]});
  control::FrameReport report = controller.world().insert_points(look(0.0));
  const double period_s = controller.period_s();
  double now_s = 0.0, clearance_m = 1.0;
  auto state = control::ControlState::running;
  for (int k = 0; k < 20000 && state == control::ControlState::running; ++k) {
    now_s = k * period_s;
    if (k % 100 == 99)  // any thread may do this
      report = controller.world().insert_points(look(now_s));
    const control::Answer& answer = controller.tick(now_s, measured.q, measured.v);
    state = answer.state;
    clearance_m = std::min(clearance_m, controller.view().clearance_m());
    if (!robot->step(measured, {.held_torque = answer.torque}, period_s).converged) return 1;
  }
  std::cout << (state == control::ControlState::reached ? "there" : "not there") << " after "
            << now_s << " s, clearance " << clearance_m << " m at least\n";
}
