#include <fmt/format.h>

#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/scene.hpp"
#include "read_scene.hpp"
#include "reader.hpp"

namespace hamelin::scene {

namespace {

Goal default_goal(GoalType type) {
  const bool joint = type == GoalType::joint, position = type == GoalType::position;
  Goal goal;
  goal.type = type;
  if (type == GoalType::any_of) return goal;  // its options have them
  goal.tolerance_m = joint ? 0.0 : position ? 0.02 : 0.01;
  goal.tolerance_rad = joint ? 0.05 : position ? 0.0 : type == GoalType::follow ? 0.1 : 0.26;
  goal.speed_max = joint ? 0.05 : std::numeric_limits<double>::infinity();
  return goal;
}

TargetStream read_target_stream(const Reader& in, const std::filesystem::path& folder) {
  TargetStream stream;
  if (const auto file = in.maybe<std::string>("file")) stream.file = resolve_path(folder, *file);
  stream.gap_max_s = in.get("gap_max_s", stream.gap_max_s);
  stream.jump_max_m = in.get("jump_max_m", stream.jump_max_m);
  stream.jump_max_rad = in.get("jump_max_rad", stream.jump_max_rad);
  stream.noise_m = in.get("noise_m", stream.noise_m);
  stream.noise_rad = in.get("noise_rad", stream.noise_rad);
  stream.leash_m = in.get("leash_m", stream.leash_m);
  stream.leash_rad = in.get("leash_rad", stream.leash_rad);
  if (in.get<std::string>("when_lost", "hold") == to_string(WhenLost::end))
    stream.when_lost = WhenLost::end;
  return stream;
}

// A target that moves by the scene has a place, unless its way-points have one.
void read_target(const Reader& in, const std::filesystem::path& folder, Goal& goal) {
  goal.position_only = in.get<std::string>("tracks", "pose") == "position";
  if (in.find("motion") == nullptr) {
    const std::string kind = "follow goal without a motion, whose target is streamed";
    in.refuse("position_m", kind);
    in.refuse("quaternion_wxyz", kind);
    goal.stream = read_target_stream(in.child("stream"), folder);
    return;
  }
  in.refuse("stream", "follow goal with a motion");
  goal.motion = read_motion(in.child("motion"), folder);
  check(*goal.motion, in.place_of("motion"));
  if (std::holds_alternative<WaypointMotion>(*goal.motion)) return;
  in.require("position_m", "follow goal with this motion");
  if (!goal.position_only) in.require("quaternion_wxyz", "follow goal that tracks a pose");
}

GoalType goal_type_of(const std::string& type) {
  if (type == "path" || type == "trajectory") return GoalType::joint;
  for (const GoalType known :
       {GoalType::position, GoalType::pose, GoalType::follow, GoalType::any_of})
    if (type == to_string(known)) return known;
  return GoalType::joint;
}

// One of the paths of a file that `hamelin plan` wrote: way-points as columns.
Eigen::MatrixXd read_path_file(const std::filesystem::path& file, std::size_t index) {
  const Json document = read_json(file);
  check_shipped_schema(document, "path", file.string());
  const Json& paths = document["paths"];
  if (index >= paths.size() || paths[index]["q"].empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /paths/{}: has no way-points, expected a path that was found",
                            file.string(), index));
  return Reader(paths[index], fmt::format("{}: /paths/{}", file.string(), index)).joint_path("q");
}

// The motion of a goal of type trajectory, and its points as a path.
void set_trajectory(Goal& goal, JointTrajectory trajectory) {
  goal.path = trajectory.q;
  goal.q = goal.path.rightCols(1);
  goal.trajectory = std::move(trajectory);
}

void read_trajectory_of(const Reader& in, const std::filesystem::path& folder, Goal& goal) {
  if (in.find("file") == nullptr) {
    in.require("trajectory", "trajectory goal without a file");
    set_trajectory(goal,
                   joint_trajectory_from_json(*in.find("trajectory"), in.place_of("trajectory")));
    return;
  }
  in.refuse("trajectory", "trajectory goal with a file");
  goal.path_file = resolve_path(folder, in.get<std::string>("file", ""));
  set_trajectory(goal, read_joint_trajectory(goal.path_file));
}

// A corner of a box; null: it has no end there.
Eigen::Vector3d read_corner(const Reader& in, const char* key, double end) {
  const Json* given = in.find(key);
  Eigen::Vector3d out = Eigen::Vector3d::Constant(end);
  for (std::size_t i = 0; given != nullptr && i < 3; ++i)
    if (!(*given)[i].is_null()) out[static_cast<Eigen::Index>(i)] = (*given)[i].get<double>();
  return out;
}

TipConstraint read_constraint(const Reader& in) {
  const auto type = in.get<std::string>("type", "");
  const std::string kind = "constraint of type " + type;
  const bool is_axis = type == "axis", is_speed = type == "speed";
  for (const char* key : {"axis", "direction", "angle_rad"})
    if (!is_axis) in.refuse(key, kind);
  for (const char* key : {"position_m", "quaternion_wxyz", "low_m", "high_m"})
    if (is_axis || is_speed) in.refuse(key, kind);
  is_speed ? in.require("speed_m_s", kind) : in.refuse("speed_m_s", kind);
  TipConstraint out;
  if (is_speed) {
    out = SpeedConstraint{in.get("speed_m_s", 0.0)};
  } else if (is_axis) {
    in.require("angle_rad", kind);
    const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
    out =
        AxisConstraint{in.vector("axis", up), in.vector("direction", up), in.get("angle_rad", 0.0)};
  } else {
    out = BoxConstraint{in.pose(), in.quaternion(), read_corner(in, "low_m", -infinity),
                        read_corner(in, "high_m", infinity)};
  }
  check(out, in.place());
  return out;
}

// Which keys a goal may have besides its type, may_touch and constraints.
void check_keys(const Reader& in, const std::string& type) {
  const std::string kind = type + " goal";
  const bool path = type == "path", trajectory = type == "trajectory", follow = type == "follow",
             pose = type == "pose", at_place = pose || type == "position",
             joint = path || trajectory || type == "joint", any_of = type == "any_of";
  const bool from_file = path && in.find("file") != nullptr;
  joint && !from_file && !trajectory ? in.require("q", kind) : in.refuse("q", kind);
  if (at_place) in.require("position_m", kind);
  if (pose) in.require("quaternion_wxyz", kind);
  if (any_of) in.require("any_of", kind);
  for (const auto& [key, allowed] : {std::pair("file", path || trajectory),
                                     {"trajectory", trajectory},
                                     {"index", from_file},
                                     {"any_of", any_of},
                                     {"position_m", at_place || follow},
                                     {"quaternion_wxyz", pose || follow},
                                     {"low_m", at_place},
                                     {"high_m", at_place},
                                     {"free_axis", pose},
                                     {"way", at_place},
                                     {"approach", pose || type == "joint"},
                                     {"retreat", at_place || any_of || type == "joint"},
                                     {"pass", !follow},
                                     {"tracks", follow},
                                     {"motion", follow},
                                     {"stream", follow},
                                     {"tolerance_m", at_place || follow},
                                     {"tolerance_rad", joint || pose || follow},
                                     {"speed_max", joint || at_place},
                                     {"tip_speed_max_m_s", at_place}})
    if (!allowed) in.refuse(key, kind);
}

void read_joints(const Reader& in, const std::string& type, const std::filesystem::path& folder,
                 Goal& goal) {
  if (type == "joint") {
    goal.q = in.joints("q");
  } else if (type == "trajectory") {
    read_trajectory_of(in, folder, goal);
  } else {
    if (const auto file = in.maybe<std::string>("file")) {
      goal.path_file = resolve_path(folder, *file);
      goal.path = read_path_file(goal.path_file, in.get<std::size_t>("index", 0));
    } else {
      goal.path = in.joint_path("q");
    }
    goal.q = goal.path.rightCols(1);
  }
}

void read_place(const Reader& in, Goal& goal) {
  goal.pose = in.pose();
  goal.quaternion_wxyz = in.quaternion();
  goal.low_m = in.vector("low_m", goal.low_m);
  goal.high_m = in.vector("high_m", goal.high_m);
  if (in.find("free_axis") != nullptr)
    goal.free_axis = in.vector("free_axis", Eigen::Vector3d::UnitZ());
  check_region(goal, in.place());
}

WayTolerance read_tolerance(const Reader& in) {
  const WayTolerance usual;
  return {in.get("tolerance_m", usual.m), in.get("tolerance_rad", usual.rad)};
}

std::optional<Stretch> read_stretch(const Reader& in, const Eigen::Vector3d& direction) {
  if (!in.is_given()) return std::nullopt;
  return Stretch{in.vector("direction", direction), in.get<std::string>("frame", "tip") == "world",
                 in.get("distance_m", 0.0), read_tolerance(in)};
}

void read_way(const Reader& in, Goal& goal) {
  if (const Reader way = in.child("way"); way.is_given()) {
    const bool arc = way.get<std::string>("type", "") == "arc";
    arc ? way.require("through_m", "way of type arc") : way.refuse("through_m", "way of type line");
    goal.way = TipWay{{}, read_tolerance(way)};
    if (arc) goal.way->through_m = way.vector("through_m", Eigen::Vector3d::Zero());
  }
  goal.approach = read_stretch(in.child("approach"), Eigen::Vector3d::UnitZ());
  goal.retreat = read_stretch(in.child("retreat"), -Eigen::Vector3d::UnitZ());
  check_way(goal, in.place());
}

void read_options(const Reader& in, Goal& goal);

Goal read_goal(const Reader& in, const std::filesystem::path& folder) {
  const auto type = in.get<std::string>("type", "");
  check_keys(in, type);
  Goal goal = default_goal(goal_type_of(type));
  if (goal.type == GoalType::joint)
    read_joints(in, type, folder, goal);
  else
    read_place(in, goal);
  goal.tolerance_m = in.get("tolerance_m", goal.tolerance_m);
  goal.tolerance_rad = in.get("tolerance_rad", goal.tolerance_rad);
  goal.speed_max = in.get("speed_max", goal.speed_max);
  goal.tip_speed_max_m_s = in.maybe<double>("tip_speed_max_m_s");
  goal.passes = in.get("pass", false);
  if (goal.type == GoalType::follow) read_target(in, folder, goal);
  if (goal.type == GoalType::any_of) read_options(in, goal);
  read_way(in, goal);
  const Reader may_touch = in.child("may_touch");
  goal.may_touch = {read_boxes(may_touch, "boxes_m"),
                    may_touch.get<std::vector<std::string>>("obstacles", {})};
  check(goal.may_touch, in.place_of("may_touch"));
  in.each("constraints",
          [&](const Reader& each) { goal.constraints.push_back(read_constraint(each)); });
  return goal;
}

void read_options(const Reader& in, Goal& goal) {
  in.each("any_of", [&](const Reader& each) {
    const auto type = each.get<std::string>("type", "");
    if (type != "joint" && type != "position" && type != "pose")
      each.fail("type", fmt::format("is {}, expected joint, position or pose in any_of", type));
    for (const char* key : {"may_touch", "constraints", "retreat", "way"})
      each.refuse(key, "goal in any_of");
    goal.any_of.push_back(read_goal(each, {}));
  });
}

}  // namespace

