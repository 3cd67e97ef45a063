#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::search {

/// Proves that the arm keeps a margin on straight joint motions, which may be long and have nothing
/// to do with each other, as the edges of a search: docs/theory.md (17.2)–(17.4). A motion is
/// bisected, but only for those shapes and pairs of parts that are not proved on the piece yet.
/// Obstacles that move are taken to stand where they are. One object per thread. No allocation
/// after construction.
class EdgeCheck {
 public:
  /// A piece is not bisected again for a shape that strays by no more than this from what was
  /// measured [m].
  static constexpr double resolution_m = 1e-4;

  /// @param self null if self-collision is not modelled
  EdgeCheck(const model::Model& model, const scene::SelfField* self);

  /// The obstacles of the following checks; must stay until the next call. Without `movers`, those
  /// that move are left out.
  void set_environment(const scene::Environment& environment, double time_s, bool movers = true);
  /// Pairs of parts keep no more than that in the following checks [m].
  void set_self_most(double most_m) noexcept { self_most_ = most_m; }
  /// The smallest distance between parts of the arm at q [m], or `most_m` if that is less.
  [[nodiscard]] double self_clearance(const Eigen::VectorXd& q, double most_m);
  /// Whether all distances are more than the margin on the line from a to b, ends included; false
  /// also if there is no proof.
  [[nodiscard]] bool motion_clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                                  double margin_m) {
    return motion_clear(a, b, margin_m, all_);
  }
  /// The same for some shapes and pairs of parts only.
  /// @param subjects shapes by their index in Model::shapes(), pairs by their index in
  ///        SelfField::pairs() plus the number of shapes
  [[nodiscard]] bool motion_clear(const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                                  double margin_m, std::span<const int> subjects) {
    begin_motion(a, b, margin_m, subjects);
    return *prove(std::numeric_limits<long>::max());
  }
  /// Begins such a proof, in place of any that was begun before; any other call but prove() and
  /// checks() ends it without an answer. @param subjects must stay
  void begin_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double margin_m,
                    std::span<const int> subjects);
  void begin_motion(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double margin_m) {
    begin_motion(a, b, margin_m, all_);
  }
  /// Continues what was begun, for so many postures, at least one and at most two more.
  /// @return whether the motion is clear, or nothing as long as that is open
  [[nodiscard]] std::optional<bool> prove(long postures);
  /// Whether all distances are at least the margin at q.
  [[nodiscard]] bool posture_clear(const Eigen::VectorXd& q, double margin_m) {
    return posture_clear(q, margin_m, all_);
  }
  /// Postures at which the arm was placed since the start.
  [[nodiscard]] long checks() const noexcept { return checks_; }

 private:
  static constexpr int depth_max = 16;
  struct Piece {
    double at, width;  ///< start and width in s, 0 to 1
    scene::Shapes from, to;
  };
  /// A piece of which something is not proved.
  struct Level {
    scene::PlacedShapes arm;  ///< in the middle
    std::vector<int> open;    ///< shapes, and behind them pairs of parts
    Piece piece;
    int halves = 0;  ///< that were examined
  };
  void place(const Eigen::VectorXd& q, scene::PlacedShapes& arm);
  [[nodiscard]] bool posture_clear(const Eigen::VectorXd& q, double margin_m,
                                   std::span<const int> subjects);
  /// Whether a shape or pair keeps the margin at a posture.
  [[nodiscard]] bool keeps_margin(int subject, const scene::Shapes& arm, double margin_m);
  /// Examines the ends and the whole, or the next half of the piece that is open last.
  /// @return false if there is no proof
  [[nodiscard]] bool next();
  /// Examines a piece, and adds a level if something is open. @return false if there is no proof
  [[nodiscard]] bool examine(const Piece& piece, std::span<const int> subjects);
  [[nodiscard]] bool proved(const Piece& piece, int subject, const scene::Shapes& middle);
  /// How far a shape, or the shapes of a pair, may stray on a piece from where they were measured.
  [[nodiscard]] double stray(const Piece& piece, int subject) const;
  [[nodiscard]] int shape_count() const noexcept { return static_cast<int>(hints_.size()); }

  const model::Model& model_;
  const scene::SelfField* self_;
  scene::Levers levers_;
  const scene::Environment* environment_ = nullptr;
  double time_s_ = 0.0, margin_ = 0.0;
  double self_most_ = std::numeric_limits<double>::infinity();
  bool obstacles_ = false, movers_ = false;
  std::vector<std::int32_t> hints_;  ///< of each shape, for the map
  std::vector<int> all_;             ///< all subjects
  dynamics::Workspace ws_;
  Eigen::VectorXd start_, end_, dq_, q_, curvature_, bend_, way_, pair_way_;
  scene::PlacedShapes first_, last_;
  std::span<const int> subjects_;  ///< of the proof that goes on
  std::vector<Level> levels_;
  int open_levels_ = 0;
  bool begins_ = true;  ///< nothing was examined yet
  long checks_ = 0;
};

}  // namespace hamelin::search
