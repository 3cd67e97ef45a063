#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::control {

/// Proves that the arm stays clear of all that stands still, and of itself, on straight joint lines
/// q + s Δq that differ little from one call to the next: docs/theory.md (14.5)–(14.8). A shape
/// stays within the tube of radius κ/8 + Σ_j l_j σ_j around the chord between its ends, where σ_j
/// bounds how far joint j strays from the line. Each shape remembers a chord with its distance from
/// the obstacles, its anchor: a chord that lies within that distance of the anchor needs no query.
/// One object per thread and kind of line. No allocation after construction.
class LineCheck {
 public:
  /// The lines of a shape or pair that began nearer than need be, since the last time when it had
  /// come far enough away.
  struct Begun {
    double distance = -1.0;  ///< the largest at the beginning of any of them
    double need = 0.0;       ///< the largest that any of them needed
  };

  /// @param levers of the model, kept by reference
  /// @param self null if self-collision is not modelled
  LineCheck(const model::Model& model, const scene::Levers& levers, const scene::SelfField* self);

  /// One end of a line.
  struct End {
    const Eigen::VectorXd& q;
    scene::Shapes arm;  ///< all shapes at q
  };
  /// What is not proved to stay clear.
  struct Blocker {
    int shape = -1;                      ///< that may touch an obstacle, or −1
    int obstacle = scene::Contact::map;  ///< as Contact::obstacle
    int pair = -1;                       ///< of parts that may touch each other, or −1
    double missing_m = 0.0;              ///< by how much the bound falls short of the margin
  };

  /// How far the arm may be from the line.
  struct Stray {
    const Eigen::VectorXd& joints;    ///< σ [rad or m]
    const Eigen::VectorXd& shapes_m;  ///< of each shape, in addition; of size zero: none
    const Eigen::VectorXd& errors;    ///< of each joint, that move the shapes by these [rad or m]
    double margin_m = 0.0;            ///< distance that must remain to obstacles and between parts
  };
  /// @param obstacles null: only pairs of parts are checked
  /// @return the first that is found; none if the line is proved clear
  [[nodiscard]] std::optional<Blocker> check(dynamics::Workspace& ws,
                                             const scene::Environment* obstacles, double time_s,
                                             const End& from, const End& to, const Stray& stray);
  /// By how much two parts of the arm may come nearer to each other than they seem, the most of all
  /// pairs, with the margin [m].
  [[nodiscard]] double largest_pair_stray(const Stray& stray) const;
  /// Forgets all anchors, because obstacles have changed.
  void forget();

  /// Σ_j l_j σ_j and the addition of the last check, the largest of any shape [m].
  [[nodiscard]] double largest_stray_m() const {
    return straying_.size() > 0 ? straying_.maxCoeff() : 0.0;
  }
  /// Distance queries since the start, for benchmarks and tests.
  [[nodiscard]] long queries() const noexcept { return queries_; }
  /// The lower bound of the distance of a shape's chord from all obstacles that its anchor gives,
  /// for tests; the chord is that of the last check [m].
  [[nodiscard]] double anchored_bound(std::size_t shape, const End& from, const End& to) const;

 private:
  /// A chord (of a capsule: an axis) and a distance that nothing is nearer to it.
  struct Anchor {
    Eigen::Vector3d a = Eigen::Vector3d::Zero(), b = Eigen::Vector3d::Zero();
    double distance = -1.0;  ///< negative: none
    std::int32_t hint = -1;
  };
  /// The shapes at the division points of the line, placed when first needed.
  struct Division {
    Eigen::VectorXd q;
    scene::PlacedShapes arm;
    bool placed = false;
  };
  static constexpr int pieces_max = 16;

  /// The largest addition of two shapes that belong to a pair of parts.
  [[nodiscard]] double pair_addition(Eigen::Index pair, const Stray& stray) const;
  /// How far shape i may be from its anchor's chord.
  [[nodiscard]] double moved(std::size_t shape, const scene::Shapes& from,
                             const scene::Shapes& to) const;
  bool shape_is_clear(std::size_t shape, Blocker& blocker);
  bool sphere_is_clear(std::size_t shape, Blocker& blocker);
  bool capsule_is_clear(std::size_t shape, Blocker& blocker);
  /// Tube radius, margin and own radius of a shape on a piece of length 1/pieces.
  [[nodiscard]] double need(std::size_t shape, int pieces) const;
  /// The same without margin and straying, which even an arm that leads away must keep.
  [[nodiscard]] double least(std::size_t shape, int pieces) const;
  bool pair_is_clear(std::size_t pair, Blocker& blocker);
  /// The shapes at i/pieces of the line.
  scene::Shapes at(int i, int pieces);
  scene::Environment::Standing query(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                     double limit, std::int32_t& hint);

  const model::Model& model_;
  const scene::Levers& levers_;
  const scene::SelfField* self_;
  std::vector<Anchor> anchors_;
  std::vector<Begun> begun_, pairs_begun_;  ///< of shapes, and of pairs
  Eigen::MatrixXd pair_q_;                  ///< dof × pairs: where their distances were found
  Eigen::VectorXd pair_distance_;           ///< there; negative: none
  long queries_ = 0;

  // of the line that is checked
  dynamics::Workspace* ws_ = nullptr;
  const scene::Environment* obstacles_ = nullptr;
  double time_s_ = 0.0, margin_ = 0.0;
  const End *from_ = nullptr, *to_ = nullptr;
  Eigen::VectorXd dq_, curvature_, tube_, way_;
  Eigen::VectorXd bend_, straying_;  ///< per shape: κ/8, and Σ_j l_j σ_j
  Eigen::VectorXd pair_stray_;       ///< per pair
  std::vector<Division> divisions_;  ///< at 1/16 … 15/16
};

}  // namespace hamelin::control
