// The planner hybrid, whose answers are not numbers from a random time on: the arm then stops on
// what was verified last. The time follows from the scene's seed.
#include <dlfcn.h>

#include <cstdio>
#include <limits>
#include <memory>

#include "hamelin/core/rng.hpp"
#include "hamelin/planning/plugin_abi.h"

namespace {

constexpr double first_s = 0.02, last_s = 1.6;  // of the failure

const hamelin_plugin* hybrid() {
  static const hamelin_plugin* const plugin = []() -> const hamelin_plugin* {
    void* const library = dlopen(HAMELIN_HYBRID_PLUGIN, RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) return nullptr;
    void* const entry = dlsym(library, HAMELIN_PLUGIN_ENTRY_NAME);
    return entry != nullptr ? reinterpret_cast<hamelin_plugin_entry_fn>(entry)() : nullptr;
  }();
  return plugin;
}

struct Failing {
  void* planner;
  double at_s;
};

int32_t create(const hamelin_host* host, const hamelin_setup* setup, const char* params,
               size_t size, void** out, char* error, size_t error_size) {
  auto made = std::make_unique<Failing>();
  if (hybrid()->create(host, setup, params, size, &made->planner, error, error_size) != 0) return 1;
  hamelin::Rng rng(setup->seed * 104729);
  made->at_s = rng.uniform(first_s, last_s);
  *out = made.release();
  return 0;
}

int32_t tick(void* planner, const hamelin_tick* tick, hamelin_command* command, char* error,
             size_t error_size) {
  auto* const failing = static_cast<Failing*>(planner);
  const int32_t failed = hybrid()->tick(failing->planner, tick, command, error, error_size);
  if (tick->time_s >= failing->at_s)
    command->held_torque[0] = std::numeric_limits<double>::quiet_NaN();
  return failed;
}

void destroy(void* planner) {
  const std::unique_ptr<Failing> failing(static_cast<Failing*>(planner));
  hybrid()->destroy(failing->planner);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const hamelin_plugin* hamelin_plugin_entry(void) {
  static const hamelin_plugin plugin = [] {
    hamelin_plugin out{};
    out.struct_size = sizeof out;
    out.abi_version = HAMELIN_PLUGIN_ABI_VERSION;
    out.abi_version_min = HAMELIN_PLUGIN_ABI_VERSION_MIN;
    out.name = "failing";
    out.version = "0.1.0";
    out.description = "hybrid, which fails";
    out.properties = hybrid()->properties;
    out.params_schema = hybrid()->params_schema;
    out.influence_m = hybrid()->influence_m;
    out.create = create;
    out.tick = tick;
    out.destroy = destroy;
    return out;
  }();
  return &plugin;
}
