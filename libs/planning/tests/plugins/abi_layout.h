#ifndef HAMELIN_PLANNING_TESTS_ABI_LAYOUT_H
#define HAMELIN_PLANNING_TESTS_ABI_LAYOUT_H
#include <stddef.h>
#ifdef __cplusplus
extern "C" {
#endif

/* A struct of plugin_abi.h (with offset 0) or one of its fields. */
typedef struct layout_row {
  const char* name;
  size_t offset, size;
} layout_row;

/* The rows of abi_layout.inc in its order, with the layout of the C compiler. */
extern const layout_row layout_in_c[];
extern const size_t layout_in_c_count;

#ifdef __cplusplus
}
#endif
#endif
