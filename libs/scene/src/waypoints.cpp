#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/so3.hpp"
#include "hamelin/scene/motion.hpp"
#include "rotation.hpp"

namespace hamelin::scene {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// A gap is so many times longer than half of the times between way-points.
constexpr double gap_factor = 10.0;
// Two poses that differ by no more are equal, in metres and radians.
constexpr double same_pose = 1e-9;
// With these bounds, speeds and accelerations are far from overflow.
constexpr double number_max = 1e9, interval_min_s = 1e-6;
// Bounds of a cubic's speed are found on so many halvings of each curve.
constexpr int speed_halvings = 5;

// The slope at a point between two chords: their weighted harmonic mean where they have the same
// sign, else zero. docs/theory.md (11.41)
double slope(double before, double after, double h_before, double h_after) {
  if (!(before * after > 0.0)) return 0.0;
  const double w1 = 2.0 * h_after + h_before, w2 = h_after + 2.0 * h_before;
  return (w1 + w2) / (w1 / before + w2 / after);
}

// Upper bound of the norm of the quadratic with these Bézier points.
double largest_norm(const Vector3d& a, const Vector3d& b, const Vector3d& c, int halvings) {
  if (halvings == 0) return std::max({a.norm(), b.norm(), c.norm()});
  const Vector3d ab = 0.5 * (a + b), bc = 0.5 * (b + c), middle = 0.5 * (ab + bc);
  return std::max(largest_norm(a, ab, middle, halvings - 1),
                  largest_norm(middle, bc, c, halvings - 1));
}

}  // namespace

WaypointPath::WaypointPath(std::vector<Waypoint> waypoints, const Options& options,
                           const std::string& where, std::filesystem::path file)
    : waypoints_(std::move(waypoints)), options_(options), file_(std::move(file)) {
  for (const Waypoint& waypoint : waypoints_)
    rotations_.push_back(rotation_of(waypoint.quaternion_wxyz));
  check(where);
  for (std::size_t i = 0; i + 1 < waypoints_.size(); ++i)
    rates_.push_back(rotations_[i] *
                     geometry::SO3(rotations_[i].transpose() * rotations_[i + 1]).log() /
                     (waypoints_[i + 1].time_s - waypoints_[i].time_s));
  set_tangents();
  set_bounds();
}

void WaypointPath::check(const std::string& where) const {
  const auto fail = [&](std::size_t i, const std::string& what) {
    const int line = waypoints_[i].line;
    throw Error(ErrorCode::invalid, line > 0 ? fmt::format("{}: line {}: {}", where, line, what)
                                             : fmt::format("{}/{}: {}", where, i, what));
  };
  if (waypoints_.size() < 2)
    throw Error(ErrorCode::invalid,
                fmt::format("{}{} way-points, expected two or more",
                            where.ends_with(": ") ? where : where + ": ", waypoints_.size()));
  for (std::size_t i = 0; i < waypoints_.size(); ++i) {
    const Waypoint& w = waypoints_[i];
    const Eigen::Map<const Eigen::Vector4d> wxyz(w.quaternion_wxyz.data());
    const auto in_range = [](const auto& x) { return (x.array().abs() <= number_max).all(); };
    if (!(std::abs(w.time_s) <= number_max) || !in_range(w.position_m) || !in_range(wxyz))
      fail(i, "a number is not finite or too large, expected at most 1e9");
    if (!(std::abs(wxyz.norm() - 1.0) <= 1e-3))
      fail(i, fmt::format("the norm of its quaternion is {:.6g}, expected 1", wxyz.norm()));
    if (i > 0 && !(w.time_s - waypoints_[i - 1].time_s >= interval_min_s))
      fail(i, fmt::format("time_s is {} after {}, expected times that increase by 1e-6 or more",
                          w.time_s, waypoints_[i - 1].time_s));
  }
  const auto same = [&](std::size_t i, std::size_t k) {
    return (waypoints_[i].position_m - waypoints_[k].position_m).norm() <= same_pose &&
           geometry::SO3(rotations_[i].transpose() * rotations_[k]).log().norm() <= 1e-6;
  };
  std::vector<double> times;
  for (std::size_t i = 1; i < waypoints_.size(); ++i)
    times.push_back(waypoints_[i].time_s - waypoints_[i - 1].time_s);
  std::vector<double> sorted = times;
  const auto half = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), half, sorted.end());
  const double gap = options_.gap_max_s.value_or(gap_factor * *half);
  for (std::size_t i = 0; i < times.size(); ++i)
    if (times[i] > gap && !same(i, i + 1))
      fail(i + 1, fmt::format("{:.4g} s after the way-point before, expected at most {:.4g} s "
                              "(gap_max_s) where the pose changes",
                              times[i], gap));
  if (options_.repeat && !same(0, waypoints_.size() - 1))
    fail(waypoints_.size() - 1,
         "its pose is not that of the first way-point, expected the same "
         "for a path that repeats");
}

