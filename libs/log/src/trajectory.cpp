#include "hamelin/log/trajectory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "hamelin/core/error.hpp"
#include "hamelin/io/csv.hpp"
#include "hamelin/log/read_log.hpp"

namespace hamelin::log {

namespace {

using Eigen::VectorXd;

VectorXd vector_of(const Json& numbers) {
  VectorXd x(static_cast<Eigen::Index>(numbers.size()));
  for (std::size_t i = 0; i < numbers.size(); ++i)
    x[static_cast<Eigen::Index>(i)] =
        numbers[i].is_null() ? std::numeric_limits<double>::quiet_NaN() : numbers[i].get<double>();
  return x;
}

void append_numbers(std::string& row, const VectorXd& x) {
  for (const double number : x) row += std::isfinite(number) ? fmt::format(",{}", number) : ",";
}

// Whole seconds and the remaining nanoseconds.
Json duration(double time_s) {
  double seconds = std::floor(time_s);
  double nanoseconds = std::round((time_s - seconds) * 1e9);
  if (nanoseconds >= 1e9) {
    seconds += 1.0;
    nanoseconds = 0.0;
  }
  return {{"sec", static_cast<std::int64_t>(seconds)},
          {"nanosec", static_cast<std::int64_t>(nanoseconds)}};
}

Json finite_array(const VectorXd& x, double time_s, const char* what) {
  Json array = Json::array();
  for (const double number : x) {
    if (!std::isfinite(number))
      throw Error(
          ErrorCode::invalid,
          fmt::format(
              "{} at {} s: is not finite, expected finite numbers; CSV leaves such cells empty",
              what, time_s));
    array.push_back(number);
  }
  return array;
}

}  // namespace

Trajectory read_trajectory(const std::filesystem::path& log) {
  LogReader reader(log);
  Trajectory trajectory;
  Json line;
  if (!reader.next(line) || line.value("type", Json()) != "header")
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no header, expected a log of hamelin", log.string()));
  check_line(line, reader.where());
  for (const auto& joint : line["joints"])
    trajectory.joints.push_back(joint["name"].get<std::string>());
  const auto joints = static_cast<Eigen::Index>(trajectory.joints.size());
  while (reader.next(line)) {
    if (line.value("type", Json()) != "tick") continue;
    check_line(line, reader.where());
    Trajectory::Point point{line["time_s"].get<double>(), vector_of(line["q"]),
                            vector_of(line["v"]), vector_of(line.value("tau", Json::array()))};
    if (point.q.size() != joints || point.v.size() != joints ||
        (point.tau.size() != 0 && point.tau.size() != joints))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: joint vectors of another length, expected {} numbers",
                              reader.where(), joints));
    if (!trajectory.points.empty() && !(point.time_s > trajectory.points.back().time_s))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: /time_s: {} s after {} s, expected increasing times",
                              reader.where(), point.time_s, trajectory.points.back().time_s));
    trajectory.points.push_back(std::move(point));
  }
  if (trajectory.points.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no ticks, expected a motion", log.string()));
  return trajectory;
}

Trajectory resampled(const Trajectory& trajectory, double rate_hz) {
  if (!std::isfinite(rate_hz) || rate_hz <= 0.0)
    throw Error(ErrorCode::usage, fmt::format("rate {} Hz: expected a positive number", rate_hz));
  const auto& points = trajectory.points;
  Trajectory out{trajectory.joints, {}};
  if (points.empty()) return out;
  const double begin = points.front().time_s, span = points.back().time_s - begin;
  if (span * rate_hz > 1e8)
    throw Error(ErrorCode::usage,
                fmt::format("rate {} Hz: gives {:.3g} points, expected at most 1e8", rate_hz,
                            span * rate_hz));
  // A sample that equals the last point up to rounding is the last point.
  const auto sample_count = static_cast<long>(std::ceil(span * rate_hz - 1e-6));
  std::size_t at = 0;
  for (long i = 0; i < sample_count; ++i) {
    const double time_s = begin + static_cast<double>(i) / rate_hz;
    while (at + 2 < points.size() && points[at + 1].time_s <= time_s) ++at;
    const auto &a = points[at], &b = points[at + 1];
    // docs/theory.md (13.42)
    const double h = b.time_s - a.time_s, u = (time_s - a.time_s) / h;
    const double u2 = u * u, u3 = u2 * u;
    out.points.push_back(
        {time_s,
         (2 * u3 - 3 * u2 + 1) * a.q + (u3 - 2 * u2 + u) * h * a.v + (3 * u2 - 2 * u3) * b.q +
             (u3 - u2) * h * b.v,
         6 * (u2 - u) / h * (a.q - b.q) + (3 * u2 - 4 * u + 1) * a.v + (3 * u2 - 2 * u) * b.v,
         a.tau});
  }
  out.points.push_back(points.back());
  return out;
}

std::string to_csv(const Trajectory& trajectory) {
  using Point = Trajectory::Point;
  const auto known = [&](VectorXd Point::*column) {
    return std::any_of(trajectory.points.begin(), trajectory.points.end(),
                       [&](const Point& point) { return (point.*column).size() > 0; });
  };
  std::string text = "time_s";
  for (const auto& [column, kind] :
       {std::pair(&Point::q, "q_"), {&Point::v, "v_"}, {&Point::tau, "tau_"}, {&Point::a, "a_"}}) {
    if (!known(column)) continue;
    for (const auto& joint : trajectory.joints)
      text += fmt::format(",{}", csv_field(fmt::format("{}{}", kind, joint)));
  }
  text += '\n';
  for (const auto& point : trajectory.points) {
    text += fmt::format("{}", point.time_s);
    append_numbers(text, point.q);
    append_numbers(text, point.v);
    append_numbers(text, point.tau);
    append_numbers(text, point.a);
    text += '\n';
  }
  return text;
}

Json to_joint_trajectory(const Trajectory& trajectory) {
  Json points = Json::array();
  const double begin = trajectory.points.empty() ? 0.0 : trajectory.points.front().time_s;
  for (const auto& point : trajectory.points)
    points.push_back({{"positions", finite_array(point.q, point.time_s, "q")},
                      {"velocities", finite_array(point.v, point.time_s, "v")},
                      {"accelerations", finite_array(point.a, point.time_s, "a")},
                      {"effort", finite_array(point.tau, point.time_s, "tau")},
                      {"time_from_start", duration(point.time_s - begin)}});
  return {{"header", {{"stamp", {{"sec", 0}, {"nanosec", 0}}}, {"frame_id", ""}}},
          {"joint_names", trajectory.joints},
          {"points", points}};
}

}  // namespace hamelin::log
