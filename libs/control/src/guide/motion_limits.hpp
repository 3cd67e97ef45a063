#pragma once
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/timing/time_law.hpp"
#include "loop/stop_finder.hpp"

namespace hamelin::control {

/// What bounds motions, which keep within what planner and shield leave to them, so that neither
/// has to change them.
struct MotionBounds {
  LimitReserve reserve;  ///< what a shield keeps
  Json params;           ///< of the planner, for path_acceleration
  ChangeBounds changes;  ///< of the drives
};

/// The limits of motions along paths: docs/theory.md (19.14).
[[nodiscard]] timing::Limits motion_limits(const scene::Scene& scene, const model::Model& model,
                                           const MotionBounds& bounds);

/// The margin of which a stop along a path needs no more [m].
[[nodiscard]] double enough_margin_m(const LimitReserve& reserve);

}  // namespace hamelin::control
