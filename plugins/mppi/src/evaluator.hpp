#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "spline.hpp"
#include "task.hpp"

namespace hamelin::mppi {

/// Computes the costs of rollouts and checks motions. It belongs to one thread at a time; its query
/// is refreshed on the thread of the tick. Only the constructor and refresh allocate.
class Evaluator {
 public:
  Evaluator(const planning::Host& host, const planning::Setup& setup, const model::Model& model,
            Eigen::Index point_count);

  void refresh() { (void)query_.refresh(); }
  [[nodiscard]] planning::Query& query() noexcept { return query_; }
  /// Sets cost, clearance and collision of rollouts, docs/theory.md (15.6): begin() does what SIMD
  /// lanes do together, evaluate() the rest of one lane of the same rollouts.
  void begin(const Task& task, Rollouts& rollouts);
  void evaluate(const Task& task, Rollouts& rollouts, Eigen::Index lane);
  /// Whether the motion of these control points is proved clear, docs/theory.md (15.14), and within
  /// the torque limits.
  [[nodiscard]] bool verify(const Task& task, const Eigen::MatrixXd& points);

 private:
  void place(const Rollouts& rollouts, double spacing_s);
  void add_torques(const Task& task, Rollouts& rollouts);
  void add_progress(const Task& task, Rollouts& rollouts, Eigen::Index lane);
  void add_clearance(const Task& task, Rollouts& rollouts, Eigen::Index lane);
  void add_mover_clearance(const Task& task, Rollouts& rollouts, Eigen::Index lane);
  [[nodiscard]] double time_to_go(const Task& task, const Eigen::VectorXd& q);
  [[nodiscard]] double clearance(const Eigen::VectorXd& q, double time_ahead_s, double at_least_m);
  [[nodiscard]] bool within_torques();
  struct Part {
    double from, to;  ///< of a segment, 0 to 1
  };
  [[nodiscard]] bool proved_clear(const Eigen::MatrixXd& points, Eigen::Index segment, Part part,
                                  const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                                  std::size_t depth);
  void get_place(Eigen::Index half, Eigen::Index lane);

  planning::Setup setup_;
  const model::Model& model_;
  dynamics::Workspace ws_;
  dynamics::BatchWorkspace batch_;
  planning::Query query_;
  Eigen::VectorXd levers_;
  Eigen::Index dof_, segments_;
  dynamics::StatesXd q_, v_, a_, torque_;  ///< at the knots, lane by lane within a knot
  Eigen::Array<double, lane_count, Eigen::Dynamic> halves_;  ///< places at all half knots
  Eigen::Array<double, lane_count, Eigen::Dynamic> paths_;   ///< bound of each way between them [m]
  double spacing_s_ = 0.0;                                   ///< of what was placed last
  Eigen::VectorXd at_, from_;
  std::vector<JointState> middles_;  ///< one per depth of proved_clear()
  Rollouts single_;
};

}  // namespace hamelin::mppi
