#include "hamelin/scene/tip_constraint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"

namespace hamelin::scene {

namespace {

constexpr double angle_max_rad = 1.5;

[[noreturn]] void fail(const std::string& where, const std::string& what) {
  throw Error(ErrorCode::invalid, fmt::format("{}: {}", where, what));
}

void check_direction(const Eigen::Vector3d& v, const std::string& where) {
  if (!v.allFinite() || !(v.norm() > 1e-6))
    fail(where, "has no direction, expected three finite numbers that are not all zero");
}

// A box's corner; null where the box has no end.
Json corner(const Eigen::Vector3d& p) {
  Json out = Json::array();
  for (const double x : p) out.push_back(std::isfinite(x) ? Json(x) : Json(nullptr));
  return out;
}

Json numbers(const Eigen::Vector3d& p) {
  return {p.x(), p.y(), p.z()};
}

}  // namespace

std::string_view type_name(const TipConstraint& constraint) noexcept {
  if (std::holds_alternative<SpeedConstraint>(constraint)) return "speed";
  return std::holds_alternative<AxisConstraint>(constraint) ? "axis" : "box";
}

std::string_view unit_of(std::string_view type) noexcept {
  return type == "axis" ? "rad" : type == "speed" ? "m/s" : "m";
}

double speed_max_m_s(const std::vector<TipConstraint>& constraints) noexcept {
  double most = infinity;
  for (const TipConstraint& constraint : constraints)
    if (const auto* speed = std::get_if<SpeedConstraint>(&constraint))
      most = std::min(most, speed->m_s);
  return most;
}

void check(const TipConstraint& constraint, const std::string& where) {
  if (const auto* axis = std::get_if<AxisConstraint>(&constraint)) {
    check_direction(axis->axis, where + ": axis");
    check_direction(axis->direction, where + ": direction");
    if (!(axis->angle_rad > 0.0 && axis->angle_rad <= angle_max_rad))
      fail(where + ": angle_rad", fmt::format("{} given, expected a number above 0, at most {}",
                                              axis->angle_rad, angle_max_rad));
    return;
  }
  if (const auto* speed = std::get_if<SpeedConstraint>(&constraint)) {
    if (!(speed->m_s > 0.0 && std::isfinite(speed->m_s)))
      fail(where + ": speed_m_s", fmt::format("{} given, expected a number above 0", speed->m_s));
    return;
  }
  const auto& box = std::get<BoxConstraint>(constraint);
  if (!box.pose.R().allFinite() || !box.pose.p().allFinite())
    fail(where, "the box's pose is not finite");
  if (!(box.low_m.array() < box.high_m.array()).all())
    fail(where, "low_m is not below high_m on each axis, expected a box with a volume");
  if (!box.low_m.array().isFinite().any() && !box.high_m.array().isFinite().any())
    fail(where, "the box has no side, expected a number in low_m or high_m");
}

Json to_json(const TipConstraint& constraint) {
  if (const auto* axis = std::get_if<AxisConstraint>(&constraint))
    return {{"type", "axis"},
            {"axis", numbers(axis->axis)},
            {"direction", numbers(axis->direction)},
            {"angle_rad", axis->angle_rad}};
  if (const auto* speed = std::get_if<SpeedConstraint>(&constraint))
    return {{"type", "speed"}, {"speed_m_s", speed->m_s}};
  const auto& box = std::get<BoxConstraint>(constraint);
  return {{"type", "box"},
          {"position_m", numbers(box.pose.p())},
          {"quaternion_wxyz", box.quaternion_wxyz},
          {"low_m", corner(box.low_m)},
          {"high_m", corner(box.high_m)}};
}

}  // namespace hamelin::scene
