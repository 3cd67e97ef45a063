#pragma once
#include <Eigen/Core>
#include <set>
#include <string>
#include <vector>

#include "hamelin/control/controller.hpp"
#include "hamelin/core/rng.hpp"

namespace hamelin::test {

/// Changes the world of a controller at random. What stands still appears only where it is at least
/// `fair_m` away from the arm and from the stop that is in force: no controller could avoid what
/// appears nearer. What moves may be anywhere; the arm need not get out of its way.
class WorldUpdates {
 public:
  static constexpr double fair_m = 0.03;

  /// @param arm_q where the arm is, kept by reference
  WorldUpdates(control::Controller& controller, const Eigen::VectorXd& arm_q, bool has_map,
               std::uint64_t seed);
  /// Makes one update at random, or none if it would be unfair. @return whether the world changed
  bool update(double time_s);
  [[nodiscard]] long refused() const noexcept { return refused_; }

 private:
  bool set_obstacle();
  bool move_obstacle(double time_s);
  bool remove_obstacle();
  bool change_map();
  bool update_wrongly(double time_s);
  [[nodiscard]] bool is_fair(const scene::Obstacle& obstacle);
  /// Where the arm is and where it may go before it rests.
  [[nodiscard]] std::vector<Eigen::VectorXd> configurations() const;
  [[nodiscard]] std::string random_name();

  control::Controller& controller_;
  const Eigen::VectorXd& arm_q_;
  bool has_map_;
  Rng rng_;
  std::vector<scene::Obstacle> present_;
  long refused_ = 0;
};

}  // namespace hamelin::test
