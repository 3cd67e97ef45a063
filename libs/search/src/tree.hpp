#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace hamelin::search {

/// A tree of configurations. Nearest neighbours are searched linearly, 16 nodes at a time, in
/// single precision and in order, so that results are the same everywhere.
class Tree {
 public:
  /// @param weights of the joints in distances @param nodes that it can hold before it allocates
  Tree(const Eigen::VectorXd& weights, std::size_t nodes);

  void clear() noexcept;
  /// @param parent an earlier node; −1 for a root @return the node's index
  int add(const Eigen::VectorXd& q, int parent);
  [[nodiscard]] int nearest(const Eigen::VectorXd& q) const;
  [[nodiscard]] int size() const noexcept { return static_cast<int>(parents_.size()); }
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> q(int node) const {
    const auto n = weights_.size();
    return {q_.data() + node * n, n};
  }
  [[nodiscard]] int parent(int node) const { return parents_[static_cast<std::size_t>(node)]; }

 private:
  static constexpr std::size_t block = 16;
  Eigen::VectorXd weights_;
  std::vector<double> q_;
  std::vector<float> weighted_;  ///< blocks of dof × 16
  std::vector<int> parents_;
};

}  // namespace hamelin::search
