#pragma once
#include <span>

#include "hamelin/io/json.hpp"
#include "hamelin/planning/planner_answer.hpp"
#include "hamelin/planning/planner_input.hpp"
#include "hamelin/planning/planner_services.hpp"
#include "hamelin/planning/plugin_entry.hpp"

/// The header for authors of planners: thin C++ views of the C structs of plugin_abi.h, a base
/// class, and the macro that makes a plugin of it. Views own nothing and are cheap to copy. A view
/// is valid as long as the struct behind it: a Tick and a Command during one call, a Setup and a
/// Host as long as the planner. Keep a copy of the view, not a reference to it.
namespace hamelin::planning {

/// Base class of planners. A planner has a constructor (const Host&, const Setup&, const Json&
/// params), which reports bad input by throwing Error; params are complete and checked against the
/// plugin's schema. It may also have any of these, which are found by their names:
/// - `static double influence_m(const Json& params)`: distance up to which it needs contacts [m].
/// - `static constexpr std::uint32_t properties = HAMELIN_TICK_ALLOCATES | HAMELIN_USES_THREADS`.
/// - `T prepare_params(const Json& params) const`: on any thread, while tick() runs; throws Error.
/// - `void apply_params(const T& params)`: before a tick; does not allocate or throw.
/// - `void reset(ConstVectorMap q, ConstVectorMap v)`: a new start; does not throw.
/// - `void world_changed(std::uint64_t world)`: before a tick; does not throw.
class Planner {
 public:
  Planner() = default;
  Planner(const Planner&) = delete;
  Planner& operator=(const Planner&) = delete;
  virtual ~Planner() = default;
  /// Answers a tick. It must not allocate, unless `properties` say so. An exception ends the run as
  /// a defect.
  virtual void tick(const Tick& tick, Command& command) = 0;
};

/// Checks new parameters of a running planner: those with these names must be the initial ones.
/// @throws Error invalid, naming the first that differs
void check_fixed_params(const Json& params, const Json& initial, std::span<const char* const> keys);

}  // namespace hamelin::planning
