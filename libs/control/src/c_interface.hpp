#pragma once
#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/hamelin_control.h"
#include "hamelin/core/error.hpp"

/// What the functions of the C interface share.
struct hamelin_controller {
  using Line = std::array<char, hamelin::control::LineBuffer::size_max>;

  /// @param scene_folder that relative paths start from
  hamelin_controller(const hamelin::scene::Scene& scene, std::filesystem::path scene_folder,
                     const std::vector<std::filesystem::path>& plugins,
                     hamelin::control::Controller::Options options)
      : folder(std::move(scene_folder)),
        controller(scene, plugins, std::move(options)),
        q(Eigen::VectorXd::Zero(controller.answer().torque.size())),
        v(q) {}

  const std::filesystem::path folder;
  hamelin::control::Controller controller;
  Eigen::VectorXd q, v;
  Line cause{}, load_refusal{};  ///< of the last answer, nul-terminated
  Line shield_line{};            ///< of the last hamelin_controller_shield, nul-terminated
};

namespace hamelin::control {

inline void write_line(std::string_view line, char* out, std::size_t size) noexcept {
  if (out == nullptr || size == 0) return;
  out[line.copy(out, size - 1)] = '\0';
}

/// Runs f; what it throws becomes a line. @return 0, or 1 if it threw
template <class F>
std::int32_t guarded(char* error, std::size_t error_size, F&& f) noexcept {
  try {
    f();
    return 0;
  } catch (const std::exception& e) {
    write_line(e.what(), error, error_size);
  } catch (...) {
    write_line("an exception that is not a std::exception", error, error_size);
  }
  return 1;
}

template <class T>
T* required(T* pointer, const char* what) {
  if (pointer == nullptr)
    throw Error(ErrorCode::usage, fmt::format("{}: is null, expected its value", what));
  return pointer;
}

/// f of a controller that must be given.
template <class F>
std::int32_t guarded(hamelin_controller* of, char* error, std::size_t error_size, F&& f) noexcept {
  return guarded(error, error_size, [&] { f(*required(of, "controller")); });
}

/// The same for a change that has a number.
template <class F>
std::int32_t update(hamelin_controller* of, std::uint64_t* number, char* error,
                    std::size_t error_size, F&& f) noexcept {
  return guarded(of, error, error_size, [&](hamelin_controller& controller) {
    const std::uint64_t made = f(controller);
    if (number != nullptr) *number = made;
  });
}

/// dof numbers of the caller.
inline Eigen::Map<const Eigen::VectorXd> joints(const hamelin_controller& of, const double* numbers,
                                                const char* what) {
  return {required(numbers, what), of.q.size()};
}

/// What the caller chooses instead of a default, which 0 selects.
template <class T>
void take_choice(double given, const char* what, T& out) {
  if (!(std::isfinite(given) && given >= 0.0))
    throw Error(
        ErrorCode::usage,
        fmt::format("{}: {}, expected a positive number, or 0 for the default", what, given));
  if (given > 0.0) out = given;
}

[[noreturn]] inline void refuse_size(const char* what) {
  throw Error(ErrorCode::usage, fmt::format("{}: is null or its struct_size is too small", what));
}

/// A struct of a caller that may be built against an earlier header, whose struct was shorter, with
/// zeros for what it lacks. `size` is that of the first header.
template <class T>
T complete(const T* given, std::size_t size, const char* what) {
  if (given == nullptr || given->struct_size < size) refuse_size(what);
  T full{};
  std::memcpy(&full, given, std::min<std::size_t>(given->struct_size, sizeof full));
  return full;
}

/// Writes to a struct of a caller as much as it has room for.
template <class T>
void write_struct(T full, T* out) noexcept {
  full.struct_size = out->struct_size;
  std::memcpy(out, &full, std::min<std::size_t>(out->struct_size, sizeof full));
}

inline geometry::SE3 pose_of(const double* position, const double* wxyz) {
  return {geometry::rotation_from_wxyz(Eigen::Map<const Eigen::Vector4d>(wxyz)),
          Eigen::Map<const Eigen::Vector3d>(position)};
}

inline std::optional<Eigen::Vector3d> optional_vector(const double* numbers) {
  if (numbers == nullptr) return std::nullopt;
  return Eigen::Map<const Eigen::Vector3d>(numbers);
}

inline Observation observation_of(const hamelin_observation* given, const char* what) {
  const hamelin_observation full = complete(given, sizeof(hamelin_observation), what);
  return {full.time_s, pose_of(full.position_m, full.quaternion_wxyz),
          optional_vector(full.velocity_m_s), optional_vector(full.acceleration_m_s2),
          optional_vector(full.angular_velocity_rad_s)};
}

/// JSON of the caller; null is refused.
inline Json json_of(const char* text, const char* what) {
  return parse_json(required(text, what), what);
}

/// That relative paths of the caller's JSON start from.
inline std::filesystem::path folder_of(const hamelin_controller& of, const char* folder) {
  return folder != nullptr ? std::filesystem::path(folder) : of.folder;
}

/// Writes JSON to memory of the caller, see hamelin_controller_planner_params.
inline void write_json(const Json& json, char* out, std::size_t size, std::size_t* needed) {
  const std::string text = json.dump();
  if (needed != nullptr) *needed = text.size() + 1;
  if (size == 0) return;
  (void)required(out, "json");
  if (size <= text.size())
    throw Error(ErrorCode::usage,
                fmt::format("json_size: {}, expected at least {}", size, text.size() + 1));
  write_line(text, out, size);
}

}  // namespace hamelin::control
