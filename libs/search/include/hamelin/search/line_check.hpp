#pragma once
#include <Eigen/Core>
#include <limits>
#include <memory>
#include <optional>

#include "hamelin/model/model.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/search/margins.hpp"

namespace hamelin::search {

/// Proves that the arm keeps its margins on straight joint motions, as the edges of a search:
/// docs/theory.md (17.10)–(17.16). Sixteen pieces of a motion are examined at once, in single
/// precision with a bound of its rounding, against the map's DistanceField. Pieces that remain open
/// are divided by four, twice; what is open then is proved by EdgeCheck. Answers are the same on
/// all instruction sets. One object per thread. No allocation after construction, except in
/// set_environment() if the map's field was not made yet.
///
/// A whole motion is left to EdgeCheck if the map has no field, if the arm has more than 16 joints,
/// 64 parts, 256 pairs of parts or 512 spheres (a capsule counts as a chain of them), if there are
/// more than 64 obstacles beside the map, if a motion is near more than 32 places of the margins,
/// and if it moves a joint by more than 8 rad or beyond the travel of a prismatic joint (2 m if the
/// robot states no limits).
class LineCheck {
 public:
  /// @param model must outlive this @param self null if self-collision is not modelled
  LineCheck(const model::Model& model, const scene::SelfField* self);
  LineCheck(LineCheck&&) noexcept;
  LineCheck& operator=(LineCheck&&) noexcept;
  ~LineCheck();

  /// The obstacles of the following checks; must stay until the next call. Obstacles that move
  /// stand where they are at that time; without `movers` they are left out.
  void set_environment(const scene::Environment& environment, double time_s, bool movers = true);
  /// The margins of the following calls; copied. Allocates only for more than 32 places.
  void set_margins(const Margins& margins);
  /// Whether the arm is proved to keep more than the margins on the straight joint motion from a to
  /// b (dof numbers each [rad or m]); false also if there is no proof.
  [[nodiscard]] bool motion_clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    begin_motion(a, b);
    return *prove(std::numeric_limits<long>::max());
  }
  /// Begins such a proof, in place of any that was begun before.
  void begin_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b);
  /// Continues what was begun, for so many checks, at least one and at most two more.
  /// @return whether the motion is clear, or nothing as long as that is open
  [[nodiscard]] std::optional<bool> prove(long checks);
  /// Batches of 16 pieces and postures of exact checks since the start, for limits of searches.
  [[nodiscard]] long checks() const noexcept;

  /// Counts of what decided, since the start.
  struct Counts {
    long batches = 0;      ///< of 16 pieces
    long exact = 0;        ///< distances of single points from the map
    long last_resort = 0;  ///< pieces that EdgeCheck proved or not
    long whole = 0;        ///< motions that were left to EdgeCheck as wholes
  };
  [[nodiscard]] const Counts& counts() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace hamelin::search
