#include "hamelin/planning/plugin_abi.h"

#include <dlfcn.h>

#include <catch2/catch.hpp>
#include <cstddef>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "plugins/abi_layout.h"

namespace {

struct PinnedRow {
  layout_row pinned, seen;
  bool same_type;
};

/// The layout in abi_layout.inc beside this compiler's layout of plugin_abi.h.
const std::vector<PinnedRow>& rows() {
  static const std::vector<PinnedRow> all{
#define STRUCT(name, size) \
  {{#name, 0, size}, {#name, 0, sizeof(name)}, std::is_standard_layout_v<name>},
#define FIELD(name, field, offset, size, ...)                                      \
  {{#name "." #field, offset, size},                                               \
   {#name "." #field, offsetof(name, field), sizeof(std::declval<name&>().field)}, \
   std::is_same_v<decltype(name::field), __VA_ARGS__>},
#include "plugins/abi_layout.inc"
#undef STRUCT
#undef FIELD
  };
  return all;
}

struct Anything {
  template <typename T>
  operator T() const;  // NOLINT(google-explicit-constructor): stands for any initialiser
};

template <typename S, std::size_t... I>
constexpr bool takes(std::index_sequence<I...>) {
  return requires {
    S{(static_cast<void>(I), Anything{})...};
  };
}

/// The number of scalars and pointers in a struct, with the elements of arrays counted one by one.
template <typename S, std::size_t N = 1>
constexpr std::size_t scalars() {
  if constexpr (takes<S>(std::make_index_sequence<N + 1>{}))
    return scalars<S, N + 1>();
  else
    return N;
}

template <typename T>
constexpr std::size_t elements = std::is_array_v<T> ? std::extent_v<T> : 1;

}  // namespace

TEST_CASE("plugin interface: the layout in C++ is that of version 4", "[planning][unit]") {
  REQUIRE(HAMELIN_PLUGIN_ABI_VERSION == 4);
  for (const auto& [pinned, seen, same_type] : rows()) {
    INFO(pinned.name);
    CHECK(seen.offset == pinned.offset);
    CHECK(seen.size == pinned.size);
    CHECK(same_type);
  }
}

TEST_CASE("plugin interface: the layout in C is that of version 4", "[planning][unit]") {
  REQUIRE(layout_in_c_count == rows().size());
  for (std::size_t i = 0; i < layout_in_c_count; ++i) {
    const auto& pinned = rows()[i].pinned;
    INFO(pinned.name);
    CHECK(std::string(layout_in_c[i].name) == pinned.name);
    CHECK(layout_in_c[i].offset == pinned.offset);
    CHECK(layout_in_c[i].size == pinned.size);
  }
}

TEST_CASE("plugin interface: no struct has a field that is not pinned", "[planning][unit]") {
  // A field that fits into padding changes no offset and no size, so scalars are counted as well.
  std::map<std::string, std::size_t> pinned, seen;
#define STRUCT(name, size) seen[#name] = scalars<name>();
#define FIELD(name, field, offset, size, ...) pinned[#name] += elements<__VA_ARGS__>;
#include "plugins/abi_layout.inc"
#undef STRUCT
#undef FIELD
  CHECK(pinned == seen);
}

TEST_CASE("plugin interface: constants keep their values", "[planning][unit]") {
  CHECK(HAMELIN_OBSTACLE_MAP == -1);
  CHECK(HAMELIN_OBSTACLE_UNKNOWN == -2);
  CHECK(HAMELIN_SHAPE_OF_BASE == -1);
  CHECK(HAMELIN_GOAL_JOINT == 0);
  CHECK(HAMELIN_GOAL_POSITION == 1);
  CHECK(HAMELIN_GOAL_POSE == 2);
  CHECK(HAMELIN_GOAL_FOLLOW == 3);
  CHECK(HAMELIN_PLANNER_RUNNING == 0);
  CHECK(HAMELIN_PLANNER_GAVE_UP == 1);
  CHECK(HAMELIN_PLANNER_DETECTS_STALLS == 2);
  CHECK(HAMELIN_LOG_INFO == 0);
  CHECK(HAMELIN_LOG_WARNING == 1);
}

TEST_CASE("plugin interface: a plugin in C exports the symbol that the host looks up",
          "[planning][unit]") {
  const std::string file = HAMELIN_TEST_BINARY_DIR "/lib/hamelin/test_plugins/plain_c.hamelin.so";
  void* library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  REQUIRE(library != nullptr);
  void* symbol = ::dlsym(library, HAMELIN_PLUGIN_ENTRY_NAME);
  REQUIRE(symbol != nullptr);
  const hamelin_plugin* plugin = reinterpret_cast<hamelin_plugin_entry_fn>(symbol)();
  CHECK(plugin->struct_size == 120);
  CHECK(plugin->abi_version == 4);
  ::dlclose(library);
}
