#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "hamelin/control/line_buffer.hpp"
#include "hamelin/control/live_target.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "loop/goal_list.hpp"
#include "loop/loaded_arm.hpp"
#include "loop/newest.hpp"

namespace hamelin::control {

/// The planner's parameters on their way to the tick.
struct NewParams {
  std::uint64_t number = 0;
  std::optional<planning::PreparedParams> params;
};

/// What the arm carries, on its way to the tick.
struct NewLoad {
  std::uint64_t serial = 0;
  std::uint64_t number = 0;
  std::uint64_t params_number = 0;  ///< of the parameters that its planner was made with
  std::unique_ptr<LoadedArm> arm;   ///< after it was taken: the one before
  std::uint64_t resumes = 0;        ///< the stop after which the arm is to go on; 0: none
};

/// A call of Controller::stop() on its way to the tick.
struct StopRequest {
  std::uint64_t number = 0;
  LineBuffer cause;
};

/// What other threads have sent to the tick, which takes the newest of each without waiting. The
/// world has a place of its own, World.
struct Mailbox {
  explicit Mailbox(std::unique_ptr<GoalList> first_goals)
      : goals(std::move(first_goals)),
        params(std::make_unique<NewParams>()),
        load(std::make_unique<NewLoad>()),
        stop(std::make_unique<StopRequest>()),
        target(std::make_unique<StreamedTarget>()) {}
  Newest<GoalList> goals;
  Newest<NewParams> params;
  Newest<NewLoad> load;
  Newest<StopRequest> stop;
  Newest<StreamedTarget> target;
};

}  // namespace hamelin::control
