#include "hamelin/scene/joint_trajectory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "hamelin/core/error.hpp"
#include "hamelin/core/hermite.hpp"

namespace hamelin::scene {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

[[noreturn]] void refuse_trajectory(const std::string& where, const std::string& place,
                                    const std::string& what) {
  throw Error(ErrorCode::invalid, fmt::format("{}: {}: {}", where, place, what));
}

// One number per joint, into the column of a point.
void read_column(const Json& values, Eigen::MatrixXd& out, Index point, const std::string& where,
                 const std::string& place) {
  if (static_cast<Index>(values.size()) != out.rows())
    refuse_trajectory(where, place,
                      fmt::format("{} values given, expected {} (one per joint of the trajectory)",
                                  values.size(), out.rows()));
  for (std::size_t k = 0; k < values.size(); ++k)
    out(static_cast<Index>(k), point) = values[k].get<double>();
}

// The member of a message of ROS; its type is checked, as no schema describes it.
const Json& ros_member(const Json& object, const char* key, Json::value_t type,
                       const std::string& where, const std::string& place) {
  static const Json nothing;
  const auto found = object.is_object() ? object.find(key) : object.end();
  const Json& value = object.is_object() && found != object.end() ? *found : nothing;
  if (value.type() != type)
    refuse_trajectory(where, fmt::format("{}/{}", place, key),
                      fmt::format("is {}, expected {}", value.is_null() ? "missing" : "wrong",
                                  type == Json::value_t::array ? "a list" : "an object"));
  return value;
}

double ros_time_s(const Json& duration, const std::string& where, const std::string& place) {
  double time_s = 0.0;
  for (const auto& [key, unit_s] : {std::pair("sec", 1.0), std::pair("nanosec", 1e-9)}) {
    const auto found = duration.find(key);
    if (found == duration.end() || !found->is_number())
      refuse_trajectory(where, fmt::format("{}/{}", place, key), "is missing, expected a number");
    time_s += unit_s * found->get<double>();
  }
  return time_s;
}

// A message of ROS in the project's own format.
Json from_ros(const Json& message, const std::string& where) {
  constexpr auto array = Json::value_t::array;
  Json out{{"schema", "hamelin.trajectory/1"},
           {"joints", ros_member(message, "joint_names", array, where, "")},
           {"points", Json::array()}};
  for (const Json& from : ros_member(message, "points", array, where, "")) {
    const std::string place = fmt::format("/points/{}", out["points"].size());
    const Json& time = ros_member(from, "time_from_start", Json::value_t::object, where, place);
    Json point{{"time_s", ros_time_s(time, where, place + "/time_from_start")},
               {"q", ros_member(from, "positions", array, where, place)},
               {"v", ros_member(from, "velocities", array, where, place)}};
    if (const auto a = from.find("accelerations"); a != from.end() && !a->empty()) point["a"] = *a;
    out["points"].push_back(std::move(point));
  }
  return out;
}

Json column_json(const Eigen::MatrixXd& matrix, Index column) {
  Json out = Json::array();
  for (const double x : matrix.col(column)) out.push_back(x);
  return out;
}

}  // namespace

Index JointTrajectory::at(double time, VectorXd& out_q, VectorXd& out_v, VectorXd& out_a,
                          Index first) const {
  const double* const times = time_s.data();
  time = std::clamp(time, 0.0, duration_s());
  const double* const next =
      std::upper_bound(times + std::min(first, points() - 2), times + points() - 1, time);
  const Index i = std::max<Index>(1, next - times), j = i - 1;
  const double h = time_s[i] - time_s[j], s = (time - time_s[j]) / h;
  const bool quintic = a.cols() > 0;
  for (Index k = 0; k < q.rows(); ++k) {
    const Hermite part =
        quintic ? Hermite::quintic(h, q(k, j), v(k, j), a(k, j), q(k, i), v(k, i), a(k, i))
                : Hermite::cubic(h, q(k, j), v(k, j), q(k, i), v(k, i));
    out_q[k] = part.position(s);
    out_v[k] = part.velocity(s);
    out_a[k] = part.acceleration(s);
  }
  return j;
}

