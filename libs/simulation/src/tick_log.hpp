#pragma once
#include <string>
#include <vector>

#include "actuation.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/control/world_view.hpp"
#include "recorder.hpp"
#include "tracking_audit.hpp"

namespace hamelin::simulation {

/// Writes the header and ticks of a run in closed loop.
class TickLog {
 public:
  /// @param world all obstacles, those that the planner does not know included
  TickLog(Recorder& recorder, const model::Model& model, const Plant& plant,
          const control::WorldView& world, control::Controller& controller, Actuation& actuation)
      : recorder_(recorder),
        model_(model),
        plant_(plant),
        world_(&world),
        controller_(controller),
        actuation_(actuation) {
    torque_.setZero(model.dof());
  }

  /// @param params the planner's, with defaults
  void header(const scene::Scene& scene, const Json& params, const Json& provenance, long steps);

  /// Replaces the view of the world, after the arm or the map has changed. It must outlive this.
  void set_world(const control::WorldView& world) noexcept { world_ = &world; }
  /// Writes the target that is followed, too. `tracking` must outlive this.
  void add_target(const TrackingAudit& tracking) noexcept { tracking_ = &tracking; }

  /// Writes the line of this node. @param answer the planner's, which acts from here on; null if
  /// there is none
  void tick(bool certified, const planning::CommandBuffers* answer);

 private:
  Recorder& recorder_;
  const model::Model& model_;
  const Plant& plant_;
  const control::WorldView* world_;
  control::Controller& controller_;
  Actuation& actuation_;
  const TrackingAudit* tracking_ = nullptr;  ///< null if no goal follows a target
  std::uint64_t drawn_ = 0;  ///< number of the planner's drawing that was written last
  Eigen::VectorXd torque_;   ///< of the last node with an answer
};

}  // namespace hamelin::simulation
