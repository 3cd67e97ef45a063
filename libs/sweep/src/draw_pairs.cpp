#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/sweep/pairs.hpp"

namespace hamelin::sweep {

namespace {

using Eigen::VectorXd;

/// Draws uniform configurations of the scene's arm and checks whether they are clear.
class Sampler {
 public:
  Sampler(const scene::Scene& scene, const PairOptions& options)
      : model_(control::load_model(scene)),
        ws_(model_),
        environment_(scene::make_environment(scene, model_, options.min_clearance_m)),
        min_clearance_(options.min_clearance_m),
        rng_(options.seed),
        lower_(model_.dof()),
        upper_(model_.dof()),
        arm_(model_) {
    if (scene.model.self_collision) self_.emplace(model_);
    if (environment_.has_obstacles() && model_.shapes().empty())
      throw Error(
          ErrorCode::invalid,
          fmt::format(
              "{}: /robot: '{}' has no collision spheres or capsules, expected at least one "
              "in a scene with obstacles",
              scene.name, model_.robot().name));
    for (int i = 0; i < model_.dof(); ++i) {
      const auto& joint = model_.robot().links[static_cast<std::size_t>(i)].joint;
      if (!joint.lower || !joint.upper)
        throw Error(ErrorCode::invalid, fmt::format("{}: /robot: joint '{}' has no position "
                                                    "limits, expected a lower and an upper limit",
                                                    scene.name, joint.name));
      lower_[i] = *joint.lower;
      upper_[i] = *joint.upper;
    }
  }

  // docs/theory.md (13.25)
  void draw(VectorXd& q) {
    q.resize(lower_.size());
    for (Eigen::Index i = 0; i < q.size(); ++i) q[i] = rng_.uniform(lower_[i], upper_[i]);
  }

  [[nodiscard]] bool clear(const VectorXd& q) {
    dynamics::forward_kinematics(model_, ws_, q);
    arm_.place(model_, ws_);
    return environment_.clearance(arm_.view(), 0.0, min_clearance_) >= min_clearance_ &&
           free_of_self_contact();
  }

 private:
  [[nodiscard]] bool free_of_self_contact() const {
    for (std::size_t pair = 0; self_ && pair < self_->pairs().size(); ++pair)
      if (self_->distance(pair, arm_.view(), min_clearance_) <= 0.0) return false;
    return true;
  }

  model::Model model_;
  dynamics::Workspace ws_;
  scene::Environment environment_;
  std::optional<scene::SelfField> self_;  ///< if the scene models self-collision
  double min_clearance_;
  Rng rng_;
  VectorXd lower_, upper_;
  scene::PlacedShapes arm_;
};

void check(const PairOptions& options) {
  if (options.count == 0) throw Error(ErrorCode::usage, "0 pairs requested, expected at least 1");
  if (!(options.min_clearance_m > 0.0 && std::isfinite(options.min_clearance_m)))
    throw Error(ErrorCode::usage, fmt::format("smallest clearance {} m, expected a positive number",
                                              options.min_clearance_m));
  if (!(options.min_distance_rad >= 0.0 && std::isfinite(options.min_distance_rad)))
    throw Error(ErrorCode::usage,
                fmt::format("smallest distance {} rad, expected 0 or a positive number",
                            options.min_distance_rad));
}

}  // namespace

DrawnPairs draw_pairs(const scene::Scene& scene, const PairOptions& options) {
  check(options);
  Sampler sampler(scene, options);
  DrawnPairs drawn;
  Pair pair;
  bool have_start = false;
  while (drawn.pairs.size() < options.count) {
    if (drawn.draws == options.max_draws)
      throw Error(
          ErrorCode::invalid,
          fmt::format("{}: only {} of {} pairs found in {} draws, {} of them nearer than {} m to "
                      "something, {} goals "
                      "nearer than {} rad to their start; expected enough free space for all pairs",
                      scene.name, drawn.pairs.size(), options.count, drawn.draws, drawn.near_draws,
                      options.min_clearance_m, drawn.close_goals, options.min_distance_rad));
    VectorXd& q = have_start ? pair.goal : pair.start;
    sampler.draw(q);
    ++drawn.draws;
    if (!sampler.clear(q)) {
      ++drawn.near_draws;
    } else if (!have_start) {
      have_start = true;
    } else if ((pair.goal - pair.start).norm() < options.min_distance_rad) {
      ++drawn.close_goals;
    } else {
      drawn.pairs.push_back(pair);
      have_start = false;
    }
  }
  return drawn;
}

}  // namespace hamelin::sweep
