/* A planner in plain C that answers with damping only. A macro on the compiler's command line
 * selects a fault. */
#include "hamelin/planning/plugin_abi.h"

#include <stdlib.h>

typedef struct planner {
  size_t dof;
} planner;

static int32_t create(const hamelin_host* host, const hamelin_setup* setup, const char* params_json, size_t params_size,
                      void** out, char* error, size_t error_size) {
  (void)params_json, (void)params_size, (void)error, (void)error_size;
#ifndef CREATES_NOTHING
  planner* self = malloc(sizeof *self);
  if (self == NULL) return 1;
  self->dof = setup->dof;
  *out = self;
  host->log(host->context, HAMELIN_LOG_INFO, "made in C", 9);
#else
  (void)host, (void)setup, (void)out;
#endif
  return 0;
}

static int32_t tick(void* self, const hamelin_tick* input, hamelin_command* command, char* error, size_t error_size) {
  size_t i;
  (void)input, (void)error, (void)error_size;
  for (i = 0; i < ((planner*)self)->dof; ++i) command->damping[i] = 1.0;
  return 0;
}

static void destroy(void* self) { free(self); }

static const hamelin_plugin plugin = {
#ifdef SHORT_STRUCT
    sizeof(hamelin_plugin) - sizeof(void*),
#else
    sizeof(hamelin_plugin),
#endif
#ifdef WRONG_ABI
    HAMELIN_PLUGIN_ABI_VERSION + 6,
#else
    HAMELIN_PLUGIN_ABI_VERSION,
#endif
#ifdef NO_NAME
    NULL,
#else
    "plain_c",
#endif
    "1.0", "damping only",
#ifdef BAD_SCHEMA
    "{\"type\":",
#else
    "{\"type\": \"object\"}",
#endif
#ifdef NULL_CREATE
    NULL,
#else
    create,
#endif
#ifdef NULL_TICK
    NULL,
#else
    tick,
#endif
#ifdef NULL_DESTROY
    NULL,
#else
    destroy,
#endif
    NULL};

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
