#include "hamelin/bench/moving_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/io/file.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"
#include "moving_results.hpp"
#include "problem_files.hpp"

namespace hamelin::bench {

namespace fs = std::filesystem;

namespace {

using Obstacles = std::vector<scene::Obstacle>;

Json movement_json(const scene::Motion& motion) {
  if (const auto* sine = std::get_if<scene::SineMotion>(&motion))
    return {
        {"type", "sine"}, {"amplitude_m", list(sine->amplitude_m)}, {"period_s", sine->period_s}};
  const scene::WaypointPath& path = *std::get<scene::WaypointMotion>(motion).path;
  const scene::Quaternion unturned{1.0, 0.0, 0.0, 0.0};
  Json points = Json::array();
  for (const auto& w : path.waypoints()) {
    Json point{{"time_s", w.time_s}, {"position_m", list(w.position_m)}};
    if (w.quaternion_wxyz != unturned) point["quaternion_wxyz"] = w.quaternion_wxyz;
    points.push_back(std::move(point));
  }
  Json out{{"type", "waypoints"},
           {"gap_max_s", path.options().gap_max_s.value()},
           {"waypoints", std::move(points)}};
  if (path.options().repeat) out["repeat"] = true;
  return out;
}

Json mover_json(const scene::Obstacle& o, double speed_bound_m_s) {
  Json out{{"name", o.name}, {"type", to_string(o.shape)}, {"position_m", list(o.pose.p())}};
  if (o.shape == scene::Shape::box)
    out["size_m"] = list(o.size_m);
  else
    out["radius_m"] = o.radius_m;
  if (o.shape == scene::Shape::capsule) out["length_m"] = o.length_m;
  if (!o.motion) return out;
  out["motion"] = movement_json(*o.motion);
  if (o.prediction == scene::Prediction::speed_bound)
    out["prediction"] = {{"speed_max", speed_bound_m_s}};
  else
    out["prediction"] = to_string(o.prediction);
  return out;
}

// One bound for all obstacles: of the fastest one. It bounds the curves, not only samples of them.
double speed_bound_m_s(const Obstacles& obstacles) {
  double most = 0.0;
  for (const auto& o : obstacles)
    if (o.motion) most = std::max(most, scene::max_speed(o));
  constexpr double grain = 100.0;
  return std::ceil(1.01 * grain * most) / grain;
}

// A drive as that of the published benchmark limits it. The gains and the rotors are hamelin's.
Json actuation_json() {
  return {{"type", "position"},
          {"servo", {{"kp", 4000}, {"kv", 80}, {"acceleration_max", 20}, {"jerk_max", 500}}}};
}

Json head_json(const Problem& problem) {
  return {{"schema", "hamelin.scene/1"},
          {"gravity_m_s2", {0, 0, -9.81}},
          {"start", {{"q", list(problem.path.leftCols(1))}}},
          {"goals", Json::array({{{"type", "joint"}, {"q", list(problem.path.rightCols(1))}}})},
          {"model", {{"self_collision", true}, {"armature", 0.2}}},
          {"actuation", actuation_json()},
          {"planner", {{"name", "hybrid"}}},
          {"integrator", {{"name", "hamel-variational"}}},
          {"step_s", 0.001},
          {"duration_s", duration_s(problem.family)},
          {"seed", 1}};
}

// One line per obstacle: paths have hundreds of way-points.
std::string scene_text(const Json& head, const Obstacles& obstacles) {
  const double bound = speed_bound_m_s(obstacles);
  std::string text = head.dump(1);
  text.erase(text.rfind('\n'));
  text += ",\n \"obstacles\": [";
  for (std::size_t i = 0; i < obstacles.size(); ++i)
    text += (i > 0 ? ",\n  " : "\n  ") + mover_json(obstacles[i], bound).dump();
  return text + "\n ]\n}\n";
}

Obstacles obstacles_of(const Problem& problem, const sweep::JudgedArm& arm) {
  return make_movers({problem.family, problem.obstacles, problem.speed_max_m_s}, problem.seed, arm,
                     problem.path);
}

Json robot_files_json(const RobotFiles& robot, const fs::path& directory) {
  Json out{{"file", fs::proximate(robot.robot, directory).generic_string()}};
  if (!robot.spheres.empty())
    out["spheres"] = fs::proximate(robot.spheres, directory).generic_string();
  if (!robot.tip.empty()) out["tip"] = robot.tip;
  return out;
}

void set_prediction(Obstacles& obstacles, const PredictionChoice& choice) {
  if (!choice) return;
  for (auto& o : obstacles)
    if (o.motion) o.prediction = *choice;
}

}  // namespace

sweep::JudgedArm judged_arm(const RobotFiles& robot) {
  const Json document{{"schema", "hamelin.scene/1"}, {"robot", robot_files_json(robot, ".")}};
  return sweep::JudgedArm(scene::scene_from_json(document, ".", robot.robot.string()));
}

std::string moving_problem_text(const Problem& problem, const sweep::JudgedArm& arm) {
  return scene_text(head_json(problem), obstacles_of(problem, arm));
}

std::string describe(const PredictionChoice& choice) {
  return choice ? std::string(to_string(*choice)) : "drawn";
}

std::map<std::string, std::string> labels(const Problem& problem, const PredictionChoice& choice) {
  return {{"family", problem.family},
          {"problem", problem.name},
          {obstacles_label, fmt::format("{}", problem.obstacles)},
          {speed_label, fmt::format("{}", problem.speed_max_m_s)},
          {prediction_label, describe(choice)}};
}

std::vector<fs::path> write_moving_scenes(const ProblemSet& set,
                                          const std::vector<Problem>& problems,
                                          const std::vector<PredictionChoice>& predictions,
                                          const fs::path& directory, const std::string& where) {
  const sweep::JudgedArm arm = judged_arm(set.robot);
  std::vector<Obstacles> drawn;
  for (const auto& problem : problems) {
    drawn.push_back(obstacles_of(problem, arm));
    check_made(problem, scene_text(head_json(problem), drawn.back()), where);
  }
  make_directory(directory);
  std::vector<fs::path> files;
  for (const auto& choice : predictions)
    for (std::size_t i = 0; i < problems.size(); ++i) {
      Obstacles obstacles = drawn[i];
      set_prediction(obstacles, choice);
      Json head = head_json(problems[i]);
      head["robot"] = robot_files_json(set.robot, directory);
      const std::string kind = choice ? fmt::format("-{}", to_string(*choice)) : "";
      files.push_back(directory / fmt::format("{}{}.json", problems[i].name, kind));
      write_file_atomically(files.back(), scene_text(head, obstacles));
    }
  return files;
}

}  // namespace hamelin::bench
