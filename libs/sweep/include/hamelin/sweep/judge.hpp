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

/// A second opinion on contact. It shares with what planners and runs use only the files and how they are read: the arm
/// is placed, and distances are taken, by code of its own.
namespace hamelin::sweep {

/// A collision sphere of the arm, or one of those that stand for a capsule.
struct JudgedBall {
  std::string name;        ///< "part/3": the fourth ball of that part of the arm
  int link = -1;           ///< it moves with; −1: the base
  Eigen::Vector3d center;  ///< in the base frame at q = 0 [m]
  double radius = 0.0;     ///< [m]
};

/// The arm of a scene, its capsules as rows of balls, placed by the product of exponentials (SPEC §2): exp(S_1 q_1) …
/// exp(S_i q_i) moves a point of link i from where it is at q = 0.
class JudgedArm {
 public:
  /// Rows of balls lie within their capsules and reach to within this of their surfaces [m].
  static constexpr double capsule_gap_m = 1e-4;

  /// @throws Error as description::read_robot does
  explicit JudgedArm(const scene::Scene& scene);

  [[nodiscard]] std::size_t dof() const noexcept { return joints_.size(); }
  /// Those that move, then those of the base if the scene models self-collision.
  [[nodiscard]] const std::vector<JudgedBall>& balls() const noexcept { return balls_; }
  /// Those of the base, whatever the scene models.
  [[nodiscard]] const std::vector<JudgedBall>& base_balls() const noexcept { return base_balls_; }
  /// Pairs of balls that must not touch each other: of two parts that move against each other and are not listed as
  /// disabled; where a robot lists no pair at all, not of neighbouring links. None unless the scene models it.
  [[nodiscard]] const std::vector<std::pair<std::size_t, std::size_t>>& self_pairs() const noexcept {
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

/// Signed distance of a point from an obstacle where it is at a time [m]; inside it is minus the depth.
[[nodiscard]] double distance_from(const scene::Obstacle& obstacle, double time_s, const Eigen::Vector3d& p);

/// The occupied leaves of a map, as OctoMap itself lists them, at a time: changes of the scene's map are made as that
/// time passes theirs. Unknown space is free.
class JudgedMap {
 public:
  JudgedMap() = default;
  /// The map and its changes. @throws Error io, parse or invalid
  explicit JudgedMap(const scene::MapSpec& spec);
  /// The same without the voxels that a self-filter takes out: those that the robot touches, padded, at its start.
  JudgedMap(const scene::Scene& scene, const JudgedArm& arm);

  /// Makes the changes that are due, in the order listed: each frees voxels first, then occupies some.
  /// @param time_s not less than at the call before
  /// @return whether any was made
  bool advance(double time_s);
  /// Takes all leaves away; what changes occupy later is kept.
  void clear() { leaves_.clear(); }

  [[nodiscard]] const std::vector<scene::Box>& leaves() const noexcept { return leaves_; }
  /// Distance of a world point from the nearest leaf [m]; 0 inside, infinite without leaves. O(leaves).
  [[nodiscard]] double distance(const Eigen::Vector3d& p) const;
  /// The leaves at most that far from a world point [m].
  [[nodiscard]] std::vector<scene::Box> near(const Eigen::Vector3d& p, double distance) const;
  /// A world point in the map's frame [m].
  [[nodiscard]] Eigen::Vector3d local(const Eigen::Vector3d& p) const { return from_world_ * p; }

 private:
  /// Voxels from lo up to but not including hi.
  struct Voxels {
    std::array<int, 3> lo, hi;
  };
  struct Change {
    double time_s;
    std::vector<Voxels> free, occupied;
  };

  [[nodiscard]] Change read_change(const scene::MapChangeSpec& spec, const scene::MapSpec& map) const;
  [[nodiscard]] Voxels voxels_of(const scene::Box& leaf) const;
  [[nodiscard]] scene::Box box_of(const Voxels& voxels) const;
  void free(const std::vector<Voxels>& freed);

  std::vector<scene::Box> leaves_;  ///< in the map's frame [m]
  double voxel_m_ = 0.0;            ///< edge of the smallest leaf
  std::vector<Change> changes_;     ///< by time
  std::size_t made_ = 0;            ///< of the changes
  Eigen::Isometry3d from_world_ = Eigen::Isometry3d::Identity();
};

/// The smallest distance seen [m], when, and between which ball and what: an obstacle's name, "map", or another ball.
struct Closest {
  double clearance_m = 0.0, time_s = 0.0;
  std::string ball, other;
};

/// What a judge saw of a run.
struct Verdict {
  std::optional<Closest> obstacles;  ///< none where there is nothing to hit
  std::optional<Closest> self;       ///< of the arm from itself; none where the scene does not model that
  std::size_t configurations = 0;    ///< looked at

  [[nodiscard]] bool contact() const noexcept {
    return (obstacles && obstacles->clearance_m <= 0.0) || (self && self->clearance_m <= 0.0);
  }
};
/// {contact, obstacles, self, configurations}, each of the two {clearance_m, time_s, sphere, other} or null.
[[nodiscard]] Json to_json(const Verdict& verdict);

/// Follows a run node by node and looks at every configuration, and between two nodes at as many more as keep joints
/// within `step_rad` from one to the next. Obstacles are where they are at that time, and the map is as it is then. The
/// map's leaves count only where the scene has no obstacle that is judge_only: such obstacles are what the map was made
/// of, and the map is wider. What changes of the map occupy counts in any case.
class Judge {
 public:
  static constexpr double step_rad = 0.01;

  /// @throws Error as JudgedArm and JudgedMap do
  explicit Judge(const scene::Scene& scene);

  /// The next node: time [s] and joint vector [rad or m].
  void node(double time_s, const Eigen::VectorXd& q);
  [[nodiscard]] const Verdict& verdict() const noexcept { return verdict_; }

 private:
  /// A ball's distance from the map where it last was, and all leaves that can be the nearest around there.
  struct Nearby {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    double distance = 0.0;
    std::vector<scene::Box> leaves;
    bool known = false;
  };

  void look(double time_s, const Eigen::VectorXd& q);
  [[nodiscard]] double map_distance(std::size_t ball, double enough);

  JudgedArm arm_;
  std::vector<scene::Obstacle> obstacles_;
  std::vector<double> bounds_;  ///< of each obstacle: radius of the ball around it
  JudgedMap map_;
  std::vector<Nearby> nearby_;
  std::vector<Eigen::Vector3d> centers_;
  double best_, best_self_;  ///< smallest distances so far; infinite at first
  double last_time_s_ = 0.0;
  Eigen::VectorXd last_q_;
  Verdict verdict_;
};

/// Whether an arm can be at these configurations at all.
struct Feasibility {
  bool feasible = true;
  std::string reason;  ///< empty if it can
};

/// Start and goals against every occupied leaf of the map, every obstacle that is not judge_only at time 0, and the
/// arm itself where the scene models that; free means a distance above 0. The start is looked at in the map at time 0.
/// When the arm will be at a goal is not known: a goal is infeasible only if none of the maps from time 0 to the
/// scene's duration leaves room for it.
/// @param goals_q joint vectors to look at beside the scene's own joint goals
/// @throws Error as Judge
[[nodiscard]] Feasibility feasibility(const scene::Scene& scene, const std::vector<Eigen::VectorXd>& goals_q);

}  // namespace hamelin::sweep
