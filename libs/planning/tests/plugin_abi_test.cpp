#include "hamelin/planning/plugin_abi.h"

#include <catch2/catch.hpp>
#include <cstddef>

// The layout that ABI 3 promises on a 64-bit machine. A change here needs a new HAMELIN_PLUGIN_ABI_VERSION, unless it
// only appends.
static_assert(HAMELIN_PLUGIN_ABI_VERSION == 3u);
static_assert(sizeof(hamelin_sphere) == 64 && offsetof(hamelin_sphere, center_link_m) == 8 &&
              offsetof(hamelin_sphere, half_axis_link_m) == 40);
static_assert(sizeof(hamelin_contact) == 112 && offsetof(hamelin_contact, distance_m) == 8 &&
              offsetof(hamelin_contact, obstacle_velocity_world_m_s) == 88);
static_assert(sizeof(hamelin_self_contact) == 88 && offsetof(hamelin_self_contact, direction_world) == 64);
static_assert(sizeof(hamelin_goal) == 112 && offsetof(hamelin_goal, q) == 64 && offsetof(hamelin_goal, path) == 96);
static_assert(sizeof(hamelin_gyroscopic_term) == 56 && offsetof(hamelin_gyroscopic_term, w_world) == 32);
static_assert(sizeof(hamelin_setup) == 240 && offsetof(hamelin_setup, robot_json) == 16 &&
              offsetof(hamelin_setup, spheres) == 112 && offsetof(hamelin_setup, q_lower) == 144 &&
              offsetof(hamelin_setup, control_period_s) == 184 && offsetof(hamelin_setup, seed) == 232);
static_assert(sizeof(hamelin_tick) == 88 && offsetof(hamelin_tick, q) == 24 &&
              offsetof(hamelin_tick, speed_scale) == 64);
static_assert(sizeof(hamelin_command) == 224 && offsetof(hamelin_command, potential_J) == 136 &&
              offsetof(hamelin_command, gyroscopic) == 160 && offsetof(hamelin_command, recovery_work_J) == 216);
static_assert(sizeof(hamelin_host) == 40 && offsetof(hamelin_host, closest_points) == 24);
static_assert(sizeof(hamelin_plugin) == 72 && offsetof(hamelin_plugin, abi_version) == 4 &&
              offsetof(hamelin_plugin, create) == 40 && offsetof(hamelin_plugin, influence_m) == 64);

TEST_CASE("the entry symbol's name is the one plugins export", "[planning][unit]") {
  CHECK(std::string(HAMELIN_PLUGIN_ENTRY_NAME) == "hamelin_plugin_entry");
}
