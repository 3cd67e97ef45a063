#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "hamelin/io/json.hpp"
#include "hamelin/planning/planner_answer.hpp"
#include "hamelin/planning/planner_input.hpp"
#include "hamelin/planning/planner_services.hpp"
#include "hamelin/planning/plugin_abi.h"
#include "hamelin/planning/views.hpp"

/// The macro that makes a plugin of a planner.
namespace hamelin::planning {

namespace detail {

/// Makes the host's instruction set the default of this plugin's copy of the libraries.
void take_instruction_set(const hamelin_setup& setup) noexcept;

/// Writes the message of the current exception, which must not cross the plugin interface, as one
/// line: truncated to error_size and nul-terminated.
void write_current_exception(char* error, std::size_t error_size) noexcept;

template <class Type>
struct Glue {
  struct Instance {
    template <class... Args>
    explicit Instance(std::size_t n, const Args&... args) : dof(n), planner(args...) {}
    std::size_t dof;
    Type planner;
  };
  /// Runs f; an exception becomes a line and the result 1.
  template <class F>
  static std::int32_t guarded(char* error, std::size_t error_size, F&& f) noexcept {
    try {
      f();
      return 0;
    } catch (...) {
      write_current_exception(error, error_size);
      return 1;
    }
  }
  static Type& planner_of(void* instance) { return static_cast<Instance*>(instance)->planner; }

  static std::int32_t create(const hamelin_host* host, const hamelin_setup* setup,
                             const char* params_json, std::size_t params_size, void** out,
                             char* error, std::size_t error_size) noexcept {
    return guarded(error, error_size, [&] {
      take_instruction_set(*setup);
      const Json params = parse_json({params_json, params_size}, "params");
      *out = std::make_unique<Instance>(setup->dof, Host(*host), Setup(*setup), params).release();
    });
  }
  static std::int32_t tick(void* instance, const hamelin_tick* tick, hamelin_command* command,
                           char* error, std::size_t error_size) noexcept {
    return guarded(error, error_size, [&] {
      const std::size_t dof = static_cast<Instance*>(instance)->dof;
      Command view(*command, dof);
      planner_of(instance).tick(Tick(*tick, dof), view);
    });
  }
  static void destroy(void* instance) noexcept { delete static_cast<Instance*>(instance); }
  static double influence_m(const char* params_json, std::size_t params_size) noexcept {
    try {
      if constexpr (requires(const Json& params) { Type::influence_m(params); })
        return Type::influence_m(parse_json({params_json, params_size}, "params"));
    } catch (...) {
      // create gets the same parameters next and can report the error.
    }
    return -1.0;
  }

  static void add_params_functions(hamelin_plugin& plugin) noexcept {
    if constexpr (requires(const Type& planner, const Json& params) {
                    planner.prepare_params(params);
                  }) {
      using Params = decltype(std::declval<const Type&>().prepare_params(std::declval<Json&>()));
      plugin.prepare_params = [](const void* instance, const char* params_json,
                                 std::size_t params_size, void** out, char* error,
                                 std::size_t error_size) noexcept {
        return guarded(error, error_size, [&] {
          const auto& planner = static_cast<const Instance*>(instance)->planner;
          *out = std::make_unique<Params>(
                     planner.prepare_params(parse_json({params_json, params_size}, "params")))
                     .release();
        });
      };
      plugin.apply_params = [](void* instance, const void* params) noexcept {
        planner_of(instance).apply_params(*static_cast<const Params*>(params));
      };
      plugin.free_params = [](void* params) noexcept { delete static_cast<Params*>(params); };
    }
  }

  static hamelin_plugin plugin(const char* name, const char* version, const char* description,
                               const char* params_schema) noexcept {
    hamelin_plugin out{};
    out.struct_size = sizeof out;
    out.abi_version = HAMELIN_PLUGIN_ABI_VERSION;
    out.abi_version_min = HAMELIN_PLUGIN_ABI_VERSION_MIN;
    if constexpr (requires { Type::properties; }) out.properties = Type::properties;
    out.name = name;
    out.version = version;
    out.description = description;
    out.params_schema = params_schema;
    out.create = &create;
    out.tick = &tick;
    out.destroy = &destroy;
    out.influence_m = &influence_m;
    add_params_functions(out);
    if constexpr (requires(Type & planner, ConstVectorMap x) { planner.reset(x, x); })
      out.reset = [](void* instance, const double* q, const double* v) noexcept {
        const auto dof = static_cast<Eigen::Index>(static_cast<Instance*>(instance)->dof);
        planner_of(instance).reset(ConstVectorMap(q, dof), ConstVectorMap(v, dof));
      };
    if constexpr (requires(Type & planner) { planner.world_changed(std::uint64_t{}); })
      out.world_changed = [](void* instance, std::uint64_t world) noexcept {
        planner_of(instance).world_changed(world);
      };
    return out;
  }
};

}  // namespace detail

}  // namespace hamelin::planning

/// Defines the entry point of a plugin. Use it once, in one file of the plugin, outside any
/// namespace. The entry point catches all exceptions, so that none crosses the plugin interface.
/// The texts must have static storage duration, as string literals do.
#define HAMELIN_PLANNER_PLUGIN(Type, plugin_name, plugin_version, plugin_description, schema_text) \
  extern "C" __attribute__((visibility("default"))) const hamelin_plugin* hamelin_plugin_entry(    \
      void);                                                                                       \
  extern "C" const hamelin_plugin* hamelin_plugin_entry(void) {                                    \
    static const hamelin_plugin plugin = ::hamelin::planning::detail::Glue<Type>::plugin(          \
        plugin_name, plugin_version, plugin_description, schema_text);                             \
    return &plugin;                                                                                \
  }                                                                                                \
  static_assert(true, "")
