#pragma once
#include <string>
#include <vector>

#include "actuation.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/control/goal_tracker.hpp"
#include "hamelin/control/planner_host.hpp"
#include "hamelin/control/shield.hpp"
#include "hamelin/control/world_view.hpp"
#include "recorder.hpp"
#include "tracking_audit.hpp"

namespace hamelin::simulation {

/// Writes the header and ticks of a run in closed loop.
class TickLog {
 public:
  /// @param world all obstacles, those that the planner does not know included
  TickLog(Recorder& recorder, const model::Model& model, const Plant& plant,
          const control::WorldView& world, const control::GoalTracker& goals, Actuation& actuation,
          const control::Shield* shield)
      : recorder_(recorder),
        model_(model),
        plant_(plant),
        world_(world),
        goals_(goals),
        actuation_(actuation),
        shield_(shield) {
    torque_.setZero(model.dof());
  }

  /// Writes the target that is followed, too. Both must outlive this.
  void add_target(const control::Answer& answer, const TrackingAudit& tracking) {
    answer_ = &answer;
    tracking_ = &tracking;
  }

  /// @param params the planner's, with defaults @param series that it declared
  void header(const scene::Scene& scene, const planning::Plugin& plugin, const Json& params,
              const std::vector<planning::Series>& series, const Json& provenance, long steps);
  /// Writes the line of this node. @param answer the planner's, which acts from here on; null if
  /// there is none
  void tick(bool certified, const planning::CommandBuffers* answer);

 private:
  Recorder& recorder_;
  const model::Model& model_;
  const Plant& plant_;
  const control::WorldView& world_;
  const control::GoalTracker& goals_;
  Actuation& actuation_;
  const control::Shield* shield_;            ///< null if the scene asks for none
  const control::Answer* answer_ = nullptr;  ///< null if no goal follows a target
  const TrackingAudit* tracking_ = nullptr;  ///< the same
  Eigen::VectorXd torque_;                   ///< of the last node with an answer
};

}  // namespace hamelin::simulation
