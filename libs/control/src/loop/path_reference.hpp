#pragma once
#include <Eigen/Core>

#include "hamelin/control/live_reference.hpp"
#include "shield/certified_path.hpp"

namespace hamelin::control {

/// Where an arm should be on a certified path from tick to tick, docs/theory.md (19.10): its clock
/// runs at full rate, slower while the arm is away from it, and is set to where the arm is after it
/// was held up. It belongs to the thread of the ticks, and neither allocates nor locks.
class PathReference {
 public:
  explicit PathReference(Eigen::Index dof);

  /// Starts on a path, which must stay until the next start() or stop().
  void start(const CertifiedPath& path, const timing::TimedPath::Place& place) noexcept;
  void stop() noexcept { path_ = nullptr; }
  [[nodiscard]] const CertifiedPath* path() const noexcept { return path_; }

  /// What a tick knows.
  struct Now {
    double period_s;
    const Eigen::VectorXd &q, &v;  ///< of the arm
    bool held_up;                  ///< whether the last step was refused
    double rate_max;               ///< of the clock
  };
  /// Moves on by a period, not at the first call after start().
  const ReferenceState& update(const Now& now);
  [[nodiscard]] const ReferenceState& state() const noexcept { return state_; }
  /// Where it will be at the next tick if nothing changes.
  [[nodiscard]] timing::TimedPath::Place next(double period_s) const noexcept {
    return {state_.time_s + period_s * state_.rate, state_.rate};
  }

 private:
  void move_on(double period_s, double rate_max);
  /// The same where the change of the rate may not jump.
  void move_on_with_ramps(double period_s, double rate_max);
  void evaluate();
  /// The largest change of the rate that the limits of the path allow, at most `most` [1/s].
  [[nodiscard]] double largest_rise(double most) const;

  const CertifiedPath* path_ = nullptr;
  ReferenceState state_;
  bool started_ = false;
  double rate_change_ = 0.0;  ///< ρ̇ [1/s]
  timing::TimedPath::Cursor cursor_;
};

}  // namespace hamelin::control
