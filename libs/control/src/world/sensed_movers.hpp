#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hamelin/control/point_frame.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/sensing/mover_tracker.hpp"

namespace hamelin::control {

/// Bodies that move among the points of sensors, as obstacles of a world.
class SensedMovers {
 public:
  /// Whether an obstacle is a body that this sensor follows.
  [[nodiscard]] bool follows(std::int32_t source, const std::string& obstacle) const;

  /// Finds bodies among the points of a frame; nothing in a frame that another one has overtaken.
  /// @param points, loose, sensor see MoverTracker::update(); in the world
  /// @return what the world is to be told
  sensing::MoverTracker::Update take(const PointFrame& frame, const geometry::SE3& sensor,
                                     const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                     std::span<const std::uint8_t> loose);
  /// Tells the world. Bodies for which it has no room are not followed.
  /// @return the number of the snapshot that knows them
  std::uint64_t tell(const PointFrame& frame, const sensing::MoverTracker::Update& update,
                     World& world);

 private:
  struct Body {
    Eigen::Vector3d size_m;  ///< of its box
    int poses = 0;           ///< that the world was told since it has this box
  };
  struct Sensor {
    sensing::MoverTracker tracker;
    double last_s;
    std::map<std::int32_t, Body> bodies;  ///< by their ids
  };
  void tell(const PointFrame& frame, const sensing::MoverTracker::Mover& mover, Sensor& state,
            World& world);
  [[nodiscard]] static std::string name_of(std::int32_t source, std::int32_t id);

  std::map<std::int32_t, Sensor> sensors_;
};

}  // namespace hamelin::control
