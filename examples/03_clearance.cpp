// How near an arm is to the boards of a shelf, and where.
#include <fmt/core.h>

#include <algorithm>
#include <hamelin/control/preparation.hpp>
#include <hamelin/control/world_view.hpp>

int main() {
  using namespace hamelin;
  const scene::Scene scene = scene::read_scene("data/scenes/shelf.json");
  const model::Model arm = control::load_model(scene);
  control::WorldView world(scene, arm, 0.5);  // contacts up to 0.5 m
  for (int step = 0; step <= 4; ++step) {
    const Eigen::VectorXd q = scene.start_q + Eigen::VectorXd::Constant(7, 0.1 * step);
    world.look(q, 0.0);
    const auto contacts = world.contacts();
    const auto near =
        std::min_element(contacts.begin(), contacts.end(),
                         [](const auto& a, const auto& b) { return a.distance < b.distance; });
    fmt::print("{:.1f} rad: {:.6f} m, at height {:.3f} m\n", 0.1 * step, near->distance,
               near->obstacle_point.z());
  }
}
