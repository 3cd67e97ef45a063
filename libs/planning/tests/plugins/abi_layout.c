#include "abi_layout.h"

#include "hamelin/planning/plugin_abi.h"

const layout_row layout_in_c[] = {
#define STRUCT(name, pinned_size) {#name, 0, sizeof(name)},
#define FIELD(name, field, pinned_offset, pinned_size, type) \
  {#name "." #field, offsetof(name, field), sizeof((name*)0)->field},
#include "abi_layout.inc"
};
const size_t layout_in_c_count = sizeof(layout_in_c) / sizeof(layout_in_c[0]);
