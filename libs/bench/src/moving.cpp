#include "hamelin/bench/moving.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "hamelin/core/error.hpp"
#include "movers.hpp"

namespace hamelin::bench {

using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

constexpr double grains_per_m = 1e4;
constexpr double sample_s = 0.05;  // between two checks of an obstacle that must stay clear

struct MovingFamily {
  const char *name, *description;
  double duration_s;
  MakeMovers* make;
  std::vector<std::size_t> obstacles;
  std::vector<double> speeds_m_s;
};

const std::vector<MovingFamily>& moving_family_list() {
  static const std::vector<MovingFamily> list{
      {"cubes",
       "cubes on straight lines, which turn at the borders of the workspace",
       10.0,
       &make_cubes,
       {0, 10, 20, 50},
       {0.4, 0.8, 1.6}},
      {"people",
       "people whose hands reach into the way of the arm",
       20.0,
       &make_people,
       {1, 2},
       {0.25, 0.5, 1.0}},
      {"pendulums",
       "spheres and boxes that swing beside the way of the arm",
       20.0,
       &make_pendulums,
       {2, 4, 8},
       {0.3, 0.6, 1.2}},
  };
  return list;
}

const MovingFamily& moving_family(std::string_view name) {
  const auto found = std::find_if(moving_family_list().begin(), moving_family_list().end(),
                                  [&](const MovingFamily& f) { return f.name == name; });
  if (found == moving_family_list().end())
    throw Error(ErrorCode::usage, fmt::format("family '{}' is not known, expected one of {}", name,
                                              fmt::join(moving_families(), ", ")));
  return *found;
}

scene::Obstacle ground() {
  scene::Obstacle o;
  o.name = "ground";
  o.shape = scene::Shape::box;
  o.size_m = {1.5, 1.5, 0.1};
  o.pose = {Eigen::Matrix3d::Identity(), {0.0, 0.0, -0.05}};
  return o;
}

}  // namespace

const std::vector<std::string>& moving_families() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto& family : moving_family_list()) list.emplace_back(family.name);
    return list;
  }();
  return names;
}

bool is_moving(std::string_view family) {
  const auto& names = moving_families();
  return std::find(names.begin(), names.end(), family) != names.end();
}

std::string_view describe_movers(std::string_view family) {
  return moving_family(family).description;
}

std::vector<Cell> cells(std::string_view family) {
  const MovingFamily& f = moving_family(family);
  std::vector<Cell> out;
  for (const std::size_t count : f.obstacles)
    for (const double speed : f.speeds_m_s) {
      // Without obstacles, no speed is of interest.
      if (count == 0 && speed != f.speeds_m_s.front()) continue;
      out.push_back({f.name, count, count == 0 ? 0.0 : speed});
    }
  return out;
}

double duration_s(std::string_view family) {
  return moving_family(family).duration_s;
}

std::vector<scene::Obstacle> make_movers(const Cell& cell, std::uint64_t seed,
                                         const sweep::JudgedArm& arm, const MatrixXd& ends) {
  const MovingFamily& family = moving_family(cell.family);
  Rng rng(seed);
  std::vector<scene::Obstacle> all{ground()};
  const auto movers =
      family.make(rng, ArmWay(arm, ends), {cell.obstacles, cell.speed_max_m_s, family.duration_s});
  all.insert(all.end(), movers.begin(), movers.end());
  return all;
}

double rounded_m(double x) {
  return std::round(x * grains_per_m) / grains_per_m;
}

Vector3d rounded_m(const Vector3d& p) {
  return p.unaryExpr([](double x) { return rounded_m(x); });
}

Vector3d random_direction(Rng& rng) {
  const double x = rng.uniform(-1.0, 1.0), y = rng.uniform(-1.0, 1.0), z = rng.uniform(-1.0, 1.0);
  return Vector3d(x, y, z).normalized();
}

std::vector<scene::Obstacle> draw_accepted(
    const char* what, const std::function<std::optional<std::vector<scene::Obstacle>>()>& draw) {
  constexpr int draws_max = 2000;
  for (int i = 0; i < draws_max; ++i)
    if (auto drawn = draw()) return std::move(*drawn);
  throw Error(ErrorCode::invalid,
              fmt::format("{}: none of {} draws is clear of start and goal, expected one", what,
                          draws_max));
}

ArmWay::ArmWay(const sweep::JudgedArm& arm, const MatrixXd& ends) : arm_(arm), ends_(ends) {
  arm_.place(ends_.leftCols(1), at_start_);
  arm_.place(ends_.rightCols(1), at_goal_);
  constexpr int outer_links = 3;
  for (std::size_t i = 0; i < arm_.balls().size(); ++i)
    if (arm_.balls()[i].link >= static_cast<int>(arm_.dof()) - outer_links)
      outer_balls_.push_back(i);
  if (outer_balls_.empty())
    throw Error(ErrorCode::invalid,
                "the last three links of the robot have no collision shapes, expected some");
}

double ArmWay::clearance_m(const std::vector<Vector3d>& centers, const scene::Obstacle& obstacle,
                           double time_s) const {
  const geometry::SE3 pose = scene::motion_at(obstacle, time_s).pose;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < centers.size(); ++i) {
    const auto& ball = arm_.balls()[i];
    if (ball.link < 0) continue;
    least = std::min(least, sweep::distance_from(obstacle, pose, centers[i]) - ball.radius);
  }
  return least;
}

double ArmWay::start_clearance_m(const scene::Obstacle& obstacle, double time_s) const {
  return clearance_m(at_start_, obstacle, time_s);
}

double ArmWay::goal_clearance_m(const scene::Obstacle& obstacle, double time_s) const {
  return clearance_m(at_goal_, obstacle, time_s);
}

bool ArmWay::stays_clear(const scene::Obstacle& obstacle, double until_s, double least_m) const {
  const auto samples = static_cast<int>(std::ceil(until_s / sample_s));
  for (int i = 0; i <= samples; ++i)
    for (const auto* centers : {&at_start_, &at_goal_})
      if (clearance_m(*centers, obstacle, i * sample_s) < least_m) return false;
  return true;
}

Vector3d ArmWay::point(Rng& rng, double first_share, double last_share) const {
  const double share = rng.uniform(first_share, last_share);
  const std::size_t ball = outer_balls_[rng.below(outer_balls_.size())];
  const Eigen::VectorXd q = (1.0 - share) * ends_.leftCols(1) + share * ends_.rightCols(1);
  std::vector<Vector3d> centers;
  arm_.place(q, centers);
  return centers[ball];
}

}  // namespace hamelin::bench
