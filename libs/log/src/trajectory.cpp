#include "hamelin/log/trajectory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "hamelin/core/error.hpp"
#include "hamelin/io/csv.hpp"

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

TickReader::TickReader(const std::filesystem::path& log) : reader_(log) {
  if (!reader_.next(header_) || header_.value("type", Json()) != "header")
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no header, expected a log of hamelin", log.string()));
  check_line(header_, reader_.where());
  for (const auto& joint : header_["joints"]) joints_.push_back(joint["name"].get<std::string>());
}

bool TickReader::next() {
  if (!reader_.next(line_)) return false;
  is_tick_ = line_.value("type", Json()) == "tick";
  if (is_tick_) read_point();
  return true;
}

void TickReader::read_point() {
  check_line(line_, reader_.where());
  Trajectory::Point point{line_["time_s"].get<double>(), vector_of(line_["q"]),
                          vector_of(line_["v"]), vector_of(line_.value("tau", Json::array()))};
  const auto joints = static_cast<Eigen::Index>(joints_.size());
  if (point.q.size() != joints || point.v.size() != joints ||
      (point.tau.size() != 0 && point.tau.size() != joints))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: joint vectors of another length, expected {} numbers",
                            reader_.where(), joints));
  if (any_tick_ && !(point.time_s > point_.time_s))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /time_s: {} s after {} s, expected increasing times",
                            reader_.where(), point.time_s, point_.time_s));
  point_ = std::move(point);
  any_tick_ = true;
}

Trajectory read_trajectory(const std::filesystem::path& log) {
  TickReader reader(log);
  Trajectory trajectory{reader.joints(), {}};
  while (reader.next())
    if (const auto* point = reader.point()) trajectory.points.push_back(*point);
  if (trajectory.points.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no ticks, expected a motion", log.string()));
  return trajectory;
}

long sample_count(double span_s, double rate_hz) {
  if (!std::isfinite(rate_hz) || rate_hz <= 0.0)
    throw Error(ErrorCode::usage, fmt::format("rate {} Hz: expected a positive number", rate_hz));
  if (span_s * rate_hz > 1e8)
    throw Error(ErrorCode::usage,
                fmt::format("rate {} Hz: gives {:.3g} points, expected at most 1e8", rate_hz,
                            span_s * rate_hz));
  return static_cast<long>(std::ceil(span_s * rate_hz - 1e-6));
}

// docs/theory.md (13.42)
Trajectory::Point interpolated(const Trajectory::Point& a, const Trajectory::Point& b,
                               double time_s) {
  const double h = b.time_s - a.time_s, u = (time_s - a.time_s) / h;
  const double u2 = u * u, u3 = u2 * u;
  return {time_s,
          (2 * u3 - 3 * u2 + 1) * a.q + (u3 - 2 * u2 + u) * h * a.v + (3 * u2 - 2 * u3) * b.q +
              (u3 - u2) * h * b.v,
          6 * (u2 - u) / h * (a.q - b.q) + (3 * u2 - 4 * u + 1) * a.v + (3 * u2 - 2 * u) * b.v,
          a.tau};
}

Trajectory resampled(const Trajectory& trajectory, double rate_hz) {
  const auto& points = trajectory.points;
  Trajectory out{trajectory.joints, {}};
  const double begin = points.empty() ? 0.0 : points.front().time_s;
  const long samples = sample_count(points.empty() ? 0.0 : points.back().time_s - begin, rate_hz);
  if (points.empty()) return out;
  std::size_t at = 0;
  for (long i = 0; i < samples; ++i) {
    const double time_s = begin + static_cast<double>(i) / rate_hz;
    while (at + 2 < points.size() && points[at + 1].time_s <= time_s) ++at;
    out.points.push_back(interpolated(points[at], points[at + 1], time_s));
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
