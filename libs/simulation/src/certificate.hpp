#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace hamelin::simulation {

/// Proves that the motion between two nodes stays clear. Between nodes the motion is the joint-space line, off which a
/// trajectory strays by at most h |v⁺ − v| / 4 a joint. A sphere whose centre's path is no longer than L and whose
/// clearances at the ends are d and d' comes no nearer than (d + d' − L)/2; obstacles may move by their own bound.
/// Where that is not positive the line is bisected, down to `max_depth` levels. Two parts of the arm are treated the
/// same way, in the frame of the one nearer to the base: only the joints between them move the other.
class Certificate {
 public:
  /// @param limit distances are known up to here; what is farther counts as this far [m]
  /// @param self null where self-collision is not modelled
  /// @param self_limit as limit, for distances between parts of the arm [m]
  Certificate(const model::Model& model, const scene::Environment& environment, double limit,
              const scene::SelfField* self, double self_limit);

  struct Verdict {
    bool certified = true;
    double margin_m = 0.0;  ///< the smallest (d + d' − L)/2 met, or the clearance of the contact
    bool contact = false;   ///< a sub-check met a clearance of zero or below
    int self_pair = -1;     ///< the pair of parts that touched, if that was it
  };

  /// Clearances at both nodes, capped at the limits.
  struct Clearances {
    std::span<const double> spheres;  ///< of all spheres to obstacles; empty where there is nothing to hit
    std::span<const double> pairs;    ///< of all pairs of SelfField::pairs(); empty where not modelled
  };
  [[nodiscard]] Verdict check(dynamics::Workspace& ws, const Eigen::VectorXd& q, const Eigen::VectorXd& q_next,
                              const Eigen::VectorXd& v, const Eigen::VectorXd& v_next, double time_s, double h,
                              const Clearances& from, const Clearances& to);

 private:
  static constexpr int max_depth = 8;

  struct Line {
    const Eigen::VectorXd *q, *q_next;
    double time_s, h;
  };
  /// What is looked at between the nodes: a sphere against the obstacles, or a pair of parts.
  struct Subject {
    std::size_t index;
    bool is_pair;
  };
  double bisect(dynamics::Workspace& ws, const Line& line, Subject subject, double at, double width, double from,
                double to, double length, int depth);
  double clearance_at(dynamics::Workspace& ws, const Line& line, Subject subject, double at);

  const model::Model& model_;
  const scene::Environment& environment_;
  double limit_;
  const scene::SelfField* self_;
  double self_limit_;
  bool contact_ = false;         ///< whether the bisections of this check met contact
  double obstacle_speed_ = 0.0;  ///< no obstacle is faster [m/s]
  Eigen::MatrixXd lever_;        ///< spheres × dof: how far joint j moves sphere s at most [m/rad or 1]
  Eigen::MatrixXd pair_lever_;   ///< pairs × dof: how far joint j moves one part against the other at most
  Eigen::VectorXd travel_;       ///< joint displacements of one step, straying included
  Eigen::VectorXd between_;
  std::vector<Eigen::Vector3d> centers_;
  std::vector<double> radii_;
};

}  // namespace hamelin::simulation
