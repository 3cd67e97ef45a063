#include <dlfcn.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <string>

#include "hamelin/planning/plugin_abi.h"

// The planner `python`: passes all calls on to the extension module of the Python package, which
// calls an object of Python. In a Python program that is the running interpreter. Elsewhere one is
// started at the first use, so that listing planners does not need Python.
namespace {

namespace fs = std::filesystem;

// The functions of Python that are used here. They are looked up at run time, because a Python
// program has them itself, and another program loads Python's library only if a scene needs it.
struct Functions {
  int (*is_initialized)();
  wchar_t* (*decode)(const char*, std::size_t*);
  void (*set_program_name)(const wchar_t*);
  void (*initialize)(int);
  void* (*save_thread)();
  int (*lock)();
  void (*unlock)(int);
  void* (*sys_object)(const char*);
  void* (*unicode)(const char*);
  int (*insert)(void* list, long at, void* item);
  void* (*import)(const char*);
  void* (*attribute)(void*, const char*);
  void* (*capsule)(void*, const char*);
  void (*fetch)(void**, void**, void**);
  void* (*str)(void*);
  const char* (*utf8)(void*);
  void (*decrement)(void*);
};

template <class F>
void find(F& function, const char* name) {
  void* const symbol = ::dlsym(RTLD_DEFAULT, name);
  if (symbol == nullptr) throw std::runtime_error(std::string("Python has no function ") + name);
  std::memcpy(&function, &symbol, sizeof function);
}

Functions find_functions() {
  if (::dlsym(RTLD_DEFAULT, "Py_IsInitialized") == nullptr &&
      ::dlopen(HAMELIN_PYTHON_LIBRARY, RTLD_NOW | RTLD_GLOBAL) == nullptr)
    throw std::runtime_error(std::string("cannot load Python: ") + ::dlerror());
  Functions f{};
  find(f.is_initialized, "Py_IsInitialized");
  find(f.decode, "Py_DecodeLocale");
  find(f.set_program_name, "Py_SetProgramName");
  find(f.initialize, "Py_InitializeEx");
  find(f.save_thread, "PyEval_SaveThread");
  find(f.lock, "PyGILState_Ensure");
  find(f.unlock, "PyGILState_Release");
  find(f.sys_object, "PySys_GetObject");
  find(f.unicode, "PyUnicode_DecodeFSDefault");
  find(f.insert, "PyList_Insert");
  find(f.import, "PyImport_ImportModule");
  find(f.attribute, "PyObject_GetAttrString");
  find(f.capsule, "PyCapsule_GetPointer");
  find(f.fetch, "PyErr_Fetch");
  find(f.str, "PyObject_Str");
  find(f.utf8, "PyUnicode_AsUTF8");
  find(f.decrement, "Py_DecRef");
  return f;
}

// The folder of the package `hamelin`, from the file of this plugin: below the same prefix, which
// is some folders above PREFIX/lib/hamelin/plugins or PREFIX/lib/x86_64-linux-gnu/hamelin/plugins,
// or in the same build folder. A wheel may hold a build that was made for another folder than
// site-packages. Empty if it is not there; then Python searches for it.
fs::path package_folder() {
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&package_folder), &info) == 0) return {};
  std::error_code ec;
  const fs::path file = fs::canonical(info.dli_fname, ec);
  for (fs::path at = file.parent_path(); at.has_relative_path(); at = at.parent_path())
    for (const char* folder : {"lib/python", HAMELIN_PYTHON_DIR, HAMELIN_PYTHON_SITE})
      if (fs::is_regular_file(at / folder / "hamelin" / "__init__.py", ec)) return at / folder;
  return {};
}

std::string pending_error(const Functions& f) {
  void *type = nullptr, *value = nullptr, *trace = nullptr;
  f.fetch(&type, &value, &trace);
  void* const text = value != nullptr ? f.str(value) : nullptr;
  const char* const line = text != nullptr ? f.utf8(text) : nullptr;
  return line != nullptr ? line : "unknown error";
}

// Python's lock, for as long as this lives.
class Lock {
 public:
  explicit Lock(const Functions& f) : f_(f), state_(f.lock()) {}
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;
  ~Lock() { f_.unlock(state_); }

 private:
  const Functions& f_;
  int state_;
};

