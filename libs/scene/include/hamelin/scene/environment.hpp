#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/map_field.hpp"
#include "hamelin/scene/map_region.hpp"
#include "hamelin/scene/obstacles.hpp"

namespace hamelin::scene {

/// A near obstacle point of one sphere of the arm; world frame. The fields are those of hamelin_contact.
struct Contact {
  static constexpr int map = -1;      ///< `obstacle`: the map
  static constexpr int unknown = -2;  ///< `obstacle`: unknown space that blocks
  int sphere = 0;
  int obstacle = map;                                   ///< map, unknown, or the obstacle's index
  double distance = 0.0;                                ///< from the sphere's surface [m]; zero or below is contact
  Eigen::Vector3d arm_point = Eigen::Vector3d::Zero();  ///< on the sphere's surface
  Eigen::Vector3d obstacle_point = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();          ///< unit, from the obstacle towards the sphere
  Eigen::Vector3d obstacle_velocity = Eigen::Vector3d::Zero();  ///< [m/s]
};

/// Who looks. A planner: the map, and obstacles that are known or were seen (Environment::see), never judge_only ones.
/// Hidden: only what a planner is not shown. The judge: all that is there.
enum class View : std::int32_t { planner, hidden, judge };

/// All that the arm can hit, cropped to where it can be. Immutable and shared between threads; each thread brings a
/// Scratch of its own.
class Environment {
 public:
  /// Nearest points of the map (and of blocking unknown space) per sphere.
  static constexpr std::size_t points_per_sphere = MapField::points_max;

  struct Summary : MapSummary {
    std::size_t boxes = 0;          ///< after merging
    std::size_t unknown_boxes = 0;  ///< zero where unknown space is free
    std::size_t obstacles = 0;
  };

  /// Nothing to hit.
  Environment() = default;
  /// @param base pose of the robot's base frame in the world
  /// @param reach distance from the base that no point of the arm exceeds [m]
  /// @param influence the largest distance that will be asked for [m]
  /// @throws Error io, parse or invalid for the map or an obstacle
  Environment(const std::optional<MapSpec>& map, std::vector<Obstacle> obstacles, const geometry::SE3& base,
              double reach, double influence);

  class Scratch {
   public:
    /// @param spheres how many will be asked for at once; more allocate at the first such call
    Scratch(const Environment& environment, std::size_t spheres);

   private:
    friend class Environment;
    MapField::Scratch map_, unknown_;
    std::vector<Contact> found_;
    std::vector<std::size_t> order_;
  };

  /// All near obstacle points of all spheres: spheres in order, within a sphere nearest first.
  /// @param centers, radii the spheres, world [m]
  /// @param influence largest distance from a sphere's surface [m]
  /// @param out receives them; if it is too small, the nearest of all
  /// @param seen see(): one flag an obstacle; empty: none was seen
  /// @return how many there are, also if out is smaller. No allocation.
  std::size_t closest(std::span<const Eigen::Vector3d> centers, std::span<const double> radii, double influence,
                      double time_s, Scratch& scratch, std::span<Contact> out, View view = View::planner,
                      std::span<const std::uint8_t> seen = {}) const;

  /// Marks the obstacles that are not known but come into sight of the arm as it stands: they are there, and its
  /// clearance to them is at most their visible_within_m. Marks stay: what was seen is remembered.
  /// @param seen one flag an obstacle, zero at first
  /// @return the index of one that was newly seen, or −1 if there is none (any more). No allocation.
  int see(std::span<const Eigen::Vector3d> centers, std::span<const double> radii, double time_s,
          std::span<std::uint8_t> seen) const;

  /// Smallest distance between any sphere's surface and any obstacle [m], or `limit` if all is farther. Zero or below
  /// is contact. No allocation.
  [[nodiscard]] double clearance(std::span<const Eigen::Vector3d> centers, std::span<const double> radii, double time_s,
                                 double limit, View view = View::judge, std::span<const std::uint8_t> seen = {}) const;

  /// Whether a sphere touches unknown space where the policy is `slow`.
  [[nodiscard]] bool in_slow_space(std::span<const Eigen::Vector3d> centers, std::span<const double> radii) const;

  /// A Contact's obstacle in words: "the map", "unknown space" or "obstacle 'NAME'".
  [[nodiscard]] std::string words(int obstacle) const;

  /// Whether there is anything at all to hit.
  [[nodiscard]] bool has_obstacles() const noexcept;
  [[nodiscard]] const std::vector<Obstacle>& obstacles() const noexcept { return obstacles_; }
  [[nodiscard]] const MapField& map_field() const noexcept { return map_; }
  /// Pose of the map's frame, in which map_field() is, in the world.
  [[nodiscard]] const geometry::SE3& map_pose() const noexcept { return map_pose_; }
  [[nodiscard]] const Summary& summary() const noexcept { return summary_; }

 private:
  [[nodiscard]] bool shown(std::size_t obstacle, double time_s, View view, std::span<const std::uint8_t> seen) const;
  [[nodiscard]] double clearance_to(const Obstacle& obstacle, std::span<const Eigen::Vector3d> centers,
                                    std::span<const double> radii, double time_s, double limit) const;

  geometry::SE3 map_pose_, map_pose_inverse_;
  MapField map_, unknown_;  ///< in the map's frame [m]
  std::vector<Obstacle> obstacles_;
  Summary summary_;
};

}  // namespace hamelin::scene
