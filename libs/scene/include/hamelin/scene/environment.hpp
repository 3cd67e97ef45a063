#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/allowance.hpp"
#include "hamelin/scene/distance_field.hpp"
#include "hamelin/scene/map_field.hpp"
#include "hamelin/scene/map_region.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::scene {

/// A near obstacle point of one shape of the arm, in the world frame; docs/theory.md (11.7),
/// (11.8). The fields are those of hamelin_contact. For a capsule, its nearest axis point takes the
/// place of a sphere's centre.
struct Contact {
  static constexpr int map = -1;      ///< `obstacle`: the map
  static constexpr int unknown = -2;  ///< `obstacle`: unknown space that blocks
  int sphere = 0;                     ///< index of the shape in Model::shapes()
  int obstacle = map;                 ///< map, unknown, or the obstacle's index
  double distance = 0.0;              ///< from the shape's surface [m]; zero or below is contact
  Eigen::Vector3d arm_point = Eigen::Vector3d::Zero();  ///< on the shape's surface
  Eigen::Vector3d obstacle_point = Eigen::Vector3d::Zero();
  /// Unit, from the obstacle towards the shape.
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  Eigen::Vector3d obstacle_velocity = Eigen::Vector3d::Zero();  ///< [m/s]
};

/// Which obstacles a query includes. planner: the map, and obstacles that are known or were seen,
/// see Environment::reveal_visible, but never those that are judge_only. hidden: only the obstacles
/// that a planner is not shown. judge: everything that exists.
enum class View : std::int32_t { planner, hidden, judge };

/// Which obstacles a query includes of those in view: all, those that never move (with the map), or
/// those that may move.
enum class Among : std::int32_t { all, standing, moving };

/// Everything that the arm can hit, cropped to the space that it can reach. Queries are const and
/// may run on several threads at once, each with a Scratch of its own. advance() changes the map:
/// no query may run at the same time.
class Environment {
 public:
  /// Nearest points of the map (and of blocking unknown space) per shape.
  static constexpr std::size_t points_per_sphere = MapField::points_max;

  struct Summary : MapSummary {
    std::size_t boxes = 0;          ///< after merging
    std::size_t unknown_boxes = 0;  ///< zero where unknown space is free
    std::size_t obstacles = 0;
  };

  /// An environment without obstacles.
  Environment() = default;
  /// @param base pose of the robot's base frame in the world
  /// @param reach upper bound of the distance of any point of the arm from the base [m]
  /// @param influence the largest distance that queries will use [m]
  /// @param robot see read_region()
  /// @throws Error io, parse or invalid for the map or an obstacle, also if one is attached to
  ///         another that there is not
  Environment(const std::optional<MapSpec>& map, std::vector<Obstacle> obstacles,
              const geometry::SE3& base, double reach, double influence,
              const RobotAtStart& robot = {});

  class Scratch {
   public:
    /// @param shapes the largest number per query; the first query with more of them allocates
    Scratch(const Environment& environment, std::size_t shapes);

   private:
    friend class Environment;
    MapField::Scratch map_, unknown_;
    std::vector<Contact> found_;
    std::vector<std::size_t> order_;
  };

  /// What closest() remembers of an arm that moves little from call to call: for each shape, the
  /// map's boxes around it. Results are the same to the bit, but come faster. One per arm and
  /// thread; for any environment, one after the other.
  class Vicinity {
   public:
    /// Allocates all memory that queries with so many shapes will use.
    explicit Vicinity(std::size_t shapes);

   private:
    friend class Environment;
    std::vector<BoxField::Vicinity> map_, unknown_;
  };

  /// The largest number of contacts that so many shapes can have, with this environment's obstacles
  /// or with another number of them.
  [[nodiscard]] std::size_t contacts_max(std::size_t shapes) const noexcept {
    return contacts_max(shapes, obstacles_.size());
  }
  [[nodiscard]] static std::size_t contacts_max(std::size_t shapes,
                                                std::size_t obstacles) noexcept {
    return shapes * (2 * points_per_sphere + 3 * obstacles);
  }

  /// All near obstacle points of all shapes: shapes in order, nearest first within a shape.
  /// @param influence largest distance from a shape's surface [m]
  /// @param out receives them; if it is too small, the nearest of all
  /// @param seen one flag per obstacle, see reveal_visible(); empty: none was seen
  /// @param vicinity that of the arm, or null
  /// @return how many there are, even if out is smaller. No allocation.
  std::size_t closest(const Shapes& arm, double influence, const Moment& moment, Scratch& scratch,
                      std::span<Contact> out, View view = View::planner,
                      std::span<const std::uint8_t> seen = {}, Vicinity* vicinity = nullptr,
                      Among among = Among::all) const;