void check(const JointTrajectory& trajectory, const std::string& where) {
  const Index n = trajectory.points(), dof = trajectory.q.rows();
  if (n < 2) refuse_trajectory(where, "/points", fmt::format("{} given, expected 2 or more", n));
  const auto sized = [&](const Eigen::MatrixXd& x) { return x.rows() == dof && x.cols() == n; };
  if (dof == 0 || !sized(trajectory.q) || !sized(trajectory.v) ||
      (trajectory.a.size() > 0 && !sized(trajectory.a)))
    refuse_trajectory(where, "/points",
                      "sizes differ, expected one position and velocity per joint and point, and "
                      "accelerations for all points or for none");
  if (!trajectory.joints.empty() && static_cast<Index>(trajectory.joints.size()) != dof)
    refuse_trajectory(where, "/joints",
                      fmt::format("{} names given, expected {}", trajectory.joints.size(), dof));
  for (Index i = 0; i < n; ++i) {
    const std::string place = fmt::format("/points/{}", i);
    const double time = trajectory.time_s[i];
    if (i == 0 && time != 0.0)
      refuse_trajectory(where, place + "/time_s", fmt::format("is {}, expected 0", time));
    if (!std::isfinite(time) || (i > 0 && !(time > trajectory.time_s[i - 1])))
      refuse_trajectory(where, place + "/time_s",
                        fmt::format("{} is not after the time before it, {}, expected times that "
                                    "increase",
                                    time, trajectory.time_s[std::max<Index>(0, i - 1)]));
    if (!trajectory.q.col(i).allFinite() || !trajectory.v.col(i).allFinite() ||
        (trajectory.a.size() > 0 && !trajectory.a.col(i).allFinite()))
      refuse_trajectory(where, place, "is not finite, expected finite numbers");
  }
}

JointTrajectory joint_trajectory_from_json(const Json& document, const std::string& where) {
  if (document.is_object() && document.contains("joint_names"))
    return joint_trajectory_from_json(from_ros(document, where), where);
  check_shipped_schema(document, "trajectory", where);
  const Json& points = document["points"];
  JointTrajectory out;
  out.joints = document["joints"].get<std::vector<std::string>>();
  const auto n = static_cast<Index>(points.size());
  const auto dof =
      static_cast<Index>(out.joints.empty() ? points[0]["q"].size() : out.joints.size());
  const bool accelerations = points[0].contains("a");
  out.time_s.resize(n);
  out.q.resize(dof, n);
  out.v.resize(dof, n);
  if (accelerations) out.a.resize(dof, n);
  for (Index i = 0; i < n; ++i) {
    const Json& point = points[static_cast<std::size_t>(i)];
    const std::string place = fmt::format("/points/{}", i);
    out.time_s[i] = point["time_s"].get<double>();
    read_column(point["q"], out.q, i, where, place + "/q");
    read_column(point["v"], out.v, i, where, place + "/v");
    if (point.contains("a") != accelerations)
      refuse_trajectory(where, place + "/a",
                        accelerations ? "is missing, expected accelerations as at the first point"
                                      : "is not expected, as the first point has none");
    if (accelerations) read_column(point["a"], out.a, i, where, place + "/a");
  }
  check(out, where);
  return out;
}

JointTrajectory read_joint_trajectory(const std::filesystem::path& file) {
  return joint_trajectory_from_json(read_json(file), file.string());
}

Json to_json(const JointTrajectory& trajectory) {
  Json out{
      {"schema", "hamelin.trajectory/1"}, {"joints", trajectory.joints}, {"points", Json::array()}};
  for (Index i = 0; i < trajectory.points(); ++i) {
    Json point{{"time_s", trajectory.time_s[i]},
               {"q", column_json(trajectory.q, i)},
               {"v", column_json(trajectory.v, i)}};
    if (trajectory.a.size() > 0) point["a"] = column_json(trajectory.a, i);
    out["points"].push_back(std::move(point));
  }
  return out;
}

}  // namespace hamelin::scene
