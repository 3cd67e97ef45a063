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
  void evaluate(const VectorXd& q, VectorXd& distances, MatrixXd& gradients) override;

 private:
  void add_contacts(const VectorXd& q, VectorXd& distances, MatrixXd& gradients);
  void add_pairs(const VectorXd& q, VectorXd& distances, MatrixXd& gradients);

  static constexpr Eigen::Index points_per_shape = 2;
  const model::Model& model_;
  control::WorldView& view_;
  Eigen::Index shapes_, pairs_, rows_;
  dynamics::Workspace ws_;
  std::vector<scene::Contact> contacts_;
  std::vector<scene::SelfContact> pair_contacts_;
  std::vector<Eigen::Index> found_;  ///< points of each shape
  VectorXd row_;
};

}  // namespace hamelin::optimal
