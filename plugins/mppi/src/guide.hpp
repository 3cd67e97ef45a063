#pragma once
#include <Eigen/Core>
#include <array>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "joint_path.hpp"
#include "margins.hpp"
#include "task.hpp"

namespace hamelin::mppi {

/// Searches a collision-free path to a goal in joint space by two trees that grow towards each
/// other (Kuffner and LaValle 2000, doi 10.1109/ROBOT.2000.844730) and shortens it. It works in
/// increments that are counted in queries of clearance, so that results do not depend on time.
class Guide {
 public:
  /// @param budget number of queries after which a search ends without a path
  Guide(const planning::Setup& setup, const model::Model& model, const Margins& margins,
        const dynamics::JointBox& box, const Eigen::VectorXd& levers, long budget);

  /// Starts a search from q. @param number distinguishes the random numbers of searches
  /// @param reserve_m clearance at goals of the tip in addition, as far as it is found
  void begin(const Goal& goal, const Eigen::VectorXd& q, std::uint64_t seed, std::uint64_t number,
             double reserve_m);
  /// Continues until the search ends or has used this number of queries since begin().
  void advance(planning::Query& query, long checks);
  void stop() noexcept { phase_ = Phase::idle; }

  [[nodiscard]] bool searches() const noexcept { return phase_ != Phase::idle; }
  [[nodiscard]] long checks() const noexcept { return checks_; }
  /// The path that was found, once the search has ended; empty without success.
  [[nodiscard]] const JointPath& path() const noexcept { return path_; }
  /// The places at which the search may end, with their clearances.
  [[nodiscard]] int root_count() const noexcept { return root_count_; }
  [[nodiscard]] const Eigen::VectorXd& root(int i) const { return roots_[to_size(i)].q; }
  [[nodiscard]] double root_clearance(int i) const { return roots_[to_size(i)].clearance; }

 private:
  static std::size_t to_size(Eigen::Index n) { return static_cast<std::size_t>(n); }
  enum class Phase { idle, start, roots, grow, shorten };
  struct Root {
    Eigen::VectorXd q;
    double clearance = 0.0;
  };
  struct Tree {
    Eigen::MatrixXd q;  ///< one column per node
    std::vector<int> parent;
    int size = 0;
    void add(const Eigen::VectorXd& node, int from);
    [[nodiscard]] int nearest(const Eigen::VectorXd& to) const;
  };

  void measure_start(planning::Query& query);
  void find_root(planning::Query& query);
  [[nodiscard]] double clearance_of_attempts(int quarter) const;
  void add_root(planning::Query& query, const Eigen::VectorXd& q);
  void draw_near_goal();
  void draw_target();
  void grow(planning::Query& query);
  bool extend(planning::Query& query, Tree& tree, const Eigen::VectorXd& target);
  bool connect(planning::Query& query, Tree& tree, const Eigen::VectorXd& target);
  void join(int in_start, int in_goal);
  void shorten(planning::Query& query);
  [[nodiscard]] double clearance(planning::Query& query, const Eigen::VectorXd& q, double at_least);
  [[nodiscard]] bool motion_clear(planning::Query& query, const Eigen::VectorXd& from,
                                  const Eigen::VectorXd& to);

  double shield_m_, reserve_m_ = 0.0;
  dynamics::InverseKinematics kinematics_;
  const dynamics::JointBox& box_;
  Eigen::VectorXd levers_;
  Margins margins_;
  long budget_, checks_ = 0;
  Rng rng_{0};
  Phase phase_ = Phase::idle;
  Goal goal_, near_goal_;  ///< and a pose within its tolerances
  std::array<Root, Margins::max_goals> roots_;
  int root_count_ = 0, attempt_ = 0, cut_ = 0;
  std::array<Tree, 2> trees_;  ///< from the start, and from the roots
  int side_ = 0;
  JointPath path_, draft_;
  Eigen::VectorXd start_, x_, from_, at_, target_;
};

}  // namespace hamelin::mppi