  /// Marks an obstacle that is not known but visible from the arm's configuration: it exists, and
  /// the clearance to it is at most its visible_within_m. Marks are permanent: an obstacle that was
  /// seen is remembered.
  /// @param seen one flag per obstacle, zero at first
  /// @return the index of the obstacle that was marked, or −1 if no other is visible. No
  ///        allocation.
  int reveal_visible(const Shapes& arm, double time_s, std::span<std::uint8_t> seen) const;

  /// Smallest distance between the surface of any shape and any obstacle of those `among` [m], or
  /// `limit` if all obstacles are farther. Zero or below is contact. No allocation.
  [[nodiscard]] double clearance(const Shapes& arm, const Moment& moment, double limit,
                                 View view = View::judge, std::span<const std::uint8_t> seen = {},
                                 Among among = Among::all) const;

  /// The nearest of all that stands still: the map, unknown space that blocks, and the obstacles
  /// without motion.
  struct Standing {
    double distance = 0.0;        ///< from the segment [m]; zero or below is contact
    int obstacle = Contact::map;  ///< as Contact::obstacle, if nearer than the limit
  };
  /// Distance of the segment from a to b in the world from what stands still at a time and in a
  /// view, or `limit` if that is less. No allocation.
  /// @param hint of the map, see BoxField::nearest; changes
  [[nodiscard]] Standing nearest_standing(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                          double limit, double time_s, std::int32_t& hint,
                                          View view = View::judge,
                                          std::span<const std::uint8_t> seen = {}) const;

  /// Whether a shape touches unknown space where the policy is `slow`.
  [[nodiscard]] bool in_slow_space(const Shapes& arm) const;

  /// Distance of the arm from one obstacle [m], whether it exists at that time or not, or `limit`
  /// if that is less. No allocation.
  [[nodiscard]] double clearance_to(std::size_t obstacle, const Shapes& arm, const Moment& moment,
                                    double limit) const {
    return clearance_to(obstacles_[obstacle], arm, placed_at(obstacles_[obstacle], moment), limit);
  }

  /// Describes a contact of the arm: "sphere 2 of link 'hand' is 4.2 mm inside the map".
  [[nodiscard]] std::string describe(const Contact& contact, const model::Model& model) const;
  /// Describes a Contact's obstacle: "the map", "unknown space" or "obstacle 'NAME'".
  [[nodiscard]] std::string describe(int obstacle) const;

  /// Applies the map's changes that are due, see MapSpec::changes; changed voxels are known from
  /// then on. To be called between ticks with times that do not decrease, while no query runs.
  /// @return one line that describes them; empty if none was due
  std::string advance(double time_s);

  /// A copy with other obstacles, which shares the map until one of them changes it.
  /// @param changes of the map, for advance()
  /// @throws Error invalid for an obstacle; io, parse or invalid for a change
  [[nodiscard]] Environment with_obstacles(std::vector<Obstacle> obstacles,
                                           std::span<const MapChangeSpec> changes = {}) const;
  /// A copy in which one obstacle is another one.
  /// @throws Error invalid for an obstacle
  [[nodiscard]] Environment with_obstacle(std::size_t index, Obstacle obstacle) const;
  /// A copy in which voxels of the map are freed and occupied now; time_s of the change is not
  /// used. Queries may run on this environment at the same time.
  /// @throws Error io, parse or invalid, also if there is no map to change
  [[nodiscard]] Environment with_change(const MapChangeSpec& change) const;
  /// The same for a change in voxels, of which those beyond map_ball() do not matter.
  /// @throws Error invalid if there is no map to change
  [[nodiscard]] Environment with_change(const MapChange& change) const;
  /// A copy in which what may be touched is no obstacle: its voxels are free, and its obstacles
  /// never exist, but keep their indices.
  [[nodiscard]] Environment with_allowance(const Allowance& allowance) const;
  /// Computes now what the first query inside the map would compute, so that queries neither
  /// allocate nor wait.
  void prepare() const;