void start_python(const Functions& f) {
  if (f.is_initialized() != 0) return;
  // The program name decides where Python searches for its libraries.
  f.set_program_name(f.decode(HAMELIN_PYTHON_EXECUTABLE, nullptr));
  f.initialize(0);  // signals stay with the program
  f.save_thread();  // every call takes the lock for itself
}

// The planner of the extension module; it lives as long as the process.
const hamelin_plugin& load_planner() {
  static const Functions f = find_functions();
  start_python(f);
  const Lock lock(f);
  if (const fs::path folder = package_folder(); !folder.empty()) {
    // A program may have imported hamelin already, then the folder changes nothing.
    if (void* const path = f.sys_object("path"); path != nullptr)
      f.insert(path, 0, f.unicode(folder.c_str()));
  }
  void* const module = f.import("hamelin._hamelin");
  void* const capsule = module != nullptr ? f.attribute(module, "_planner_plugin") : nullptr;
  const void* const plugin = capsule != nullptr ? f.capsule(capsule, "hamelin_plugin") : nullptr;
  if (plugin == nullptr)
    throw std::runtime_error("cannot import the Python package hamelin: " + pending_error(f));
  return *static_cast<const hamelin_plugin*>(plugin);
}

const hamelin_plugin& planner() {
  static std::mutex mutex;
  static const hamelin_plugin* loaded = nullptr;
  const std::scoped_lock lock(mutex);
  if (loaded == nullptr) loaded = &load_planner();
  return *loaded;
}

std::int32_t create(const hamelin_host* host, const hamelin_setup* setup, const char* params,
                    std::size_t params_size, void** out, char* error,
                    std::size_t error_size) noexcept {
  try {
    return planner().create(host, setup, params, params_size, out, error, error_size);
  } catch (const std::exception& e) {
    std::snprintf(error, error_size, "planner python: %s", e.what());
    return 1;
  }
}

double influence_m(const char* params, std::size_t params_size) noexcept {
  try {
    return planner().influence_m(params, params_size);
  } catch (const std::exception&) {
    return -1.0;  // create reports the error
  }
}

// The functions below have a planner, so the module is loaded.
std::int32_t tick(void* instance, const hamelin_tick* tick, hamelin_command* command, char* error,
                  std::size_t error_size) noexcept {
  static const hamelin_plugin& loaded = planner();
  return loaded.tick(instance, tick, command, error, error_size);
}

constexpr const char* schema = R"({
  "type": "object",
  "additionalProperties": false,
  "properties": {
    "file": {
      "description": "Python file that defines the class; relative to the working directory",
      "type": ["string", "null"], "default": null, "input_file": true
    },
    "class": {"description": "name of the class in it", "type": ["string", "null"], "default": null},
    "object": {
      "description": "whether the run was started from Python with an object of the class",
      "type": "boolean", "default": false
    },
    "params": {
      "description": "keyword arguments of the class, checked against its params_schema",
      "type": "object", "default": {}
    }
  }
})";

hamelin_plugin make_plugin() noexcept {
  hamelin_plugin plugin{};
  plugin.struct_size = sizeof plugin;
  plugin.abi_version = HAMELIN_PLUGIN_ABI_VERSION;
  plugin.abi_version_min = HAMELIN_PLUGIN_ABI_VERSION_MIN;
  plugin.properties = HAMELIN_TICK_ALLOCATES | HAMELIN_FOLLOWS_TARGETS | HAMELIN_FOLLOWS_PATHS |
                      HAMELIN_FOLLOWS_TRAJECTORIES | HAMELIN_ASKS_FOR_PATHS;
  plugin.name = "python";
  plugin.version = HAMELIN_VERSION;
  plugin.description = "a planner that is written in Python: --planner python:FILE:CLASS";
  plugin.params_schema = schema;
  plugin.create = &create;
  plugin.tick = &tick;
  plugin.destroy = [](void* instance) noexcept { planner().destroy(instance); };
  plugin.influence_m = &influence_m;
  plugin.reset = [](void* instance, const double* q, const double* v) noexcept {
    planner().reset(instance, q, v);
  };
  plugin.world_changed = [](void* instance, std::uint64_t world) noexcept {
    planner().world_changed(instance, world);
  };
  return plugin;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const hamelin_plugin* hamelin_plugin_entry(void);
extern "C" const hamelin_plugin* hamelin_plugin_entry(void) {
  static const hamelin_plugin plugin = make_plugin();
  return &plugin;
}
