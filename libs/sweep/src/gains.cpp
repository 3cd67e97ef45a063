#include "gains.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

// Gain sets model the segment of a link by spheres with this spacing s. At a distance d = 0.25 m
// from the obstacle's centre the nearest sphere is at most s²/8d = 0.02²/(8 · 0.25) m = 0.2 mm
// farther than the segment. The radius is negligible in comparison. docs/theory.md (13.17).
constexpr double segment_spacing_m = 0.02, segment_radius_m = 1e-4;
// Gain sets: on arrival the tip must be slower than this. The README gives the reason.
constexpr double arrival_tip_speed_m_s = 0.05;

// The arm of a scene, with rows of spheres in place of its segments.
model::Robot robot_of_spheres(const fs::path& scene_file) {
  const scene::Scene base = scene::read_scene(scene_file);
  model::Robot robot = description::read_robot(
      base.robot.file, {base.robot.tip, base.robot.spheres, base.robot.srdf});
  for (auto& link : robot.links) {
    if (link.segments.empty())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: link '{}' has no segments, expected at least one for gain sets",
                              base.robot.file.string(), link.name));
    link.spheres.clear();
    for (auto& segment : link.segments) {
      const double length = (segment.to_m - segment.from_m).norm();
      const int parts = std::max(1, static_cast<int>(std::ceil(length / segment_spacing_m - 1e-9)));
      for (int i = 0; i <= parts; ++i) {
        model::Sphere sphere;
        sphere.center_m =
            segment.from_m + (static_cast<double>(i) / parts) * (segment.to_m - segment.from_m);
        sphere.radius_m = std::max(segment.radius_m, segment_radius_m);
        link.spheres.push_back(sphere);
      }
      segment.radius_m = 0.0;  // collisions are those of the row of spheres
    }
  }
  return robot;
}

}  // namespace

Json make_gain_scene(const fs::path& base, const fs::path& folder) {
  const model::Robot robot = robot_of_spheres(base);
  const std::string robot_file = fmt::format("{}_segments.json", robot.name);
  write_file_atomically(folder / robot_file, description::robot_to_json(robot).dump(1) + "\n");
  Json document = read_json(base);
  document["robot"] = {{"file", robot_file}};
  document["gravity_m_s2"] = {0.0, 0.0, 0.0};
  document.erase("planner");
  // half of the sets do not damp the joints, which then keep moving while the tip rests at the
  // goal
  for (auto& goal : document["goals"]) {
    goal.erase("speed_max");
    goal["tip_speed_max_m_s"] = arrival_tip_speed_m_s;
  }
  document["integrator"] = {{"name", "semi-implicit-euler"}};
  document["step_s"] = 0.004;
  document["duration_s"] = 40;
  document["stall"] = {{"speed_m_s", 0.002}, {"distance_m", 0.2}, {"hold_s", 1}};
  return document;
}

void set_gains(PlannedRun& run, const Gains& g) {
  run.gains = {{"k_p", g.k_p},
               {"k_v", g.k_v},
               {"joint_damping", g.joint_damping},
               {"eta", g.eta},
               {"k_obs", g.k_obs}};
  const auto set = [&](const char* name, double value) {
    run.set.push_back(fmt::format("/planner/params/{}={}", name, value));
  };
  // the host's stall rule is for planners without a rule of their own; hybrid does not move while
  // it searches
  if (run.planner == "hybrid") run.set.emplace_back("/stall=null");
  // the gains are those of the law as published
  if (run.planner == "apf" || run.planner == "gyro")
    run.set.emplace_back("/planner/params/algorithm=published");
  set("k_p", g.k_p);
  set("k_v", g.k_v);
  set("joint_damping", g.joint_damping);
  if (run.planner == "apf") set("eta", g.eta);
  if (run.planner == "gyro") set("k_obs", g.k_obs);
}

// docs/theory.md (13.24)
std::vector<Gains> draw_gains(std::size_t count, std::uint64_t seed) {
  Rng rng(seed);
  const auto power = [&](double low, double high) {
    return std::pow(10.0, rng.uniform(low, high));
  };
  std::vector<Gains> sets(count);
  for (auto& g : sets) {
    g.k_p = power(-0.5, 1.5);
    g.k_v = 2.0 * std::sqrt(g.k_p) * power(-0.6, 0.6);
    // both numbers are always drawn: the numbers drawn later do not depend on `damped`
    const bool damped = rng.uniform() >= 0.5;
    const double damping = power(-1.5, 0.5);
    g.joint_damping = damped ? damping : 0.0;
    g.eta = power(-2.0, 1.5);
    g.k_obs = power(-1.0, 2.0);
  }
  return sets;
}

}  // namespace hamelin::sweep
