#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "hamelin/log/result.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/search/tip_constraints.hpp"

namespace hamelin::simulation {

/// What the tip keeps on the way to each goal, at nodes and between them.
class ConstraintAudit {
 public:
  /// Both must outlive this.
  ConstraintAudit(const scene::Scene& scene, const model::Model& model);

  /// The arm carries something else: its model has changed, in place.
  void take_load();
  /// Motions that leave the last node lead to this goal.
  void set_goal(std::size_t goal) noexcept { goal_ = goal; }
  void observe(const Eigen::VectorXd& q, double time_s);
  /// Of each constraint of each goal that was the current one, in their order.
  [[nodiscard]] std::vector<log::Result::Constraint> figures() const;
  /// One line for each that was not kept.
  [[nodiscard]] std::vector<std::string> violations() const;

 private:
  struct Goal {
    std::unique_ptr<search::TipConstraints> kept;  ///< null: none
    double speed_max_m_s = 0.0;
    std::vector<log::Result::Constraint> figures;
    bool seen = false;
  };
  const scene::Scene& scene_;
  const model::Model& model_;
  std::vector<Goal> goals_;
  std::size_t goal_ = 0;
  Eigen::VectorXd last_;  ///< of size zero before the first node
  double last_s_ = 0.0;
  std::vector<double> by_;
};

}  // namespace hamelin::simulation
