#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "hamelin/control/levers.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::control {

/// Proves that the motion between two nodes stays clear: chapter 12 of docs/theory.md. The motion
/// is assumed to follow the joint-space line q + s Δq, from which joint j deviates by at most σ_j,
/// docs/theory.md (12.1), (12.2). Let the axis of a shape move by the chord Δc during the step h,
/// with clearances d and d⁺ at the nodes, and let u be the largest speed of an obstacle. Then, by
/// docs/theory.md (12.7), every clearance on the step is at least
///
///     (d + d⁺ − |Δc| − u h)/2 − κ/8 − Σ_j l_j σ_j.
///
/// l_j bounds how far joint j moves the shape, docs/theory.md (12.3), and κ its second derivative
/// along the line, docs/theory.md (12.5). If the bound is not positive, the line is bisected, and
/// each piece is bounded by the speed at its middle, docs/theory.md (12.10), until it is proved or
/// no longer than `resolution_m`. Pairs of parts of the arm are treated in the frame of the part
/// nearer to the base: only the joints between the two move the other part.
class Certificate {
 public:
  /// A piece of a step's path this short is not bisected again [m].
  static constexpr double resolution_m = 1e-4;
  /// The largest number of pieces examined in a step; what is open then is not certified.
  static constexpr int pieces_max = 4096;

  /// @param limit distances are known up to here; larger ones count as this [m]
  /// @param self null if self-collision is not modelled
  /// @param self_limit the same for distances between parts of the arm [m]
  /// @param obstacles_max the largest number of obstacles in any environment to be checked
  Certificate(const model::Model& model, double limit, const scene::SelfField* self,
              double self_limit, std::size_t obstacles_max);

  struct Verdict {
    bool certified = true;
    double margin_m = 0.0;  ///< lower bound of all distances; zero or below: not proved, or contact
    bool contact = false;   ///< a clearance of zero or below was found between the nodes
    int self_pair = -1;     ///< the pair of parts that touched, or −1
  };

  /// One end of a step. Clearances are at most the limits.
  struct Node {
    const Eigen::VectorXd& q;
    const Eigen::VectorXd& v;  ///< velocity with which the motion leaves or reaches the node
    double time_s;
    scene::Shapes arm;                  ///< all shapes at q
    std::span<const double> clearance;  ///< of all shapes to obstacles; empty if there are none
    std::span<const double> pairs;      ///< of all SelfField::pairs(); empty if not modelled
  };
  /// @param ws scratch of the same model; its poses change
  /// @param environment the obstacles during the step
  [[nodiscard]] Verdict check(dynamics::Workspace& ws, const scene::Environment& environment,
                              const Node& from, const Node& to);

  /// Upper bound of the path of any point of the arm on a straight joint motion by dq [m].
  [[nodiscard]] double longest_path(const Eigen::VectorXd& dq) const;

 private:
  /// What a bound is for: a shape against the obstacles, or a pair of parts.
  struct Subject {
    std::size_t index;
    bool is_pair;
  };
  struct Piece {
    double at, width;  ///< start and width in s, 0 to 1
    double from, to;   ///< clearances at its ends
  };

  /// Lower bound of the subject's clearance on the piece.
  double prove(dynamics::Workspace& ws, Subject subject, const Piece& piece);
  /// Largest |dc/ds| of any point of the subject's axes at the posture of ws [m].
  [[nodiscard]] double speed(const dynamics::Workspace& ws, Subject subject) const;
  /// Clearance at the posture of arm_, which is that of s; records contact.
  [[nodiscard]] double clearance_at(Subject subject, double s);
  /// The given clearance, or less if an obstacle that appears in this step is nearer, as if it
  /// existed all the time.
  [[nodiscard]] double clearance_of_appearing(const scene::Shapes& shape, double time_s,
                                              double clearance) const;
  [[nodiscard]] Eigen::MatrixXd::ConstRowXpr lever(Subject subject) const {
    return (subject.is_pair ? levers_.pairs() : levers_.shapes())
        .row(static_cast<Eigen::Index>(subject.index));
  }

  const model::Model& model_;
  const scene::Environment* environment_ = nullptr;  ///< of the step that is checked
  double limit_;
  const scene::SelfField* self_;
  double self_limit_;
  Levers levers_;

  // of the step that is checked
  Eigen::VectorXd q_, dq_, stray_;  ///< stray: σ
  Eigen::VectorXd curvature_;       ///< κ is the scalar product of this and the levers
  Eigen::VectorXd rest_;            ///< curvature / 8 + stray
  double time_s_ = 0.0, h_ = 0.0;
  double obstacle_travel_ = 0.0;        ///< u h: no obstacle moves farther [m]
  std::vector<std::size_t> appearing_;  ///< obstacles that exist at the end but not at the start
  bool contact_ = false;                ///< whether contact was found between the nodes
  int pieces_ = 0;
  Eigen::VectorXd q_middle_, rate_;
  scene::PlacedShapes arm_;
};

}  // namespace hamelin::control
