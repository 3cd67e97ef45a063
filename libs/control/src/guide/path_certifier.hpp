#pragma once
#include <Eigen/Core>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/search/query.hpp"
#include "shield/certified_path.hpp"

namespace hamelin::control {

/// Sets what is proved of a motion, and what stops along it may use: docs/theory.md (14.30),
/// (14.37). One thread.
class PathCertifier {
 public:
  /// @param model, levers kept by reference
  /// @param enough_m intervals that keep less are examined again [m]
  PathCertifier(const model::Model& model, const scene::Levers& levers,
                const ModelledLimits& modelled, double enough_m);

  /// Given are the path's motion, and the limits that it keeps.
  /// @param margins that its lines and blends are proved to keep
  /// @param query its margins are changed
  void certify(CertifiedPath& path, const search::Margins& margins, search::Query& query);
  /// The same where the margins are set already.
  void complete(CertifiedPath& path);

 private:
  /// From one node to the next.
  struct Chord {
    Eigen::VectorXd from, to, stray;  ///< and what the curve strays from it, of each joint
  };
  void set_margins(CertifiedPath& path, Eigen::Index interval, const search::Margins& margins,
                   search::Query& query);
  [[nodiscard]] bool keeps(double of_obstacles_m, double of_self_m, search::Query& query) const;
  void raise_margins(double& clearance_m, double& self_m, search::Query& query) const;
  void set_room(CertifiedPath& path);
  void set_mass(CertifiedPath& path);
  /// How stops may brake where rates are bounded.
  void set_braking(CertifiedPath& path) const;
  void bound_braking(CertifiedPath& path, Eigen::Index node) const;

  const model::Model& model_;
  const scene::Levers& levers_;
  Eigen::VectorXd q_lower_, q_upper_;
  double enough_m_;
  dynamics::Workspace ws_;
  Chord chord_;
};

}  // namespace hamelin::control
