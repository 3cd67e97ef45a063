#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::control {

/// Proves that the motion between two nodes stays clear. Between nodes the motion is the joint-space line q + s Δq, off
/// which a trajectory strays by at most σ_j = h |v⁺_j − v_j| / 4 a joint. A shape whose axis moves by the chord Δc
/// between the nodes, with clearances d and d' there, comes no nearer to what moves no faster than u than
///
///     (d + d' − |Δc| − u h)/2 − κ/8 − Σ_j l_j σ_j,
///
/// where l_j bounds over all q how far joint j moves the shape, and κ = Σ_j l_j |Δq_j| ([j turns] |Δq_j| + 2 Σ_{i<j, i
/// turns} |Δq_i|) its second derivative along the line. Where that is not positive the line is halved, with the speed
/// of the shape at each piece's middle in place of the chord, until a piece is no longer than `resolution_m`. Two parts
/// of the arm are treated the same way, in the frame of the one nearer to the base: only the joints between them move
/// the other.
class Certificate {
 public:
  /// A piece of a step's path this short is not halved again [m].
  static constexpr double resolution_m = 1e-4;
  /// So many configurations between two nodes are looked at, at most; what is open then is not certified.
  static constexpr int looks_max = 4096;

  /// @param limit distances are known up to here; what is farther counts as this far [m]
  /// @param self null where self-collision is not modelled
  /// @param self_limit as limit, for distances between parts of the arm [m]
  Certificate(const model::Model& model, const scene::Environment& environment, double limit,
              const scene::SelfField* self, double self_limit);

  struct Verdict {
    bool certified = true;
    double margin_m = 0.0;  ///< no distance is smaller; zero or below: not proved, or the clearance of the contact
    bool contact = false;   ///< a sub-check met a clearance of zero or below
    int self_pair = -1;     ///< the pair of parts that touched, if that was it
  };

  /// One end of a step. Clearances are capped at the limits.
  struct Node {
    const Eigen::VectorXd& q;
    const Eigen::VectorXd& v;  ///< of the motion that leaves or reaches the node
    double time_s;
    scene::Shapes arm;                  ///< all shapes at q
    std::span<const double> clearance;  ///< of all shapes to obstacles; empty where there is nothing to hit
    std::span<const double> pairs;      ///< of all pairs of SelfField::pairs(); empty where not modelled
  };
  /// @param ws scratch of the same model; its poses change
  [[nodiscard]] Verdict check(dynamics::Workspace& ws, const Node& from, const Node& to);

 private:
  /// What is looked at between the nodes: a shape against the obstacles, or a pair of parts.
  struct Subject {
    std::size_t index;
    bool is_pair;
  };
  struct Piece {
    double at, width;  ///< of the line, 0 to 1
    double from, to;   ///< clearances at its ends
  };

  void set_levers();
  /// Counts more travel of prismatic joints than their limits say, if that is what they do.
  void follow_travel(const Eigen::VectorXd& q);
  /// Lower bound of the subject's clearance over the piece.
  double prove(dynamics::Workspace& ws, Subject subject, const Piece& piece);
  /// How fast any point of the subject's axes moves along the line at the posture of ws [m per unit of the line].
  [[nodiscard]] double speed(const dynamics::Workspace& ws, Subject subject) const;
  /// At the posture that arm_ was placed in, the line's at `at`; notes contact.
  [[nodiscard]] double clearance_at(Subject subject, double at);
  /// The given clearance, or less if an obstacle that appears in this step is nearer, as if it were there all the time.
  [[nodiscard]] double clearance_of_appearing(const scene::Shapes& shape, double time_s, double clearance) const;
  [[nodiscard]] Eigen::MatrixXd::ConstRowXpr lever(Subject subject) const {
    return (subject.is_pair ? pair_lever_ : lever_).row(static_cast<Eigen::Index>(subject.index));
  }

  const model::Model& model_;
  const scene::Environment& environment_;
  double limit_;
  const scene::SelfField* self_;
  double self_limit_;
  Eigen::VectorXd hop_, travel_;  ///< between successive joint frames at q = 0; of prismatic joints at most
  Eigen::MatrixXd lever_;         ///< shapes × dof: how far joint j moves any point of shape s's axis [m/rad or 1]
  Eigen::MatrixXd pair_lever_;    ///< pairs × dof: likewise one part against the other

  // of the step that is checked
  Eigen::VectorXd q_, dq_, stray_, bend_;  ///< stray: σ; bend: what levers are multiplied with for κ
  Eigen::VectorXd rest_;                   ///< bend / 8 + stray
  double time_s_ = 0.0, h_ = 0.0;
  double obstacle_way_ = 0.0;           ///< no obstacle moves farther [m]
  std::vector<std::size_t> appearing_;  ///< obstacles that are there at the end and were not at the start
  bool contact_ = false;                ///< whether a sub-check met contact
  int looks_ = 0;
  Eigen::VectorXd between_, turning_;
  scene::PlacedShapes arm_;
};

}  // namespace hamelin::control
