#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"

/// Independent contact checker. It shares with planners and runs only the files and their readers.
/// It places the arm and computes distances with code of its own.
namespace hamelin::sweep {

/// A collision sphere of the arm, or one of the row of balls that models a capsule.
struct JudgedBall {
  std::string name;        ///< "part/3": the fourth ball of that part of the arm
  int link = -1;           ///< index of the link that carries the ball; −1: the base
  Eigen::Vector3d center;  ///< in the base frame at q = 0 [m]
  double radius = 0.0;     ///< [m]
};

/// The arm of a scene, its capsules modelled as rows of balls. The arm is placed by the product of
/// exponentials: a point of link i at q = 0 is moved by exp(S_1 q_1) … exp(S_i q_i), where S_i is
/// the screw of joint i in the base frame.
class JudgedArm {
 public:
  /// Rows of balls lie within their capsules; no point of a capsule's surface is farther from them
  /// than this [m].
  static constexpr double capsule_gap_m = 1e-4;

  /// @throws Error as description::read_robot does
  explicit JudgedArm(const scene::Scene& scene);

  [[nodiscard]] std::size_t dof() const noexcept { return joints_.size(); }
  /// The balls that move, then those of the base if the scene models self-collision.
  [[nodiscard]] const std::vector<JudgedBall>& balls() const noexcept { return balls_; }
  /// The balls of the base, also where the scene does not model self-collision.
  [[nodiscard]] const std::vector<JudgedBall>& base_balls() const noexcept { return base_balls_; }
  /// Pairs of balls that must not touch each other. They belong to two parts that move relative to
  /// each other and are not listed as disabled. If a robot lists no disabled pair at all,
  /// neighbouring links are left out. Empty unless the scene models self-collision.
  [[nodiscard]] const std::vector<std::pair<std::size_t, std::size_t>>& self_pairs()
      const noexcept {
    return self_pairs_;
  }
  /// World centres of all balls at q [m].
  void place(const Eigen::VectorXd& q, std::vector<Eigen::Vector3d>& centers) const;

 private:
  struct Screw {
    int parent;
    Eigen::Vector3d axis, moment;  ///< ω and v of the spatial screw, base frame
  };
  Eigen::Isometry3d base_;
  std::vector<Screw> joints_;
  std::vector<JudgedBall> balls_, base_balls_;
  std::vector<std::pair<std::size_t, std::size_t>> self_pairs_;
};

/// Signed distance of a point from an obstacle at a pose [m]; minus the depth if the point is
/// inside.
[[nodiscard]] double distance_from(const scene::Obstacle& obstacle, const geometry::SE3& pose,
                                   const Eigen::Vector3d& p);

/// The occupied leaves of a map at a time, as OctoMap itself lists them. Changes of the scene's map
/// are applied once that time has passed theirs. Unknown space is free.
class JudgedMap {
 public:
  JudgedMap() = default;
  /// The map and its changes. @throws Error io, parse or invalid
  explicit JudgedMap(const scene::MapSpec& spec);
  /// The same without the voxels that the scene's self-filter removes: those that the padded robot
  /// touches at its start.
  JudgedMap(const scene::Scene& scene, const JudgedArm& arm);

  /// Applies the changes that are due, in the order listed: each first frees voxels, then occupies
  /// some.
  /// @param time_s not less than in the previous call
  /// @return whether a change was applied
  bool advance(double time_s);
  /// Removes all leaves; voxels that later changes occupy are still added.
  void clear() { leaves_.clear(); }

  [[nodiscard]] const std::vector<scene::Box>& leaves() const noexcept { return leaves_; }
  /// Distance of a world point from the nearest leaf [m]; 0 inside, infinite without leaves.
  /// O(leaves).
  [[nodiscard]] double distance(const Eigen::Vector3d& p) const;
  /// The leaves within a distance of a world point [m].
  [[nodiscard]] std::vector<scene::Box> leaves_within(const Eigen::Vector3d& p,
                                                      double distance) const;
  /// A world point in the map's frame [m].
  [[nodiscard]] Eigen::Vector3d to_map_frame(const Eigen::Vector3d& p) const {
    return from_world_ * p;
  }

 private:
  /// Voxels from lo up to but not including hi.
  struct Voxels {
    std::array<int, 3> lo, hi;
  };
  struct Change {
    double time_s;
    std::vector<Voxels> free, occupied;
  };

