#pragma once
#include <Eigen/Core>
#include <limits>
#include <optional>

#include "hamelin/search/margins.hpp"

namespace hamelin::search {

class TipConstraints;

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
  /// Begins to prove that the arm keeps more than the margins on the straight joint motion from a
  /// to b, ends included, in place of any proof that was begun before.
  virtual void begin_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b) = 0;
  /// Continues what was begun, for about so many checks, at least one.
  /// @return whether the motion is clear, or nothing as long as that is open
  [[nodiscard]] virtual std::optional<bool> prove(long checks) = 0;
  /// Both, to the end.
  [[nodiscard]] bool motion_clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    begin_motion(a, b);
    return *prove(std::numeric_limits<long>::max());
  }
  /// What the tip keeps on motions that are proved; null: nothing.
  [[nodiscard]] virtual TipConstraints* constraints() noexcept { return nullptr; }
  /// How much work the calls so far took: the arm was placed so many times.
  [[nodiscard]] virtual long checks() const = 0;
};

}  // namespace hamelin::search
