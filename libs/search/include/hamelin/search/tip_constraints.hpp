#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "hamelin/scene/goal.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/scene/tip_constraint.hpp"
#include "hamelin/search/tip_curve.hpp"

namespace hamelin::search {

/// What plans leave of an angle [rad], and of each side of a box [m], for an arm that strays.
[[nodiscard]] double plan_reserve(const scene::AxisConstraint& axis) noexcept;
[[nodiscard]] Eigen::Vector3d plan_reserve(const scene::BoxConstraint& box) noexcept;

class TipRule;

/// What the tip keeps on a path, docs/theory.md, chapter 21: measures it, proves it on straight
/// joint motions and brings configurations to where it is kept. Plans use somewhat less than the
/// tolerances, so that an arm that strays from its path keeps them. One thread. Only the
/// constructor and project() allocate.
class TipConstraints {
 public:
  /// @param model must outlive this
  /// @throws Error invalid as scene::check() does, "constraint 1: what is wrong"
  TipConstraints(const model::Model& model, const std::vector<scene::TipConstraint>& constraints);
  /// Deleted: a temporary model is gone before any call could use it.
  TipConstraints(const model::Model&& model, const std::vector<scene::TipConstraint>&) = delete;

  TipConstraints(const TipConstraints&) = delete;
  TipConstraints& operator=(const TipConstraints&) = delete;
  ~TipConstraints();

  struct Ball {
    Eigen::Vector3d center_m;
    double radius_m;
  };
  /// Adds that the tip keeps to a curve and its rotation. @param within only where its point is in
  /// a ball; none: everywhere, and without going back
  void add(const TipCurve& curve, const scene::WayTolerance& tolerance,
           const std::optional<Ball>& within = {});

  /// How many are kept by paths: all but those of speed, which are kept by motions.
  [[nodiscard]] std::size_t size() const noexcept { return rules_.size(); }
  /// Which of the given ones it is; the first has number 1.
  [[nodiscard]] std::size_t number(std::size_t k) const noexcept { return numbers_[k]; }
  /// Where the tip is beyond a tolerance.
  struct Excess {
    std::size_t constraint = 0;
    double by = 0.0;  ///< [rad or m]; 0 or less: all are kept
  };
  /// The largest excess at q.
  [[nodiscard]] Excess excess(const Eigen::VectorXd& q);
  /// The largest excess of a tip at a target; an axis counts only if its rotation does.
  [[nodiscard]] Excess excess(const dynamics::TipTarget& target) const;
  /// In words: "constraint 1 (axis) is exceeded by 0.12 rad".
  [[nodiscard]] std::string describe(const Excess& excess) const;
  /// Upper bounds of the excess of each constraint on the straight joint motion from a to b, [rad]
  /// of an axis or [m] of a box, which are exact if both are equal.
  void measure(const Eigen::VectorXd& a, const Eigen::VectorXd& b, std::vector<double>& by);

  /// An upper bound of the way of the tip's point on the straight joint motion from a to b, per
  /// unit of its parameter, everywhere on it [m].
  [[nodiscard]] double largest_way(const Eigen::VectorXd& a, const Eigen::VectorXd& b);

  /// Plans may also use what a configuration uses, as the start of a path, and somewhat more, up to
  /// the tolerances.
  void admit(const Eigen::VectorXd& q);
  /// Whether a plan may pass a configuration.
  [[nodiscard]] bool keeps(const Eigen::VectorXd& q);
  /// Whether a plan keeps all constraints on the straight joint motion from a to b, ends included,
  /// also where joints stray from it by so much; false also if there is no proof.
  [[nodiscard]] bool motion_keeps(const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                                  const Eigen::VectorXd& stray);
  /// Moves a configuration to a near one that a plan may pass. @return whether it may now
  [[nodiscard]] bool project(Eigen::VectorXd& q, const dynamics::JointBox& box);
  /// Moves a target to where a tip keeps each of the constraints. One without a rotation gets that
  /// of the tip at `seed` if an axis is kept.
  void restrict(dynamics::TipTarget& target, const Eigen::VectorXd& seed);
  /// The share of what plans leave of the tolerances that a deviation of the joints uses.
  [[nodiscard]] double reserve_used(const Eigen::VectorXd& deviation) const;
  /// How often the tip was placed.
  [[nodiscard]] long checks() const noexcept { return checks_; }

 private:
  using Values = std::vector<Eigen::Matrix<double, 6, 1>>;
  static constexpr int depth_max = 12;

  void add(std::unique_ptr<TipRule> rule, std::size_t number);
  /// Sets by how much values may stray on a motion.
  void set_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b, const Eigen::VectorXd& stray);
  void place(const Eigen::VectorXd& q, Values& out);
  /// By how much a deviation of the joints turns the tip at most.
  [[nodiscard]] double turn_of(const Eigen::VectorXd& deviation) const;
  /// Whether plans keep all on a piece of a motion, of some width.
  [[nodiscard]] bool plans_keep(const Values& a, const Values& b, double width) const;
  [[nodiscard]] bool piece_keeps(double from, double to, const Values& a, const Values& b,
                                 int depth);

  const model::Model& model_;
  scene::Levers levers_;
  dynamics::Workspace ws_;
  geometry::SE3 tip_;
  std::vector<std::unique_ptr<TipRule>> rules_;
  std::vector<std::size_t> numbers_;
  Values from_, to_;
  std::array<Values, depth_max> middle_;
  Eigen::VectorXd start_, dq_, q_, curvature_, step_, error_;
  double bend_rad_ = 0.0, bend_m_ = 0.0, stray_rad_ = 0.0, stray_m_ = 0.0;
  dynamics::Matrix6Xd J_;
  Eigen::MatrixXd rows_;
  long checks_ = 0;
};

}  // namespace hamelin::search
