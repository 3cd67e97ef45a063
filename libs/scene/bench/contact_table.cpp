// Prints the cost of Environment::closest and SelfField::closest for a scene's arm, over random
// configurations near start and goal, grouped by the distance of the nearest obstacle. Columns:
// number of configurations, mean number of contacts, time of one call for all shapes of the arm,
// the same per shape, time of one call for all pairs of parts of the arm.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Clock = std::chrono::steady_clock;

struct Pose {
  PlacedShapes arm;
  double clearance = 0.0;
};

// The best of several passes over all poses [µs per call].
template <typename Call>
double cost_us(const std::vector<const Pose*>& poses, const Call& call) {
  double best = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < 15; ++pass) {
    const auto start = Clock::now();
    for (const Pose* pose : poses) call(*pose);
    best = std::min(best, std::chrono::duration<double, std::micro>(Clock::now() - start).count());
  }
  return best / static_cast<double>(poses.size());
}

int run(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: {} SCENE.json INFLUENCE_M [SPREAD_RAD]\n", argv[0]);
    return 2;
  }
  const Scene scene = read_scene(argv[1]);
  const double influence = std::stod(argv[2]), spread = argc > 3 ? std::stod(argv[3]) : 0.6;
  const model::Model model(
      description::read_robot(scene.robot.file, {scene.robot.tip, scene.robot.spheres}),
      scene.base);
  auto start = Clock::now();
  const Environment environment = make_environment(scene, model, influence);
  const double build_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  const SelfField self(model);
  dynamics::Workspace ws(model);
  const std::size_t shapes = model.shapes().size();

  std::vector<Pose> poses(2000);
  Rng rng(1);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    Eigen::VectorXd q = i % 2 == 0 || scene.goals.empty() ? scene.start_q : scene.goals.front().q;
    if (q.size() != model.dof()) q.setZero(model.dof());
    for (double& angle : q) angle += rng.uniform(-spread, spread);
    dynamics::forward_kinematics(model, ws, q);
    poses[i].arm = PlacedShapes(model);
    poses[i].arm.place(model, ws);
    poses[i].clearance = environment.clearance(poses[i].arm.view(), 0.0, 1.0, View::planner);
  }
  fmt::print(
      "{}: {} shapes, {} boxes, influence {} m, environment made in {:.1f} ms, {} pairs of parts\n",
      argv[1], shapes, environment.map_field().boxes().boxes().size(), influence, build_ms,
      self.pairs().size());
  fmt::print("{:<22} {:>8} {:>15} {:>17} {:>22} {:>21}\n", "clearance to obstacles", "poses",
             "contacts a pose", "obstacles us/pose", "obstacles ns/shape", "itself us/pose");
  Environment::Scratch scratch(environment, shapes);
  std::vector<Contact> out(environment.contacts_max(shapes));
  std::vector<SelfContact> pairs(self.pairs().size());
  const double edges[] = {-1e9, 0.0, 0.25 * influence, influence, 1e9};
  const char* names[] = {"in contact", "within influence / 4", "within influence", "beyond"};
  for (std::size_t row = 0; row < 4; ++row) {
    std::vector<const Pose*> chosen;
    std::size_t contacts = 0;
    for (const Pose& pose : poses)
      if (pose.clearance > edges[row] && pose.clearance <= edges[row + 1]) chosen.push_back(&pose);
    if (chosen.empty()) continue;
    for (const Pose* pose : chosen)
      contacts += environment.closest(pose->arm.view(), influence, 0.0, scratch, out);
    const double us = cost_us(chosen, [&](const Pose& pose) {
      (void)environment.closest(pose.arm.view(), influence, 0.0, scratch, out);
    });
    const double self_us = cost_us(
        chosen, [&](const Pose& pose) { (void)self.closest(pose.arm.view(), 0.05, pairs); });
    fmt::print("{:<22} {:>8} {:>15.1f} {:>17.2f} {:>22.0f} {:>21.2f}\n", names[row], chosen.size(),
               static_cast<double>(contacts) / static_cast<double>(chosen.size()), us,
               1e3 * us / static_cast<double>(shapes), self_us);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
