#pragma once
#include <Eigen/Core>
#include <limits>
#include <vector>

#include "hamelin/search/margins.hpp"
#include "kernel/line_lanes.hpp"

namespace hamelin::search {

/// Margins on lines: a copy of Margins as the kernels of LineCheck and exact proofs need it.
class LineMargins {
 public:
  /// The largest and the least margin on a line [m], and its weighted length.
  struct Range {
    double most, least, length;
  };

  explicit LineMargins(Eigen::Index dof);

  /// Allocates only for more than 32 places.
  void set(const Margins& margins);
  /// Writes the margins on the line from a, along dq, for the kernels.
  /// @return false if too many places are near
  [[nodiscard]] bool write(const Eigen::VectorXd& a, const Eigen::VectorXd& dq, kernel::Line& line);
  [[nodiscard]] Range range(const Eigen::VectorXd& a, const Eigen::VectorXd& b);
  /// Pairs of parts keep no more than that [m].
  [[nodiscard]] double self_most_m() const noexcept { return self_most_; }

 private:
  struct Place {
    double margin, near, far;
  };
  [[nodiscard]] double distance_from(std::size_t place, const Eigen::VectorXd& q) const;
  [[nodiscard]] double margin_at(const Place& place, double distance) const;

  double full_ = 0.0, self_most_ = std::numeric_limits<double>::infinity();
  Eigen::VectorXd weights_, middle_;
  Eigen::MatrixXd place_q_;  // dof × places
  std::vector<Place> places_;
};

}  // namespace hamelin::search