  /// Distances from the map, and from unknown space that blocks, at the corners of its voxels, in
  /// the map's frame. Computed at the first call, and again at the first one after a change of many
  /// boxes; smaller changes update it. Null if it would need more than DistanceField::bytes_max.
  /// Environments that share the map share it.
  [[nodiscard]] std::shared_ptr<const DistanceField> distance_field() const;
  /// Computes now what the first call of distance_field() would compute.
  void prepare_field() const { (void)distance_field(); }

  /// Whether an obstacle may ever move.
  [[nodiscard]] bool moves(std::size_t obstacle) const noexcept { return moves_[obstacle] != 0; }
  /// Whether any obstacle may ever move.
  [[nodiscard]] bool has_movers() const noexcept {
    return std::find(moves_.begin(), moves_.end(), std::uint8_t{1}) != moves_.end();
  }
  /// Whether there is any obstacle, now or later.
  [[nodiscard]] bool has_obstacles() const noexcept;
  [[nodiscard]] const std::vector<Obstacle>& obstacles() const noexcept { return obstacles_; }
  [[nodiscard]] const MapField& map_field() const noexcept { return *map_; }
  /// The space that the map does not know; empty where it is free.
  [[nodiscard]] const MapField& unknown_field() const noexcept { return *unknown_; }
  /// Pose of the map's frame in the world; map_field() is in that frame.
  [[nodiscard]] const geometry::SE3& map_pose() const noexcept { return map_pose_; }
  /// The map as given, without its changes; none if there is none.
  [[nodiscard]] const std::optional<MapSpec>& map_spec() const noexcept { return map_spec_; }
  /// What was kept of the map, in its frame [m]; of radius zero without a map.
  [[nodiscard]] const Ball& map_ball() const noexcept { return map_ball_; }
  [[nodiscard]] const Summary& summary() const noexcept { return summary_; }

 private:
  [[nodiscard]] bool in_view(std::size_t obstacle, double time_s, View view,
                             std::span<const std::uint8_t> seen, Among among) const;
  /// Adds the points of a field, or of obstacle k, that are within `influence` of the arm.
  void add_map_contacts(const MapField& field, int id, const Shapes& arm, double influence,
                        MapField::Scratch& scratch, std::vector<BoxField::Vicinity>* vicinity,
                        std::vector<Contact>& found) const;
  /// Whether the distance field, if it is made, proves that the map and unknown space that blocks
  /// are farther from a point of the world than the limit, docs/theory.md (11.24). For a shape with
  /// an axis, the point is its centre and the limit grows by half of the axis, docs/theory.md
  /// (11.6).
  [[nodiscard]] bool is_map_beyond(const Eigen::Vector3d& p, double limit) const;
  void add_obstacle_contacts(std::size_t k, const Shapes& arm, double influence, const Placed& at,
                             std::vector<Contact>& found) const;
  [[nodiscard]] static double clearance_to(const Obstacle& obstacle, const Shapes& arm,
                                           const Placed& at, double limit);

  void require_map() const;
  void read_changes(std::span<const MapChangeSpec> changes);
  /// Applies one change to fields that no other environment shares.
  MapField::Changed apply(const MapChange& change);

  /// A distance field, once it is made.
  struct LazyField {
    std::once_flag once;
    std::shared_ptr<DistanceField> field;
    std::atomic<bool> made = false;
  };
  /// Replaces the distance field, if there is one, by one that knows a change.
  void update_field(const MapChange& change);

  geometry::SE3 map_pose_, map_pose_inverse_;
  /// In the map's frame [m]. Copies of an environment share them until one of them is changed.
  std::shared_ptr<MapField> map_ = std::make_shared<MapField>(), unknown_ = map_;
  std::shared_ptr<LazyField> field_ = std::make_shared<LazyField>();  ///< shared as the map is
  std::optional<MapSpec> map_spec_;                                   ///< without its changes
  Ball map_ball_;  ///< what was kept of the map, in its frame
  std::vector<MapChange> changes_;
  std::size_t next_change_ = 0;
  /// Checks the obstacles, and takes them.
  void take(std::vector<Obstacle> obstacles);

  std::vector<Obstacle> obstacles_;
  std::vector<std::uint8_t> moves_;  ///< per obstacle: whether it may ever move
  Summary summary_;
};

/// The exit direction of a contact as text, to two digits: "(0, 0, 1)".
[[nodiscard]] std::string describe_exit_direction(const Contact& contact);

}  // namespace hamelin::scene
