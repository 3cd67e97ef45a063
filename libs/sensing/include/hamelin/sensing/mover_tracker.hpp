#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::sensing {

/// What counts as a body that moves.
struct MoverOptions {
  double apart_m = 0.05;       ///< points that are farther from each other are of two bodies
  std::size_t points_min = 8;  ///< of a body in a frame
  std::size_t frames_min = 3;  ///< in which a body is seen before it counts as moving
  double moved_min_m = 0.05;   ///< by which its centre has moved until then
  double size_max_m = 1.5;     ///< larger ones are not followed
  double speed_max_m_s = 3.0;  ///< faster ones are taken for others
  double still_s = 1.0;        ///< after so long within moved_min_m it stands still
  double lost_s = 0.5;         ///< after so long without being seen it is gone
};

/// Finds bodies that move among the points of frames, and follows them from frame to frame:
/// docs/theory.md (20.5). Points that are near each other are one body. The same frames give the
/// same bodies. One thread.
class MoverTracker {
 public:
  explicit MoverTracker(const MoverOptions& options = {}) : options_(options) {}

  /// A box about what was seen of a body. What is hidden behind it is taken to be as deep as the
  /// smaller side of what is seen.
  struct Mover {
    std::int32_t id = 0;  ///< that no other body gets
    geometry::SE3 pose;   ///< of the box's centre and axes
    Eigen::Vector3d size_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  };
  struct Update {
    std::vector<Mover> movers;        ///< that were seen in this frame
    std::vector<std::int32_t> gone;   ///< ids of movers that were lost, or stand still
    std::vector<std::uint8_t> taken;  ///< per point: whether it is on a mover
  };

  /// @param time_s of the frame, after that of the last one
  /// @param sensor its pose: z points away from it
  /// @param points 3 × N in the frame of the pose [m]
  /// @param loose per point: whether it is where nothing stood for long
  [[nodiscard]] Update update(double time_s, const geometry::SE3& sensor,
                              const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                              std::span<const std::uint8_t> loose);
  /// Forgets a mover that was found in the last update.
  void forget(std::int32_t id);

  [[nodiscard]] bool empty() const noexcept { return tracks_.empty(); }

 private:
  struct Cluster {
    std::vector<Eigen::Index> points;
    Eigen::Vector3d low, high;  ///< in the axes of the sensor
  };
  struct Track {
    std::int32_t id = 0;
    bool moves = false;
    std::size_t frames = 1;
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
    Eigen::Vector3d center, velocity = Eigen::Vector3d::Zero(), size;
    Eigen::Vector3d anchor;  ///< where it was when it last moved
    double seen_s = 0.0, anchored_s = 0.0;
  };
  [[nodiscard]] std::vector<Cluster> clusters_of(const Eigen::Matrix3d& axes,
                                                 const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                                 std::span<const std::uint8_t> loose) const;
  [[nodiscard]] Track* nearest(const Eigen::Vector3d& center, double time_s,
                               std::span<const std::uint8_t> assigned);
  void follow(Track& track, double time_s, const Eigen::Vector3d& center) const;

  MoverOptions options_;
  std::int32_t next_id_ = 1;
  std::vector<Track> tracks_;
};

}  // namespace hamelin::sensing
