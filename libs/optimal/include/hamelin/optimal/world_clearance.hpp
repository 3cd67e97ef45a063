#pragma once
#include <vector>

#include "hamelin/control/world_view.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/optimal/problem.hpp"

namespace hamelin::optimal {

/// Distances of the arm's shapes from the obstacles that stand still, and of its parts from each
/// other: for each shape its two nearest points, so that a shape between two walls keeps off both,
/// and for each pair of parts one.
class WorldClearance final : public Clearance {
 public:
  /// @param view says up to which distance; both must outlive this
  WorldClearance(const model::Model& model, control::WorldView& view);
  [[nodiscard]] Eigen::Index rows() const override { return rows_; }
  [[nodiscard]] const VectorXd& far() const override { return far_; }
  void evaluate(const VectorXd& q, NearDistances& near) override;

 private:
  void add_contacts(const VectorXd& q, NearDistances& near);
  void add_pairs(const VectorXd& q, NearDistances& near);

  static constexpr Eigen::Index points_per_shape = 2;
  const model::Model& model_;
  control::WorldView& view_;
  Eigen::Index shapes_, pairs_, rows_;
  VectorXd far_;
  dynamics::Workspace ws_;
  std::vector<scene::Contact> contacts_;
  std::vector<scene::SelfContact> pair_contacts_;
  std::vector<Eigen::Index> found_;  ///< points of each shape
  VectorXd gradient_, second_;
};

}  // namespace hamelin::optimal
