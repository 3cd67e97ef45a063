#pragma once
#include <Eigen/Core>

#include "hamelin/search/margins.hpp"

namespace hamelin::search {

/// What a search asks of the world. Used by one thread. Configurations are dof numbers [rad or m].
class Query {
 public:
  Query() = default;
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;
  virtual ~Query() = default;
  /// The smallest distance of the arm from obstacles and from itself [m]; anything below
  /// `at_least_m` if it is less than that.
  [[nodiscard]] virtual double clearance(const Eigen::VectorXd& q, double at_least_m) = 0;
  /// The smallest distance between parts of the arm that may not touch [m], or `most_m` if that is
  /// less.
  [[nodiscard]] virtual double self_clearance(const Eigen::VectorXd& q, double most_m) = 0;
  /// What the following motions must keep.
  virtual void set_margins(const Margins& margins) = 0;
  /// Whether the arm is proved to keep more than the margins on the straight joint motion from a to
  /// b, ends included.
  [[nodiscard]] virtual bool motion_clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b) = 0;
  /// How much work the calls so far took: the arm was placed so many times.
  [[nodiscard]] virtual long checks() const = 0;
};

}  // namespace hamelin::search