  [[nodiscard]] Change read_change(const scene::MapChangeSpec& spec,
                                   const scene::MapSpec& map) const;
  [[nodiscard]] Voxels voxels_of(const scene::Box& leaf) const;
  [[nodiscard]] scene::Box box_of(const Voxels& voxels) const;
  void free(const std::vector<Voxels>& freed);

  std::vector<scene::Box> leaves_;  ///< in the map's frame [m]
  double voxel_m_ = 0.0;            ///< edge of the smallest leaf
  std::vector<Change> changes_;     ///< by time
  std::size_t applied_ = 0;         ///< number of changes that have been applied
  Eigen::Isometry3d from_world_ = Eigen::Isometry3d::Identity();
};

/// The smallest distance found, its time, the ball, and what the ball was nearest to: an obstacle's
/// name, "map", or another ball.
struct Closest {
  double clearance_m = 0.0, time_s = 0.0;
  std::string ball, other;
};

/// The judge's result for a run.
struct Verdict {
  std::optional<Closest> obstacles;  ///< none if there is nothing to hit
  std::optional<Closest> self;       ///< of the arm from itself; none if not modelled
  std::size_t configurations = 0;    ///< number of configurations checked

  [[nodiscard]] bool contact() const noexcept {
    return (obstacles && obstacles->clearance_m <= 0.0) || (self && self->clearance_m <= 0.0);
  }
};
/// {contact, obstacles, self, configurations}; `obstacles` and `self` are {clearance_m, time_s,
/// sphere, other} or null.
[[nodiscard]] Json to_json(const Verdict& verdict);

/// Follows a run node by node and checks every node. Between two nodes it checks as many
/// intermediate configurations as are needed to keep the step of every joint within `step_rad`.
/// Obstacles and map are taken as they are at the time of the configuration. The map's leaves count
/// only if the scene has no obstacle that is judge_only: the map was made from such obstacles and
/// is wider than they are. Voxels that changes of the map occupy always count.
class Judge {
 public:
  static constexpr double step_rad = 0.01;

  /// @throws Error as JudgedArm and JudgedMap do; invalid if goals may touch something
  explicit Judge(const scene::Scene& scene);

  /// Checks the motion from the previous node to this one: time [s] and joint vector [rad or m].
  void add_node(double time_s, const Eigen::VectorXd& q);
  [[nodiscard]] const Verdict& verdict() const noexcept { return verdict_; }

 private:
  /// A ball's distance from the map at an earlier position, and all leaves that can be the nearest
  /// one close to it.
  struct NearbyLeaves {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    double distance = 0.0;
    std::vector<scene::Box> leaves;
    bool valid = false;
  };

  void check(double time_s, const Eigen::VectorXd& q);
  [[nodiscard]] double map_distance(std::size_t ball, double enough);

  JudgedArm arm_;
  std::vector<scene::Obstacle> obstacles_;
  std::vector<geometry::SE3> poses_;    ///< of each obstacle, at the configuration that is checked
  std::vector<double> bounding_radii_;  ///< of each obstacle: radius of a ball around it
  JudgedMap map_;
  std::vector<NearbyLeaves> nearby_;  ///< of each ball
  std::vector<Eigen::Vector3d> centers_;
  double min_clearance_, min_self_clearance_;  ///< so far; infinite at first
  double last_time_s_ = 0.0;
  Eigen::VectorXd last_q_;
  Verdict verdict_;
};

/// Whether the arm fits into the scene at its start and its goals.
struct Feasibility {
  bool feasible = true;
  std::string reason;  ///< empty if feasible
};

/// Checks start and goals against every occupied leaf of the map, every obstacle that is present at
/// time 0 and not judge_only, and the arm itself if the scene models self-collision; free means a
/// distance above 0. The start is checked in the map at time 0. It is not known when the arm will
/// be at a goal, so a goal is infeasible only if none of the maps from time 0 to the scene's
/// duration leaves room for it.
/// @param goals_q joint vectors to check in addition to the scene's own joint goals
/// @throws Error as Judge
[[nodiscard]] Feasibility feasibility(const scene::Scene& scene,
                                      const std::vector<Eigen::VectorXd>& goals_q);

}  // namespace hamelin::sweep
