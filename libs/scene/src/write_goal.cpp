#include <cmath>

#include "hamelin/scene/scene.hpp"
#include "writer.hpp"

namespace hamelin::scene {

namespace {

Json follow_json(const Goal& goal) {
  Json out{{"type", type_name(goal)},
           {"tracks", goal.position_only ? "position" : "pose"},
           {"tolerance_m", goal.tolerance_m},
           {"tolerance_rad", goal.tolerance_rad}};
  if (goal.motion) {
    out.update(pose_json(goal.pose, goal.quaternion_wxyz));
    out["motion"] = motion_json(*goal.motion);
    return out;
  }
  const TargetStream& stream = goal.stream;
  out["stream"] = {{"file", stream.file.empty() ? Json(nullptr) : Json(stream.file.string())},
                   {"gap_max_s", stream.gap_max_s},
                   {"jump_max_m", stream.jump_max_m},
                   {"jump_max_rad", stream.jump_max_rad},
                   {"noise_m", stream.noise_m},
                   {"noise_rad", stream.noise_rad},
                   {"leash_m", stream.leash_m},
                   {"leash_rad", stream.leash_rad},
                   {"when_lost", to_string(stream.when_lost)}};
  return out;
}

Json stretch_json(const std::optional<Stretch>& stretch) {
  if (!stretch) return nullptr;
  return {{"direction", array(stretch->direction)},
          {"frame", stretch->in_world ? "world" : "tip"},
          {"distance_m", stretch->distance_m},
          {"tolerance_m", stretch->tolerance.m},
          {"tolerance_rad", stretch->tolerance.rad}};
}

Json way_json(const std::optional<TipWay>& way) {
  if (!way) return nullptr;
  Json out{{"type", way->through_m ? "arc" : "line"},
           {"tolerance_m", way->tolerance.m},
           {"tolerance_rad", way->tolerance.rad}};
  if (way->through_m) out["through_m"] = array(*way->through_m);
  return out;
}

Json goal_to_reach_json(const Goal& goal) {
  Json out{{"type", type_name(goal)}};
  if (goal.trajectory) {
    out["trajectory"] = to_json(*goal.trajectory);
  } else if (goal.path.size() > 0) {
    out["q"] = Json::array();
    for (Eigen::Index i = 0; i < goal.path.cols(); ++i) out["q"].push_back(array(goal.path.col(i)));
  } else if (goal.type == GoalType::joint) {
    out["q"] = array(goal.q);
  } else {
    out["position_m"] = array(goal.pose.p());
    if (goal.type == GoalType::pose)
      out["quaternion_wxyz"] = quaternion_json(goal.pose.R(), goal.quaternion_wxyz);
    out["tolerance_m"] = goal.tolerance_m;
    if (goal.free_axis) out["free_axis"] = array(*goal.free_axis);
    if (goal.low_m != goal.high_m) {
      out["low_m"] = array(goal.low_m);
      out["high_m"] = array(goal.high_m);
    }
  }
  if (goal.approach) out["approach"] = stretch_json(goal.approach);
  if (goal.way) out["way"] = way_json(goal.way);
  if (goal.type != GoalType::position) out["tolerance_rad"] = goal.tolerance_rad;
  out["speed_max"] = std::isfinite(goal.speed_max) ? Json(goal.speed_max) : Json(nullptr);
  if (goal.type != GoalType::joint) out["tip_speed_max_m_s"] = or_null(goal.tip_speed_max_m_s);
  return out;
}

Json any_of_json(const Goal& goal) {
  Json out{{"type", type_name(goal)}, {"any_of", Json::array()}};
  for (const Goal& option : goal.any_of) out["any_of"].push_back(goal_to_reach_json(option));
  return out;
}

}  // namespace

Json goal_json(const Goal& goal) {
  Json out = goal.type == GoalType::follow   ? follow_json(goal)
             : goal.type == GoalType::any_of ? any_of_json(goal)
                                             : goal_to_reach_json(goal);
  out["may_touch"] = to_json(goal.may_touch);
  if (goal.passes) out["pass"] = true;
  if (goal.retreat) out["retreat"] = stretch_json(goal.retreat);
  out["constraints"] = Json::array();
  for (const TipConstraint& constraint : goal.constraints)
    out["constraints"].push_back(to_json(constraint));
  return out;
}

}  // namespace hamelin::scene
