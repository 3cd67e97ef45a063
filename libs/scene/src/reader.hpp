#pragma once
#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/se3.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/motion.hpp"
#include "rotation.hpp"

namespace hamelin::scene {

/// Reads one JSON object that was already checked against the schema; null is the same as absent.
class Reader {
 public:
  Reader(const Json& object, std::string place) : object_(object), place_(std::move(place)) {}

  [[nodiscard]] const Json* find(const char* key) const {
    if (!object_.is_object()) return nullptr;
    const auto it = object_.find(key);
    return it == object_.end() || it->is_null() ? nullptr : &*it;
  }
  template <typename T>
  [[nodiscard]] T get(const char* key, T fallback) const {
    const Json* value = find(key);
    return value != nullptr ? value->get<T>() : fallback;
  }
  template <typename T>
  [[nodiscard]] std::optional<T> maybe(const char* key) const {
    const Json* value = find(key);
    return value != nullptr ? std::optional<T>(value->get<T>()) : std::nullopt;
  }
  [[nodiscard]] Reader child(const char* key) const {
    static const Json nothing;
    const Json* value = find(key);
    return {value != nullptr ? *value : nothing, place_of(key)};
  }
  [[nodiscard]] bool is_given() const { return object_.is_object(); }
  /// Calls `read` with each element of a list.
  template <class Read>
  void each(const char* key, const Read& read) const {
    const Json* list = find(key);
    for (std::size_t i = 0; list != nullptr && i < list->size(); ++i)
      read(Reader((*list)[i], fmt::format("{}/{}", place_of(key), i)));
  }
  [[nodiscard]] const std::string& place() const noexcept { return place_; }
  [[nodiscard]] std::string place_of(const char* key) const {
    return fmt::format("{}/{}", place_, key);
  }

  [[nodiscard]] Eigen::Vector3d vector(const char* key, const Eigen::Vector3d& fallback) const {
    const Json* value = find(key);
    if (value == nullptr) return fallback;
    return {(*value)[0].get<double>(), (*value)[1].get<double>(), (*value)[2].get<double>()};
  }
  [[nodiscard]] Eigen::VectorXd joints(const char* key) const {
    if (const Json* value = find(key); value != nullptr)
      for (std::size_t i = 0; i < value->size(); ++i)
        if (!(*value)[i].is_number())
          fail(fmt::format("{}/{}", key, i).c_str(),
               "is a list, expected a number (way-points belong to a goal of type path)");
    const auto values = get<std::vector<double>>(key, {});
    return Eigen::Map<const Eigen::VectorXd>(values.data(),
                                             static_cast<Eigen::Index>(values.size()));
  }
  // Way-points as columns.
  [[nodiscard]] Eigen::MatrixXd joint_path(const char* key) const {
    const Json& points = *find(key);
    if (points.empty()) fail(key, "is empty, expected at least one way-point");
    Eigen::MatrixXd path;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::string place = fmt::format("{}/{}", key, i);
      if (!points[i].is_array() || points[i].empty())
        fail(place.c_str(), "expected a way-point, a list of one number per joint");
      const auto q = points[i].get<std::vector<double>>();
      const auto size = static_cast<Eigen::Index>(q.size());
      if (i == 0) path.resize(size, static_cast<Eigen::Index>(points.size()));
      if (size != path.rows())
        fail(place.c_str(), fmt::format("{} values given, expected {} as in the first way-point",
                                        size, path.rows()));
      path.col(static_cast<Eigen::Index>(i)) = Eigen::Map<const Eigen::VectorXd>(q.data(), size);
    }
    return path;
  }
  [[nodiscard]] Quaternion quaternion() const {
    Quaternion c{1.0, 0.0, 0.0, 0.0};
    if (const Json* value = find("quaternion_wxyz"); value != nullptr)
      for (std::size_t i = 0; i < c.size(); ++i) c[i] = (*value)[i].get<double>();
    const double norm = Eigen::Map<const Eigen::Vector4d>(c.data()).norm();
    if (!(std::abs(norm - 1.0) <= 1e-3))
      fail("quaternion_wxyz", fmt::format("the norm is {:.6g}, expected a unit quaternion", norm));
    return c;
  }
  [[nodiscard]] geometry::SE3 pose() const {
    return {rotation_of(quaternion()), vector("position_m", Eigen::Vector3d::Zero())};
  }
  [[noreturn]] void fail(const char* key, const std::string& message) const {
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", place_of(key), message));
  }
  void require(const char* key, std::string_view kind) const {
    if (find(key) == nullptr) fail(key, fmt::format("is missing, expected for a {}", kind));
  }
  void refuse(const char* key, std::string_view kind) const {
    if (find(key) != nullptr) fail(key, fmt::format("is not allowed for a {}", kind));
  }

 private:
  const Json& object_;
  std::string place_;
};

}  // namespace hamelin::scene
