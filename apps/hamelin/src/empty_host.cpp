#include "empty_host.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/model/make_chain.hpp"

namespace hamelin::app {

void answer_ticks(const planning::Plugin& plugin, const Json& params, EmptyHost& host) {
  model::ChainOptions chain;
  chain.links = 2;
  const model::Model arm(model::make_chain(chain));
  hamelin_goal goal{};
  goal.struct_size = sizeof goal;
  goal.type = HAMELIN_GOAL_JOINT;
  goal.tolerance_rad = goal.speed_max = 0.05;
  const std::array<double, 2> q_goal{0.2, 0.2}, q{0.1, 0.2}, still{0.0, 0.0}, moving{0.3, -0.4};
  planning::SetupData setup(arm);
  setup.add_goal(goal, Eigen::Map<const Eigen::Vector2d>(q_goal.data()));
  setup.control_period_s = setup.deadline_s = 1e-3;
  setup.influence_m = plugin.influence_m(params).value_or(0.2);
  setup.seed = 1;
  goal.q = q_goal.data();
  auto planner = plugin.create(std::move(setup), host, params);
  planning::CommandBuffers out(2, 8, planner.series().size());
  hamelin_contact contact{};
  contact.distance_m = 0.05;
  contact.direction_world[1] = 1.0;
  contact.obstacle = HAMELIN_OBSTACLE_MAP;
  for (std::uint64_t k = 0; k < 3; ++k) {
    hamelin_tick tick{};
    tick.struct_size = sizeof tick;
    tick.k = k;
    tick.time_s = 1e-3 * static_cast<double>(k);
    tick.q = q.data();
    tick.v = k == 0 ? still.data() : moving.data();
    tick.contacts = &contact;
    tick.contact_count = k == 2 ? 1 : 0;
    tick.contact_stride = sizeof contact;
    tick.goal = &goal;
    tick.speed_scale = 1.0;
    if (!planner.tick(tick, out))
      throw Error(ErrorCode::plugin, fmt::format("tick {}: {}", k, planner.error()));
  }
}

}  // namespace hamelin::app
