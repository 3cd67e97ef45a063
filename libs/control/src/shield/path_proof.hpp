#pragma once
#include <Eigen/Core>

#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/search/edge_check.hpp"
#include "shield/certified_path.hpp"

namespace hamelin::control {

/// What is proved of a certified path in the world as it is now: all of it in the world for which
/// it was made, and after a change what has been proved again, interval by interval from where the
/// arm is. No allocation after construction.
class PathProof {
 public:
  /// @param levers of the model, kept by reference @param self null if it is not modelled
  PathProof(const model::Model& model, const scene::Levers& levers, const scene::SelfField* self);

  /// Another path, proved as it says; null: none. The path must stay.
  void set(const CertifiedPath* path);
  [[nodiscard]] const CertifiedPath* path() const noexcept { return path_; }
  /// The world is another one now, in which the same stands still. It must stay until the next one.
  void see(const scene::Environment& environment, double time_s);
  /// The same where what stands still has changed: what is proved of the path is void.
  /// @param first interval of the arm
  void forget(const scene::Environment& environment, double time_s, Eigen::Index first);
  /// Goes on with the proof, interval by interval until so many checks are made.
  void advance(long checks);
  /// Whether the intervals from first to last are proved.
  [[nodiscard]] bool covers(Eigen::Index first, Eigen::Index last) const noexcept {
    return first >= first_ && last < end_;
  }
  /// Whether an interval is found not to be clear.
  [[nodiscard]] bool blocked() const noexcept { return blocked_; }
  /// The interval behind the last that is proved.
  [[nodiscard]] Eigen::Index end() const noexcept { return end_; }
  /// What the arm keeps on intervals that are proved, at least [m].
  [[nodiscard]] double clearance_m(Eigen::Index first, Eigen::Index last) const;
  [[nodiscard]] double self_m(Eigen::Index first, Eigen::Index last) const;

 private:
  /// Whether the next interval keeps share_ of its margins.
  [[nodiscard]] bool prove();

  const scene::Levers& levers_;
  search::EdgeCheck edges_;
  const CertifiedPath* path_ = nullptr;
  Eigen::Index first_ = 0, end_ = 0;
  bool again_ = false, blocked_ = false;
  double share_ = 1.0;    ///< of the margin that is asked for
  Eigen::VectorXd kept_;  ///< share of the margins that is proved, per interval
  Eigen::VectorXd q0_, q1_, bend_;
};

}  // namespace hamelin::control
