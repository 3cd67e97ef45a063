#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>

#include "guide/motion_limits.hpp"
#include "guide/path_certifier.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/scene/joint_trajectory.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/search/edge_check.hpp"
#include "shield/certified_path.hpp"

namespace hamelin::control {

/// Proves trajectories that others have made, in their own timing or slower: docs/theory.md
/// (14.41). One thread.
class TrajectoryCertifier {
 public:
  /// @param model, self kept by reference @param self null if self-collision is not modelled
  TrajectoryCertifier(const scene::Scene& scene, const model::Model& model,
                      const scene::SelfField* self, const MotionBounds& bounds);

  struct Result {
    std::unique_ptr<CertifiedPath> motion;  ///< null if it is not proved
    std::string cause;                      ///< why; or that it takes longer: one line, or empty
  };
  /// @param trajectory of the model's joints, checked
  [[nodiscard]] Result certify(const scene::JointTrajectory& trajectory,
                               const WorldSnapshot& world);

 private:
  /// @return the first interval that is not proved; −1 if all are
  [[nodiscard]] Eigen::Index set_margins(CertifiedPath& path);
  [[nodiscard]] bool keeps(double of_obstacles_m, double of_self_m);

  Eigen::VectorXd stop_acceleration_;
  double enough_m_;
  timing::TimeLaw law_;
  scene::Levers levers_;
  search::EdgeCheck edges_;
  PathCertifier certifier_;
  Eigen::VectorXd from_, to_, stray_;
};

}  // namespace hamelin::control
