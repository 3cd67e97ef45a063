/* A planner in plain C. Its answer says what it was given:
 *  damping         1
 *  held_torque[0]  sum of the distances of the tick's contacts
 *  held_torque[1]  sum of the distances that closest_points finds, if the tick lists contacts
 *  held_torque[2]  sum of all goals' tolerances and of all shapes' radii
 *  series          number of the goal; 1 if the tick has the field of a later version
 * A macro on the compiler's command line selects a fault. */
#include "hamelin/planning/plugin_abi.h"

#include <stdlib.h>

typedef struct planner {
  const hamelin_host* host;
  const hamelin_setup* setup;
  int32_t goal_series, later_series;
} planner;

static int32_t create(const hamelin_host* host, const hamelin_setup* setup, const char* params_json,
                      size_t params_size, void** out, char* error, size_t error_size) {
  (void)params_json, (void)params_size, (void)error, (void)error_size;
#ifndef CREATES_NOTHING
  planner* self = malloc(sizeof *self);
  if (self == NULL) return 1;
  self->host = host;
  self->setup = setup;
  self->goal_series = host->declare_series(host->context, "goal", "");
  self->later_series = host->declare_series(host->context, "later", "");
  *out = self;
  host->log(host->context, HAMELIN_LOG_INFO, "made in C", 9);
#else
  (void)host, (void)setup, (void)out;
#endif
  return 0;
}

static double sum_of_setup(const hamelin_setup* setup) {
  double sum = 0.0;
  size_t i;
  for (i = 0; i < setup->goal_count; ++i)
    sum += HAMELIN_ELEMENT(hamelin_goal, setup->goals, setup->goal_stride, i)->tolerance_m;
  for (i = 0; i < setup->shape_count; ++i)
    sum += HAMELIN_ELEMENT(hamelin_shape, setup->shapes, setup->shape_stride, i)->radius_m;
  return sum;
}

static int has_later_field(const hamelin_tick* input) {
#ifdef LATER_HEADER
  return HAMELIN_HAS_FIELD(input, hamelin_tick, appended_b) &&
         HAMELIN_ELEMENT_HAS_FIELD(input->contacts, input->contact_stride, hamelin_contact,
                                   appended_b);
#else
  return HAMELIN_HAS_FIELD(input, hamelin_tick, speed_scale) ? 0 : -1;
#endif
}

static int32_t tick(void* planner_, const hamelin_tick* input, hamelin_command* command,
                    char* error, size_t error_size) {
  const planner* self = planner_;
  hamelin_contact found[4];
  size_t i, count;
  (void)error, (void)error_size;
  for (i = 0; i < self->setup->dof; ++i) command->damping[i] = 1.0;
  if (self->goal_series >= 0) command->series[self->goal_series] = (double)input->goal_number;
  if (self->later_series >= 0) command->series[self->later_series] = has_later_field(input);
  if (input->contact_count == 0) return 0;
  for (i = 0; i < input->contact_count; ++i)
    command->held_torque[0] +=
        HAMELIN_ELEMENT(hamelin_contact, input->contacts, input->contact_stride, i)->distance_m;
  count = self->host->closest_points(self->host->context, input->q, 0.5, found, 4, sizeof found[0]);
  for (i = 0; i < count && i < 4; ++i) command->held_torque[1] += found[i].distance_m;
  command->held_torque[2] = sum_of_setup(self->setup);
  return 0;
}

static void destroy(void* self) {
  free(self);
}

static const hamelin_plugin plugin = {
#ifdef SHORT_STRUCT
    .struct_size = sizeof(hamelin_plugin) - sizeof(void*),
#else
    .struct_size = sizeof(hamelin_plugin),
#endif
#ifdef OLD_ABI
    .abi_version = 3,
#elif defined(FUTURE_ABI)
    .abi_version = HAMELIN_PLUGIN_ABI_VERSION + 6,
    .abi_version_min = HAMELIN_PLUGIN_ABI_VERSION + 5,
#else
    .abi_version = HAMELIN_PLUGIN_ABI_VERSION,
    .abi_version_min = HAMELIN_PLUGIN_ABI_VERSION_MIN,
#endif
#ifndef NO_NAME
    .name = "plain_c",
#endif
    .version = "1.0",
    .description = "says what it was given",
#ifdef BAD_SCHEMA
    .params_schema = "{\"type\":",
#else
    .params_schema = "{\"type\": \"object\"}",
#endif
#ifndef NULL_CREATE
    .create = create,
#endif
#ifndef NULL_TICK
    .tick = tick,
#endif
#ifndef NULL_DESTROY
    .destroy = destroy,
#endif
};

#ifdef NO_ENTRY
#define ENTRY some_other_symbol
#else
#define ENTRY hamelin_plugin_entry
#endif

const hamelin_plugin* ENTRY(void);
const hamelin_plugin* ENTRY(void) {
  (void)create, (void)tick, (void)destroy, (void)plugin;
#ifdef NULL_ENTRY
  return NULL;
#else
  return &plugin;
#endif
}
