// What a judge says of a contact at a node.
#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>

#include "hamelin/core/numbers.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "judge.hpp"

namespace hamelin::simulation {

std::string Judge::describe_contact() const {
  const Plant::Description& plant = plant_.description();
  if (!plant.detects_contacts) return view_->describe_contact();
  std::string judged =
      fmt::format("counts none at a clearance of {:.2g} mm",
                  1e3 * std::min(view_->clearance_m(),
                                 view_->has_self() ? view_->self_clearance_m() : infinity));
  if (touching_)
    judged = view_->describe_contact();
  else if (!on_the_way_.empty())
    judged = on_the_way_;
  return fmt::format("{} {}; the judge: {}", plant.name,
                     contacts_.count > 0 ? plant_.describe_contact() : "counts no contact", judged);
}

std::string Judge::describe_refusal() const {
  std::string cause = describe_contact();
  if (touching_ && view_->clearance_m() > 0.0)
    cause += fmt::format("; {}", scene::self_contact_remedy(scene_.robot));
  return cause;
}

std::optional<log::Result::MoverContact> Judge::mover_contact() const {
  const scene::Contact* const touch = view_->nearest();
  // Between two nodes, contact is found where both of them are still apart.
  constexpr double at_node_m = 1e-3;
  if (touch == nullptr || touch->distance > at_node_m || touch->obstacle < 0) return std::nullopt;
  const auto index = static_cast<std::size_t>(touch->obstacle);
  const scene::Environment& environment = view_->environment();
  const scene::Obstacle& obstacle = environment.obstacles()[index];
  if (!environment.moves(index) && obstacle.appears_s <= 0.0) return std::nullopt;
  const int link = model_.shapes()[static_cast<std::size_t>(touch->sphere)].link;
  const double now = plant_.node().time_s;
  const Eigen::Vector3d arm =
      dynamics::point_velocity(model_, view_->poses(), link, touch->arm_point, plant_.node().v);
  log::Result::MoverContact out;
  out.obstacle = obstacle.name;
  out.link = model_.robot().links[static_cast<std::size_t>(link)].name;
  out.prediction = scene::to_string(obstacle.prediction);
  out.time_s = now;
  out.arm_speed_m_s = arm.norm();
  out.obstacle_speed_m_s = touch->obstacle_velocity.norm();
  out.closing_speed_m_s = touch->direction.dot(touch->obstacle_velocity - arm);
  const Eigen::Vector3d at = scene::motion_at(obstacle, now).pose.p();
  for (const double ahead : {0.1, 0.3, 1.0}) {
    if (ahead > now || !scene::exists(obstacle, now - ahead)) continue;
    const scene::Placed predicted = scene::placed_at(obstacle, {now - ahead, ahead});
    out.prediction_errors.push_back(
        {ahead, std::max(0.0, (predicted.pose.p() - at).norm() - predicted.nearer_m)});
  }
  return out;
}

void Judge::count_contacts(log::Result& result) const {
  const Plant::Description& plant = plant_.description();
  if (!plant.detects_contacts) return;
  if (!result.plant) result.plant = {plant.type, plant.version, 0, 0, {}};
  if (touching_ || !on_the_way_.empty()) ++result.plant->judge_contacts;
  if (contacts_.count == 0) return;
  ++result.plant->contacts;
  result.plant->deepest_m =
      std::min(result.plant->deepest_m.value_or(contacts_.deepest_m), contacts_.deepest_m);
}

}  // namespace hamelin::simulation
