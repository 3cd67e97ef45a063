#include "loop/target_line.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::control {

using Eigen::Vector3d;

namespace {

constexpr std::array<std::string_view, 6> target_keys{
    "time_s",       "position_m",        "quaternion_wxyz",
    "velocity_m_s", "acceleration_m_s2", "angular_velocity_rad_s"};

template <int n>
std::optional<Eigen::Matrix<double, n, 1>> read_numbers(const Json& line, const char* key) {
  const auto at = line.find(key);
  if (at == line.end() || at->is_null()) return std::nullopt;
  Eigen::Matrix<double, n, 1> out;
  bool valid = at->is_array() && at->size() == n;
  for (int i = 0; valid && i < n; ++i) {
    const Json& number = (*at)[static_cast<std::size_t>(i)];
    valid = number.is_number();
    if (valid) out[i] = number.get<double>();
  }
  if (!valid || !out.allFinite())
    throw Error(ErrorCode::invalid, fmt::format("/{}: is {}, expected {} finite numbers", key,
                                                one_line(at->dump()).substr(0, 60), n));
  return out;
}

Eigen::Matrix3d read_orientation(const Json& line, bool position_only) {
  const auto wxyz = read_numbers<4>(line, "quaternion_wxyz");
  if (!wxyz && !position_only)
    throw Error(ErrorCode::invalid,
                "/quaternion_wxyz: is missing, expected it where a pose is tracked");
  if (!wxyz) return Eigen::Matrix3d::Identity();
  if (!(std::abs(wxyz->norm() - 1.0) <= 1e-3))
    throw Error(ErrorCode::invalid,
                fmt::format("/quaternion_wxyz: the norm is {:.6g}, expected a unit quaternion",
                            wxyz->norm()));
  return geometry::rotation_from_wxyz(wxyz->normalized());
}

double read_time(const Json& line) {
  const auto at = line.find("time_s");
  if (at == line.end() || !at->is_number() || !std::isfinite(at->get<double>()))
    throw Error(ErrorCode::invalid, "/time_s: is missing, expected a finite number");
  return at->get<double>();
}

TargetSample sample_of(const Json& line, bool position_only) {
  if (!line.is_object())
    throw Error(ErrorCode::parse, "is not a JSON object, expected a pose or a twist");
  for (const auto& [key, value] : line.items())
    if (std::find(target_keys.begin(), target_keys.end(), key) == target_keys.end())
      throw Error(ErrorCode::invalid,
                  fmt::format("has the key '{}', expected {}", one_line(key).substr(0, 60),
                              fmt::join(target_keys, ", ")));
  const double time_s = read_time(line);
  const auto velocity = read_numbers<3>(line, "velocity_m_s"),
             turn = read_numbers<3>(line, "angular_velocity_rad_s"),
             position = read_numbers<3>(line, "position_m");
  if (position)
    return TargetPose{time_s,
                      {read_orientation(line, position_only), *position},
                      velocity,
                      read_numbers<3>(line, "acceleration_m_s2"),
                      turn};
  if (!velocity && !turn)
    throw Error(ErrorCode::invalid,
                "has neither position_m nor velocities, expected a pose or a twist");
  const Vector3d zero = Vector3d::Zero();
  return TargetTwist{time_s, velocity.value_or(zero), turn.value_or(zero)};
}

}  // namespace

TargetSample read_target_line(std::string_view text, const std::string& where, bool position_only) {
  const Json line = parse_json(text, where);
  try {
    return sample_of(line, position_only);
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: {}", where, e.what()));
  }
}

}  // namespace hamelin::control
