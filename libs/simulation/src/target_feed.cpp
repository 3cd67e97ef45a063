#include "target_feed.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::simulation {

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

std::variant<control::TargetPose, control::TargetTwist> read_target_line(std::string_view text,
                                                                         bool position_only) {
  const Json line = Json::parse(text, nullptr, false);
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
    return control::TargetPose{time_s,
                               {read_orientation(line, position_only), *position},
                               velocity,
                               read_numbers<3>(line, "acceleration_m_s2"),
                               turn};
  if (!velocity && !turn)
    throw Error(ErrorCode::invalid,
                "has neither position_m nor velocities, expected a pose or a twist");
  const Vector3d zero = Vector3d::Zero();
  return control::TargetTwist{time_s, velocity.value_or(zero), turn.value_or(zero)};
}

double time_of(const std::variant<control::TargetPose, control::TargetTwist>& sample) {
  return std::visit([](const auto& one) { return one.time_s; }, sample);
}

}  // namespace

TargetFeed::TargetFeed(std::istream& stream, std::string name, bool position_only)
    : stream_(stream), name_(std::move(name)), position_only_(position_only) {}

TargetFeed::TargetFeed(const std::filesystem::path& file, bool position_only)
    : file_(std::make_unique<std::ifstream>(file)),
      stream_(*file_),
      name_(file.string()),
      position_only_(position_only) {
  if (!*file_)
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be opened, expected a stream of targets", name_));
}

void TargetFeed::read_next(const std::function<void(const std::string&)>& refused) {
  std::string text;
  while (!next_ && std::getline(stream_, text)) {
    ++line_;
    if (text.find_first_not_of(" \t\r") == std::string::npos) continue;
    try {
      next_ = read_target_line(text, position_only_);
      next_line_ = line_;
    } catch (const Error& e) {
      refused(fmt::format("{}: line {}: {}", name_, line_, e.what()));
    }
  }
  ended_ = !next_;
}

void TargetFeed::advance(double time_s, control::Controller& controller,
                         const std::function<void(const std::string&)>& refused) {
  constexpr double rounding_s = 1e-9;
  while (!ended_) {
    if (!next_) read_next(refused);
    if (!next_ || time_of(*next_) > time_s + rounding_s) return;
    const Sample sample = *std::exchange(next_, std::nullopt);
    try {
      std::visit([&](const auto& one) { controller.set_target(one); }, sample);
      last_s_ = time_of(sample);
    } catch (const Error& e) {
      refused(fmt::format("{}: line {}: {}", name_, next_line_, e.what()));
    }
  }
}

}  // namespace hamelin::simulation
