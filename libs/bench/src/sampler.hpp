#pragma once
#include <Eigen/Core>
#include <functional>
#include <optional>

#include "hamelin/bench/draw.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::bench {

/// Rounds to multiples of 0.1 mrad.
[[nodiscard]] Eigen::VectorXd rounded_joints(const Eigen::VectorXd& q);

/// Draws configurations uniformly within the limits of the joints.
class Sampler {
 public:
  /// @param options kept by reference
  Sampler(const model::Model& model, const DrawOptions& options, std::uint64_t seed)
      : model_(model), ws_(model), options_(options), rng_(seed) {}

  /// The first one that is accepted and keeps the clearances; none if `max_draws` were not enough.
  /// @param accepts is given the kinematics
  [[nodiscard]] std::optional<Eigen::VectorXd> draw(
      control::WorldView& view, const std::function<bool(const dynamics::Workspace&)>& accepts);

 private:
  [[nodiscard]] bool is_clear(const Eigen::VectorXd& q, control::WorldView& view) const;
  [[nodiscard]] Eigen::VectorXd draw_uniform();

  const model::Model& model_;
  dynamics::Workspace ws_;
  const DrawOptions& options_;
  Rng rng_;
};

}  // namespace hamelin::bench