// docs/theory.md (11.41)
void WaypointPath::set_tangents() {
  const std::size_t n = waypoints_.size();
  tangents_.assign(n, Vector3d::Zero());
  const auto chord = [&](std::size_t i) {
    return Vector3d((waypoints_[i + 1].position_m - waypoints_[i].position_m) /
                    (waypoints_[i + 1].time_s - waypoints_[i].time_s));
  };
  const auto length = [&](std::size_t i) {
    return waypoints_[i + 1].time_s - waypoints_[i].time_s;
  };
  const auto set = [&](std::size_t at, std::size_t before, std::size_t after) {
    const Vector3d b = chord(before), a = chord(after);
    for (int axis = 0; axis < 3; ++axis)
      tangents_[at][axis] = slope(b[axis], a[axis], length(before), length(after));
  };
  for (std::size_t i = 1; i + 1 < n; ++i) set(i, i - 1, i);
  if (!options_.repeat) return;
  set(0, n - 2, 0);
  tangents_[n - 1] = tangents_[0];
}

void WaypointPath::set_bounds() {
  for (std::size_t i = 0; i + 1 < waypoints_.size(); ++i) {
    const double h = waypoints_[i + 1].time_s - waypoints_[i].time_s;
    const Vector3d middle = 3.0 / h * (waypoints_[i + 1].position_m - waypoints_[i].position_m) -
                            tangents_[i] - tangents_[i + 1];
    speed_max_ =
        std::max(speed_max_, largest_norm(tangents_[i], middle, tangents_[i + 1], speed_halvings));
    rate_max_ = std::max(rate_max_, rates_[i].norm());
    // the hull of the curve's Bézier points
    distance_max_ = std::max({distance_max_, waypoints_[i].position_m.norm(),
                              (waypoints_[i].position_m + h / 3.0 * tangents_[i]).norm(),
                              (waypoints_[i + 1].position_m - h / 3.0 * tangents_[i + 1]).norm(),
                              waypoints_[i + 1].position_m.norm()});
  }
}

// docs/theory.md (11.42)
WaypointPath::State WaypointPath::at(double time_s) const {
  const double first = waypoints_.front().time_s, last = waypoints_.back().time_s;
  double t = time_s;
  if (options_.repeat && t > last) t = first + std::fmod(t - first, last - first);
  const auto rest = [&](std::size_t i) {
    return State{waypoints_[i].position_m, Vector3d::Zero(), Vector3d::Zero(), rotations_[i],
                 Vector3d::Zero()};
  };
  if (t < first) return rest(0);
  if (t >= last && !options_.repeat) return rest(waypoints_.size() - 1);
  const auto after =
      std::upper_bound(waypoints_.begin() + 1, waypoints_.end() - 1, t,
                       [](double time, const Waypoint& w) { return time < w.time_s; });
  const auto i = static_cast<std::size_t>(after - waypoints_.begin()) - 1;
  const double h = waypoints_[i + 1].time_s - waypoints_[i].time_s,
               s = (t - waypoints_[i].time_s) / h;
  const Vector3d &p0 = waypoints_[i].position_m, &p1 = waypoints_[i + 1].position_m,
                 m0 = h * tangents_[i], m1 = h * tangents_[i + 1];
  const Vector3d c2 = 3.0 * (p1 - p0) - 2.0 * m0 - m1, c3 = 2.0 * (p0 - p1) + m0 + m1;
  return {p0 + s * (m0 + s * (c2 + s * c3)), (m0 + s * (2.0 * c2 + 3.0 * s * c3)) / h,
          (2.0 * c2 + 6.0 * s * c3) / (h * h),
          geometry::SO3::exp(s * h * rates_[i]).R() * rotations_[i], rates_[i]};
}

}  // namespace hamelin::scene
