#ifndef HAMELIN_PLANNING_TESTS_ABI_LAYOUT_H
#define HAMELIN_PLANNING_TESTS_ABI_LAYOUT_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif

/* A struct of plugin_abi.h (offset 0) or a field of one. */
typedef struct layout_row {
  const char* name;
  size_t offset, size;
} layout_row;

/* The rows of abi_layout.inc in its order, as the C compiler lays them out. */
extern const layout_row layout_in_c[];
extern const size_t layout_in_c_count;

#ifdef __cplusplus
}
#endif
#endif
