#include "sampler.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"

namespace hamelin::bench {

using Eigen::VectorXd;

VectorXd rounded_joints(const VectorXd& q) {
  constexpr double grains_per_rad = 1e4;
  return (q * grains_per_rad).array().round() / grains_per_rad;
}

std::optional<VectorXd> Sampler::draw(
    control::WorldView& view, const std::function<bool(const dynamics::Workspace&)>& accepts) {
  for (std::size_t i = 0; i < options_.max_draws; ++i) {
    const VectorXd q = draw_uniform();
    dynamics::forward_kinematics(model_, ws_, q);
    if (accepts(ws_) && is_clear(q, view)) return q;
  }
  return std::nullopt;
}

bool Sampler::is_clear(const VectorXd& q, control::WorldView& view) const {
  view.look(q, 0.0);
  return view.clearance_m() >= options_.clearance_m &&
         view.self_clearance_m() >= options_.self_clearance_m;
}

VectorXd Sampler::draw_uniform() {
  VectorXd q(model_.dof());
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const auto& joint = model_.robot().links[static_cast<std::size_t>(i)].joint;
    if (!joint.lower || !joint.upper)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: joint '{}' has no position limits, expected a lower and an "
                              "upper limit",
                              options_.robot.robot.string(), joint.name));
    q[i] = rng_.uniform(*joint.lower + options_.joint_margin_rad,
                        *joint.upper - options_.joint_margin_rad);
  }
  return rounded_joints(q);
}

}  // namespace hamelin::bench
