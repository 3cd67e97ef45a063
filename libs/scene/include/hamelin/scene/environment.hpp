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
#include "hamelin/scene/shapes.hpp"

namespace hamelin::scene {

/// A near obstacle point of one shape of the arm; world frame. The fields are those of hamelin_contact. A capsule is
/// nearest at one point of its axis, which stands for a sphere's centre.
struct Contact {
  static constexpr int map = -1;                        ///< `obstacle`: the map
  static constexpr int unknown = -2;                    ///< `obstacle`: unknown space that blocks
  int sphere = 0;                                       ///< index of the shape, in the order of Model::shapes()
  int obstacle = map;                                   ///< map, unknown, or the obstacle's index
  double distance = 0.0;                                ///< from the shape's surface [m]; zero or below is contact
  Eigen::Vector3d arm_point = Eigen::Vector3d::Zero();  ///< on the shape's surface
  Eigen::Vector3d obstacle_point = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();          ///< unit, from the obstacle towards the shape
  Eigen::Vector3d obstacle_velocity = Eigen::Vector3d::Zero();  ///< [m/s]
};

/// Who looks. A planner: the map, and obstacles that are known or were seen (Environment::see), never judge_only ones.
/// Hidden: only what a planner is not shown. The judge: all that is there.
enum class View : std::int32_t { planner, hidden, judge };

/// All that the arm can hit, cropped to where it can be. Queries are const and may run on several threads at once, each
/// with a Scratch of its own. advance() changes the map: no query may run meanwhile.
class Environment {
 public:
  /// Nearest points of the map (and of blocking unknown space) per shape.
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
  /// @param robot see read_region()
  /// @throws Error io, parse or invalid for the map or an obstacle
  Environment(const std::optional<MapSpec>& map, std::vector<Obstacle> obstacles, const geometry::SE3& base,
              double reach, double influence, const RobotAtStart& robot = {});

  class Scratch {
   public:
    /// @param shapes how many will be asked for at once; more allocate at the first such call
    Scratch(const Environment& environment, std::size_t shapes);

   private:
    friend class Environment;
    MapField::Scratch map_, unknown_;
    std::vector<Contact> found_;
    std::vector<std::size_t> order_;
  };

  /// How many contacts so many shapes can have at most.
  [[nodiscard]] std::size_t contacts_max(std::size_t shapes) const noexcept;

  /// All near obstacle points of all shapes: shapes in order, within a shape nearest first.
  /// @param influence largest distance from a shape's surface [m]
  /// @param out receives them; if it is too small, the nearest of all
  /// @param seen see(): one flag an obstacle; empty: none was seen
  /// @return how many there are, also if out is smaller. No allocation.
  std::size_t closest(const Shapes& arm, double influence, double time_s, Scratch& scratch, std::span<Contact> out,
                      View view = View::planner, std::span<const std::uint8_t> seen = {}) const;

  /// Marks the obstacles that are not known but come into sight of the arm as it stands: they are there, and its
  /// clearance to them is at most their visible_within_m. Marks stay: what was seen is remembered.
  /// @param seen one flag an obstacle, zero at first
  /// @return the index of one that was newly seen, or −1 if there is none (any more). No allocation.
  int see(const Shapes& arm, double time_s, std::span<std::uint8_t> seen) const;

  /// Smallest distance between any shape's surface and any obstacle [m], or `limit` if all is farther. Zero or below
  /// is contact. No allocation.
  [[nodiscard]] double clearance(const Shapes& arm, double time_s, double limit, View view = View::judge,
                                 std::span<const std::uint8_t> seen = {}) const;

  /// Whether a shape touches unknown space where the policy is `slow`.
  [[nodiscard]] bool in_slow_space(const Shapes& arm) const;

  /// Distance of the arm from one obstacle [m], whether it is there or not, or `limit` if that is less. No allocation.
  [[nodiscard]] double clearance_to(std::size_t obstacle, const Shapes& arm, double time_s, double limit) const {
    return clearance_to(obstacles_[obstacle], arm, time_s, limit);
  }

  /// A contact of the arm in words: "sphere 2 of link 'hand' is 4.2 mm inside the map".
  [[nodiscard]] std::string words(const Contact& contact, const model::Model& model) const;
  /// A Contact's obstacle in words: "the map", "unknown space" or "obstacle 'NAME'".
  [[nodiscard]] std::string words(int obstacle) const;

  /// Makes the map's changes that are due, see MapSpec::changes; what was unknown there is known from then on. To be
  /// called with times that do not fall, between ticks: nobody else may look meanwhile.
  /// @return a line about them; empty if none was due
  std::string advance(double time_s);

  /// Whether there is anything at all to hit, now or later.
  [[nodiscard]] bool has_obstacles() const noexcept;
  [[nodiscard]] const std::vector<Obstacle>& obstacles() const noexcept { return obstacles_; }
  [[nodiscard]] const MapField& map_field() const noexcept { return map_; }
  /// Pose of the map's frame, in which map_field() is, in the world.
  [[nodiscard]] const geometry::SE3& map_pose() const noexcept { return map_pose_; }
  [[nodiscard]] const Summary& summary() const noexcept { return summary_; }

 private:
  [[nodiscard]] bool shown(std::size_t obstacle, double time_s, View view, std::span<const std::uint8_t> seen) const;
  /// Adds the points of a field, or of obstacle k, that are within `influence` of the arm.
  void find_in(const MapField& field, int id, const Shapes& arm, double influence, MapField::Scratch& room,
               std::vector<Contact>& found) const;
  void find_on(std::size_t k, const Shapes& arm, double influence, double time_s, std::vector<Contact>& found) const;
  [[nodiscard]] static double clearance_to(const Obstacle& obstacle, const Shapes& arm, double time_s, double limit);

  geometry::SE3 map_pose_, map_pose_inverse_;
  MapField map_, unknown_;  ///< in the map's frame [m]
  std::vector<MapChange> changes_;
  std::size_t next_change_ = 0;
  std::vector<Obstacle> obstacles_;
  Summary summary_;
};

/// A contact's way out in words: "(0, 0, 1)", to two digits.
[[nodiscard]] std::string way_out(const Contact& contact);

}  // namespace hamelin::scene