// A target is never reached, so no goal can come after it.
std::vector<Goal> read_goals(const Reader& in, const std::filesystem::path& folder) {
  std::vector<Goal> goals;
  in.each("goals", [&](const Reader& goal) {
    if (!goals.empty() && goals.back().type == GoalType::follow)
      in.fail(fmt::format("goals/{}", goals.size() - 1).c_str(),
              "is a follow goal, which is never reached, expected it as the last goal");
    goals.push_back(read_goal(goal, folder));
  });
  return goals;
}

Goal joint_goal(Eigen::VectorXd q) {
  Goal goal = default_goal(GoalType::joint);
  goal.q = std::move(q);
  return goal;
}

Goal trajectory_goal(JointTrajectory trajectory) {
  check(trajectory, "trajectory");
  Goal goal = default_goal(GoalType::joint);
  set_trajectory(goal, std::move(trajectory));
  return goal;
}

Goal trajectory_goal(const std::filesystem::path& file) {
  Goal goal = trajectory_goal(read_joint_trajectory(file));
  goal.path_file = file;
  return goal;
}

Goal position_goal(const Eigen::Vector3d& position_m) {
  Goal goal = default_goal(GoalType::position);
  goal.pose = {Eigen::Matrix3d::Identity(), position_m};
  return goal;
}

Goal pose_goal(const geometry::SE3& pose) {
  Goal goal = default_goal(GoalType::pose);
  goal.pose = pose;
  return goal;
}

Goal any_of_goal(std::vector<Goal> options) {
  if (options.empty() || options.size() > options_max)
    throw Error(ErrorCode::invalid, fmt::format("any_of: {} goals given, expected 1 to {}",
                                                options.size(), options_max));
  for (const Goal& option : options)
    if (!is_option(option))
      throw Error(ErrorCode::invalid,
                  fmt::format("any_of: has a {} goal, expected joint, position or pose",
                              type_name(option)));
  Goal goal = default_goal(GoalType::any_of);
  goal.any_of = std::move(options);
  return goal;
}

Goal follow_goal(bool position_only, const TargetStream& stream) {
  Goal goal = default_goal(GoalType::follow);
  goal.position_only = position_only;
  goal.stream = stream;
  return goal;
}

}  // namespace hamelin::scene
