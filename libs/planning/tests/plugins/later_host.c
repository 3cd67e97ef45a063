/* A host of a later version of the interface: it was built with a header whose structs have fields
 * appended. The numbers in those fields must survive a planner that does not know them. */
#include "later_host.h"

#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

#include "hamelin/planning/plugin_abi.h"

#define MARK 1234.5

static int32_t series_count;

static void log_line(void* context, int32_t level, const char* text, size_t size) {
  (void)context, (void)level, (void)text, (void)size;
}

/* Writes as much of each struct as the planner's array has room for. */
static size_t closest_points(void* context, const double* q, double influence_m,
                             hamelin_contact* out, size_t capacity, size_t stride) {
  size_t i;
  (void)context, (void)q, (void)influence_m;
  for (i = 0; i < 2 && i < capacity; ++i) {
    hamelin_contact found;
    memset(&found, 0, sizeof found);
    found.distance_m = 4.0 + (double)i;
    found.appended_a = found.appended_b = MARK;
    memcpy((char*)out + i * stride, &found, stride < sizeof found ? stride : sizeof found);
  }
  return 2;
}

static int32_t declare_series(void* context, const char* name, const char* unit) {
  (void)context, (void)name, (void)unit;
  return series_count < 2 ? series_count++ : -1;
}

static void fill_setup(hamelin_setup* setup, hamelin_goal* goals, hamelin_shape* shapes,
                       const char* robot_json) {
  size_t i;
  memset(setup, 0, sizeof *setup);
  memset(goals, 0, 2 * sizeof *goals);
  memset(shapes, 0, 4 * sizeof *shapes);
  for (i = 0; i < 2; ++i) {
    goals[i].struct_size = sizeof goals[i];
    goals[i].type = HAMELIN_GOAL_POSITION;
    goals[i].tolerance_m = 0.25;
    goals[i].appended_a = goals[i].appended_b = MARK;
  }
  for (i = 0; i < 4; ++i) {
    shapes[i].radius_m = 0.5;
    shapes[i].appended_a = shapes[i].appended_b = MARK;
  }
  setup->struct_size = sizeof *setup;
  setup->dof = 3;
  setup->robot_json = robot_json;
  setup->robot_json_size = strlen(robot_json);
  setup->base_quaternion_wxyz[0] = 1.0;
  setup->shapes = shapes;
  setup->shape_count = 4;
  setup->shape_stride = sizeof *shapes;
  setup->goals = goals;
  setup->goal_count = 2;
  setup->goal_stride = sizeof *goals;
  setup->control_period_s = setup->deadline_s = 0.001;
  setup->influence_m = 0.5;
  setup->appended_a = setup->appended_b = MARK;
}

static void run(const hamelin_plugin* plugin, const char* robot_json, const char* params_json,
                later_answer* out) {
  static hamelin_host host; /* static: larger than zero-initialised locals need to be */
  static hamelin_setup setup;
  static hamelin_goal goals[2];
  static hamelin_shape shapes[4];
  static hamelin_contact contacts[3];
  static hamelin_gyroscopic_term terms[4];
  hamelin_tick tick;
  hamelin_command command;
  double q[3] = {0.1, 0.2, 0.3}, v[3] = {1.0, 2.0, 3.0}, gradient[3] = {0.0, 0.0, 0.0},
         node[3] = {0.0, 0.0, 0.0};
  void* planner = NULL;
  size_t i;
  memset(&host, 0, sizeof host);
  host.struct_size = sizeof host;
  host.abi_version = HAMELIN_PLUGIN_ABI_VERSION;
  host.abi_version_min = HAMELIN_PLUGIN_ABI_VERSION_MIN;
  host.log = log_line;
  host.closest_points = closest_points;
  host.declare_series = declare_series;
  fill_setup(&setup, goals, shapes, robot_json);
  series_count = 0;
  if (plugin->create(&host, &setup, params_json, strlen(params_json), &planner, out->error,
                     sizeof out->error) != 0)
    return;
  memset(contacts, 0, sizeof contacts);
  memset(terms, 0, sizeof terms);
  for (i = 0; i < 3; ++i) {
    contacts[i].distance_m = 1.0 + (double)i;
    contacts[i].appended_a = contacts[i].appended_b = MARK;
  }
  for (i = 0; i < 4; ++i) terms[i].appended_a = terms[i].appended_b = MARK;
  memset(&tick, 0, sizeof tick);
  tick.struct_size = sizeof tick;
  tick.q = q;
  tick.v = v;
  tick.contacts = contacts;
  tick.contact_count = 3;
  tick.contact_stride = sizeof contacts[0];
  tick.goal = &goals[1];
  tick.goal_number = 7;
  tick.goal_index = 1;
  tick.speed_scale = 1.0;
  memset(&command, 0, sizeof command);
  command.struct_size = sizeof command;
  command.potential_gradient = gradient;
  command.damping = out->damping;
  command.gyroscopic = terms;
  command.gyroscopic_capacity = 4;
  command.gyroscopic_stride = sizeof terms[0];
  command.held_torque = out->held_torque;
  command.node_velocity = node;
  command.series = out->series;
  command.series_count = 2;
  command.appended_a = command.appended_b = MARK;
  plugin->tick(planner, &tick, &command, out->error, sizeof out->error);
  out->gyroscopic_link =
      command.gyroscopic_count > 0 ? terms[command.gyroscopic_count - 1].link : -1;
  out->overwritten = command.appended_a != MARK || command.appended_b != MARK;
  for (i = 0; i < 4; ++i)
    out->overwritten |= terms[i].appended_a != MARK || terms[i].appended_b != MARK;
  plugin->destroy(planner);
}

void later_host_tick(const char* plugin_file, const char* robot_json, const char* params_json,
                     later_answer* out) {
  void* library = dlopen(plugin_file, RTLD_NOW | RTLD_LOCAL);
  union {
    void* symbol;
    hamelin_plugin_entry_fn call;
  } entry;
  memset(out, 0, sizeof *out);
  if (library == NULL) {
    snprintf(out->error, sizeof out->error, "%s", dlerror());
    return;
  }
  entry.symbol = dlsym(library, HAMELIN_PLUGIN_ENTRY_NAME);
  if (entry.symbol == NULL) {
    snprintf(out->error, sizeof out->error, "no entry");
  } else {
    const hamelin_plugin* plugin = entry.call();
    if (plugin->abi_version_min > HAMELIN_PLUGIN_ABI_VERSION ||
        plugin->abi_version < HAMELIN_PLUGIN_ABI_VERSION_MIN)
      snprintf(out->error, sizeof out->error, "versions do not overlap");
    else
      run(plugin, robot_json, params_json, out);
  }
  dlclose(library);
}
