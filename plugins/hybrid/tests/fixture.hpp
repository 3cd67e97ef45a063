#pragma once
#include "../src/roots.hpp"
#include "../src/tree.hpp"
#include "../src/vias.hpp"
#include "hamelin/test/reactive_scene.hpp"

namespace hamelin::test {

/// The parts of the hybrid planner with the host that they query.
class Scene : public ReactiveScene {
 public:
  explicit Scene(const Task& task)
      : ReactiveScene(task),
        box(setup, Eigen::VectorXd::Ones(model.dof())),
        roots(setup, model, law_params, box, surroundings) {}

  [[nodiscard]] hybrid::Tree tree(int budget) {
    return {setup, rollout, roots, box, margins, surroundings, budget};
  }
  [[nodiscard]] hybrid::Vias vias() { return {setup, rollout, roots, box}; }
  using ReactiveScene::clearance;
  /// The smallest distance along the straight lines of a path, checked every `step`.
  double clearance(const hybrid::JointPath& path, double step) {
    double least = std::numeric_limits<double>::infinity();
    Eigen::VectorXd q(model.dof());
    for (double s = 0.0; s < path.length() + step; s += step) {
      path.at(s, q);
      least = std::min(least, clearance(q));
    }
    return least;
  }

  hybrid::JointBox box;
  hybrid::Roots roots;
};

}  // namespace hamelin::test
