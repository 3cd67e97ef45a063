#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::scene {
class Levers;
}

namespace hamelin::control {

/// Proves that the motion between two nodes stays clear: chapter 12 of docs/theory.md. The motion
/// is assumed to follow the joint-space line q + s Δq, from which joint j deviates by at most σ_j,
/// docs/theory.md (12.1), (12.2). Let the axis of a shape move by the chord Δc during the step h,
/// with distances d and d⁺ at the nodes from an obstacle whose speed is at most u. Then, by
/// docs/theory.md (12.7), its distance on the step is at least
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
  ~Certificate();

  struct Verdict {
    bool certified = false;
    double margin_m = 0.0;  ///< lower bound of all distances; zero or below: not proved, or contact
    bool contact = false;   ///< a clearance of zero or below was found between the nodes
    int self_pair = -1;     ///< the pair of parts that touched, or −1
  };

  /// One end of a step. Clearances are at most the limits.
  struct Node {
    const Eigen::VectorXd& q;
    const Eigen::VectorXd& v;  ///< velocity with which the motion leaves or reaches the node
    scene::Moment moment;
    scene::Shapes arm;                  ///< all shapes at q
    std::span<const double> clearance;  ///< of all shapes to obstacles; empty if there are none
    std::span<const double> pairs;      ///< of all SelfField::pairs(); empty if not modelled
  };
  /// @param ws scratch of the same model; its poses change
  /// @param from, to are moments at different times now, or both are ahead of the same time
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

  /// An obstacle that moves, during the step.
  struct Mover {
    double travel;              ///< no point of it moves farther [m]
    Eigen::Vector3d from, to;   ///< its centre at the nodes
    double ball_from, ball_to;  ///< it is within these distances of its centre [m]
  };

  /// Lists what moves during the step, and what appears in it.
  void find_movers(const Node& from, const Node& to);
  /// Lower bound of a shape's clearance on the step, docs/theory.md (12.7), (12.13). Sets travel_
  /// and far_.
  /// @param d, d_next clearances at the nodes
  [[nodiscard]] double bound_on_step(const Node& from, const Node& to, std::size_t shape, double d,
                                     double d_next);
  [[nodiscard]] scene::Moment moment_at(double s) const;
  /// Lower bound of the subject's clearance on the piece.
  double prove(dynamics::Workspace& ws, Subject subject, const Piece& piece);
  /// Largest |dc/ds| of any point of the subject's axes at the posture of ws [m].
  [[nodiscard]] double speed(const dynamics::Workspace& ws, Subject subject) const;
  /// Clearance at the posture of arm_, which is that of s; records contact.
  [[nodiscard]] double clearance_at(Subject subject, double s);
  /// The given clearance, or less if an obstacle that appears in this step is nearer, as if it
  /// existed all the time.
  [[nodiscard]] double clearance_of_appearing(const scene::Shapes& shape,
                                              const scene::Moment& moment, double clearance) const;
  [[nodiscard]] Eigen::MatrixXd::ConstRowXpr lever(Subject subject) const;

  const model::Model& model_;
  const scene::Environment* environment_ = nullptr;  ///< of the step that is checked
  double limit_;
  const scene::SelfField* self_;
  double self_limit_;
  std::unique_ptr<scene::Levers> levers_;

  // of the step that is checked
  Eigen::VectorXd q_, dq_, stray_;  ///< stray: σ
  Eigen::VectorXd curvature_;       ///< κ is the scalar product of this and the levers
  Eigen::VectorXd rest_;            ///< curvature / 8 + stray
  scene::Moment moment_{0.0};
  double h_ = 0.0;
  bool ahead_ = false;         ///< whether the step lies ahead of now
  std::vector<Mover> movers_;  ///< that exist at the end
  double travel_ = 0.0;  ///< of those that may touch the shape that is examined: none moves farther
  double far_ = 0.0;     ///< bound of that shape's distance from the other movers [m]
  std::vector<std::size_t> appearing_;  ///< obstacles that exist at the end but not at the start
  bool contact_ = false;                ///< whether contact was found between the nodes
  int pieces_ = 0;
  Eigen::VectorXd q_middle_, rate_;
  scene::PlacedShapes arm_;
};

}  // namespace hamelin::control
