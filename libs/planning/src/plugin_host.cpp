#include "hamelin/planning/plugin_host.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/description/robot_io.hpp"

namespace hamelin::planning {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void refuse(const fs::path& file, std::string_view reason) {
  throw Error(ErrorCode::plugin, fmt::format("{}: {}", file.string(), reason));
}

std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

// The loader's message begins with the file's name, which the caller's message has already.
std::string system_reason(const fs::path& file) {
  const char* raw = dlerror();
  std::string text = raw != nullptr ? one_line(raw) : "unknown reason";
  const std::string prefix = file.string() + ": ";
  if (text.compare(0, prefix.size(), prefix) == 0) text.erase(0, prefix.size());
  return text;
}

// JSON Schema accepts unknown keys by default, but a mistyped parameter must be an error.
void forbid_unknown_keys(Json& schema) {
  if (!schema.is_object() || !schema.contains("properties") || !schema["properties"].is_object())
    return;
  schema["additionalProperties"] = false;
  for (auto& [key, rule] : schema["properties"].items()) forbid_unknown_keys(rule);
}

bool finite(const Eigen::VectorXd& x) {
  return x.allFinite();
}
bool finite(const double (&x)[3]) {
  return std::isfinite(x[0]) && std::isfinite(x[1]) && std::isfinite(x[2]);
}

// Describes the first error in a planner's answer, or returns null.
const char* defect(const CommandBuffers& out, std::size_t dof, std::size_t gyroscopic_capacity) {
  const hamelin_command& raw = out.raw();
  if (raw.state < HAMELIN_PLANNER_RUNNING || raw.state > HAMELIN_PLANNER_DETECTS_STALLS)
    return "unknown planner state";
  if (std::find(std::begin(raw.cause), std::end(raw.cause), '\0') == std::end(raw.cause))
    return "cause is not nul-terminated";
  if (!std::isfinite(raw.potential_J) || !finite(out.potential_gradient()))
    return "potential is not finite";
  if (!finite(out.damping())) return "damping is not finite";
  if (out.damping().minCoeff() < 0.0) return "damping is negative";
  if (!finite(out.held_torque())) return "held torque is not finite";
  if (raw.has_node_velocity != 0 && !finite(out.node_velocity()))
    return "node velocity is not finite";
  if (raw.gyroscopic_count > gyroscopic_capacity)
    return "more gyroscopic terms than the host's capacity";
  for (const auto& term : out.gyroscopic()) {
    if (term.link < 0 || static_cast<std::size_t>(term.link) >= dof)
      return "gyroscopic term on a link that does not exist";
    if (!finite(term.point_link_m) || !finite(term.w_world)) return "gyroscopic term is not finite";
  }
  if (!std::isfinite(raw.filter_work_J) || !std::isfinite(raw.recovery_work_J))
    return "energy account is not finite";
  return nullptr;
}

}  // namespace

// ---- SetupData

SetupData::SetupData(const model::Model& nominal)
    : dof(static_cast<std::size_t>(nominal.dof())),
      robot_json(description::robot_to_json(nominal.robot()).dump()),
      gravity_world_m_s2(nominal.gravity()),
      base_position_world_m(nominal.base().p()) {
  const Eigen::Quaterniond quaternion(nominal.base().R());
  base_quaternion_wxyz << quaternion.w(), quaternion.vec();
  for (const auto& shape : nominal.shapes()) {
    const auto& link = nominal.robot().links[static_cast<std::size_t>(shape.link)];
    const auto index = static_cast<std::size_t>(shape.index_in_link);
    hamelin_shape out{};
    out.link = shape.link;
    out.index_in_link = shape.index_in_link;
    out.radius_m = shape.radius;
    for (int i = 0; i < 3; ++i) {
      if (shape.is_capsule) {
        const auto& capsule = link.segments[index];
        out.center_link_m[i] = 0.5 * (capsule.from_m[i] + capsule.to_m[i]);
        out.half_axis_link_m[i] = 0.5 * (capsule.to_m[i] - capsule.from_m[i]);
      } else {
        out.center_link_m[i] = link.spheres[index].center_m[i];
      }
    }
    shapes.push_back(out);
  }
}

void SetupData::add_goal(const hamelin_goal& goal, const Eigen::VectorXd& q,
                         const Eigen::MatrixXd& path) {
  goals.push_back(goal);
  goals_q.push_back(q);
  paths.push_back(path);
}

hamelin_setup SetupData::view() {
  for (std::size_t i = 0; i < goals.size(); ++i) {
    goals[i].struct_size = sizeof goals[i];
    goals[i].q = goals_q[i].size() > 0 ? goals_q[i].data() : nullptr;
    goals[i].path = paths[i].size() > 0 ? paths[i].data() : nullptr;
    goals[i].path_points = static_cast<std::size_t>(paths[i].cols());
    path_points_max = std::max(path_points_max, goals[i].path_points);
  }
  hamelin_setup raw{};
  raw.struct_size = sizeof raw;
  raw.dof = dof;
  raw.robot_json = robot_json.c_str();
  raw.robot_json_size = robot_json.size();
  std::copy_n(gravity_world_m_s2.data(), 3, raw.gravity_world_m_s2);
  std::copy_n(base_position_world_m.data(), 3, raw.base_position_world_m);
  std::copy_n(base_quaternion_wxyz.data(), 4, raw.base_quaternion_wxyz);
  raw.shapes = shapes.data();
  raw.shape_count = shapes.size();
  raw.shape_stride = sizeof(hamelin_shape);
  raw.goals = goals.data();
  raw.goal_count = goals.size();
  raw.goal_stride = sizeof(hamelin_goal);
  raw.path_points_max = path_points_max;
  const auto numbers = [](const Eigen::VectorXd& x) { return x.size() > 0 ? x.data() : nullptr; };
  raw.q_lower = numbers(q_lower);
  raw.q_upper = numbers(q_upper);
  raw.velocity_max = numbers(velocity_max);
  raw.effort_max = numbers(effort_max);
  raw.effort_rate_max = numbers(effort_rate_max);
  raw.control_period_s = control_period_s;
  raw.deadline_s = deadline_s;
  raw.sampled = sampled ? 1 : 0;
  raw.delay_s = delay_s;
  raw.self_collision = self_collision ? 1 : 0;
  raw.influence_m = influence_m;
  raw.map_resolution_m = map_resolution_m;
  raw.shield_margin_m = shield_margin_m;
  raw.shield_self_margin_m = shield_self_margin_m;
  raw.seed = seed;
  raw.instruction_set = name_of(default_isa()).data();  // views a literal, so it is nul-terminated
  return raw;
}

// ---- CommandBuffers

CommandBuffers::CommandBuffers(std::size_t dof, std::size_t gyroscopic_capacity, std::size_t series)
    : gyroscopic_(gyroscopic_capacity), series_(series) {
  for (auto* x : {&potential_gradient_, &damping_, &held_torque_, &node_velocity_})
    x->resize(static_cast<Eigen::Index>(dof));
  clear();
}

void CommandBuffers::clear() noexcept {
  for (auto* x : {&potential_gradient_, &damping_, &held_torque_, &node_velocity_}) x->setZero();
  std::fill(series_.begin(), series_.end(), std::numeric_limits<double>::quiet_NaN());
  raw_ = {};
  raw_.struct_size = sizeof raw_;
  raw_.potential_gradient = potential_gradient_.data();
  raw_.damping = damping_.data();
  raw_.gyroscopic = gyroscopic_.data();
  raw_.gyroscopic_capacity = gyroscopic_.size();
  raw_.gyroscopic_stride = sizeof(hamelin_gyroscopic_term);
  raw_.held_torque = held_torque_.data();
  raw_.node_velocity = node_velocity_.data();
  raw_.series = series_.data();
  raw_.series_count = series_.size();
}

// ---- Plugin

struct Plugin::Library {
  explicit Library(fs::path path)
      : file(std::move(path)), handle(dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (handle == nullptr) refuse(file, fmt::format("cannot be loaded: {}", system_reason(file)));
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library() {
#ifndef HAMELIN_SANITIZED  // the sanitizers' reports need the symbols of the library
    if (handle != nullptr) dlclose(handle);
#endif
  }

  fs::path file;
  void* handle;
  const hamelin_plugin* raw = nullptr;
  std::string name, version, description;
  Json params_schema;
};

namespace {

// The versions come first, because the meaning of the other fields depends on them. Before version
// 4 a plugin stated one version only, where its struct now has the newest.
void check_versions(const fs::path& path, const hamelin_plugin& raw) {
  constexpr std::uint32_t newest = HAMELIN_PLUGIN_ABI_VERSION,
                          oldest = HAMELIN_PLUGIN_ABI_VERSION_MIN;
  const auto range = [](std::uint32_t from, std::uint32_t to) {
    return from == to ? fmt::format("{}", to) : fmt::format("{} to {}", from, to);
  };
  if (raw.abi_version < oldest)
    refuse(path, fmt::format("built for version {} of the plugin interface, expected {}; rebuild "
                             "it with this version's headers",
                             raw.abi_version, range(oldest, newest)));
  if (raw.abi_version_min > newest)
    refuse(path, fmt::format("needs version {} of the plugin interface, expected {}; it needs a "
                             "later hamelin",
                             range(raw.abi_version_min, raw.abi_version), range(oldest, newest)));
  if (!HAMELIN_HAS_FIELD(&raw, hamelin_plugin, world_changed))
    refuse(path, fmt::format("hamelin_plugin has {} bytes, expected at least {}", raw.struct_size,
                             sizeof(hamelin_plugin)));
}

}  // namespace

Plugin Plugin::load(const fs::path& file) {
  std::error_code code;
  const fs::path path = fs::absolute(file, code);
  if (code || !fs::exists(path, code)) refuse(file, "no such file, expected a planner plugin");
  if (!fs::is_regular_file(path, code))
    refuse(path, "not a regular file, expected a planner plugin");
  const auto library = std::make_shared<Library>(path);

  void* symbol = dlsym(library->handle, HAMELIN_PLUGIN_ENTRY_NAME);
  if (symbol == nullptr)
    refuse(path, fmt::format("no symbol {}, expected a planner plugin", HAMELIN_PLUGIN_ENTRY_NAME));
  // POSIX guarantees that a void* can hold the address of a function.
  const auto* raw = reinterpret_cast<hamelin_plugin_entry_fn>(symbol)();
  if (raw == nullptr) refuse(path, fmt::format("{} returned null", HAMELIN_PLUGIN_ENTRY_NAME));
  check_versions(path, *raw);
  using Required = std::pair<const char*, bool>;
  for (const auto& [function, present] :
       {Required{"create", raw->create != nullptr}, Required{"tick", raw->tick != nullptr},
        Required{"destroy", raw->destroy != nullptr},
        Required{"apply_params", raw->apply_params != nullptr || raw->prepare_params == nullptr},
        Required{"free_params", raw->free_params != nullptr || raw->prepare_params == nullptr}})
    if (!present) refuse(path, fmt::format("function '{}' is null", function));
  if (raw->name == nullptr || *raw->name == '\0') refuse(path, "the plugin has no name");
  const auto text = [](const char* string) { return one_line(string != nullptr ? string : ""); };
  library->raw = raw;
  library->name = text(raw->name);
  library->version = text(raw->version);
  library->description = text(raw->description);
  try {
    library->params_schema =
        parse_json(raw->params_schema != nullptr ? raw->params_schema : "", "parameter schema");
  } catch (const Error& e) {
    refuse(path, e.what());
  }
  if (!library->params_schema.is_object()) refuse(path, "parameter schema: not a JSON object");
  forbid_unknown_keys(library->params_schema);
  return Plugin(library);
}

const fs::path& Plugin::file() const noexcept {
  return library_->file;
}
const std::string& Plugin::name() const noexcept {
  return library_->name;
}
const std::string& Plugin::version() const noexcept {
  return library_->version;
}
const std::string& Plugin::description() const noexcept {
  return library_->description;
}
const Json& Plugin::params_schema() const noexcept {
  return library_->params_schema;
}

std::vector<std::string> Plugin::file_params() const {
  std::vector<std::string> names;
  const Json properties = params_schema().value("properties", Json::object());
  for (const auto& [name, rule] : properties.items())
    if (rule.is_object() && rule.value("input_file", Json()) == true) names.push_back(name);
  return names;
}

bool Plugin::tick_allocates() const noexcept {
  return (library_->raw->properties & HAMELIN_TICK_ALLOCATES) != 0;
}
bool Plugin::uses_threads() const noexcept {
  return (library_->raw->properties & HAMELIN_USES_THREADS) != 0;
}
bool Plugin::follows_targets() const noexcept {
  return (library_->raw->properties & HAMELIN_FOLLOWS_TARGETS) != 0;
}
bool Plugin::follows_trajectories() const noexcept {
  return (library_->raw->properties & HAMELIN_FOLLOWS_TRAJECTORIES) != 0;
}
bool Plugin::follows_paths() const noexcept {
  return (library_->raw->properties & HAMELIN_FOLLOWS_PATHS) != 0;
}
bool Plugin::asks_for_paths() const noexcept {
  return (library_->raw->properties & HAMELIN_ASKS_FOR_PATHS) != 0;
}
bool Plugin::trusts_certified_paths() const noexcept {
  return (library_->raw->properties & HAMELIN_TRUSTS_CERTIFIED_PATHS) != 0;
}
bool Plugin::can_change_params() const noexcept {
  return library_->raw->prepare_params != nullptr;
}
bool Plugin::can_reset() const noexcept {
  return library_->raw->reset != nullptr;
}
std::uint32_t Plugin::abi_version() const noexcept {
  return std::min(library_->raw->abi_version, HAMELIN_PLUGIN_ABI_VERSION);
}

std::optional<double> Plugin::influence_m(const Json& checked_params) const {
  if (library_->raw->influence_m == nullptr) return std::nullopt;
  const std::string text = checked_params.dump();
  const double answer = library_->raw->influence_m(text.data(), text.size());
  if (!(answer >= 0.0)) return std::nullopt;
  return answer;
}

Json check_params(const Plugin& plugin, const Json& params) {
  const std::string where = fmt::format("parameters of planner '{}'", plugin.name());
  const Json given = params.is_null() ? Json::object() : params;
  if (!given.is_object()) throw Error(ErrorCode::invalid, where + ": /: expected an object");
  check_schema(given, plugin.params_schema(), where);
  return with_defaults(given, plugin.params_schema());
}

// ---- QueryServices

namespace {

/// Empty space.
class NoObstacles final : public QueryServices {
 public:
  Snapshot refresh() override { return {}; }
  void clearance(const double*, std::size_t count, double, double, double* out) override {
    std::fill_n(out, count, infinity);
  }
  std::size_t contacts(const double*, double, double, ArrayOut<hamelin_contact>) override {
    return 0;
  }
  std::size_t self_contacts(const double*, double, ArrayOut<hamelin_self_contact>) override {
    return 0;
  }
  bool motion_clear(const double*, const double*, double, double, double& margin_m) override {
    margin_m = infinity;
    return true;
  }
  void distance(const double*, std::size_t count, double, double limit_m, double* distance_m,
                double* gradient) override {
    std::fill_n(distance_m, count, limit_m);
    if (gradient != nullptr) std::fill_n(gradient, 3 * count, 0.0);
  }
  std::size_t boxes(const Eigen::Vector3d&, const Eigen::Vector3d&,
                    ArrayOut<hamelin_box>) override {
    return 0;
  }
  std::size_t obstacles(double, ArrayOut<hamelin_obstacle_state>) override { return 0; }
};

}  // namespace

std::unique_ptr<QueryServices> HostServices::open_query() {
  return std::make_unique<NoObstacles>();
}

}  // namespace hamelin::planning

/// A query handle.
struct hamelin_query {
  std::unique_ptr<hamelin::planning::QueryServices> services;
};

namespace hamelin::planning {

// ---- LoadedPlanner

struct LoadedPlanner::Instance {
  Instance(Plugin p, SetupData s, HostServices& h)
      : plugin(std::move(p)), setup_data(std::move(s)), services(&h) {
    setup = setup_data.view();
    host.struct_size = sizeof host;
    host.abi_version = HAMELIN_PLUGIN_ABI_VERSION;
    host.abi_version_min = HAMELIN_PLUGIN_ABI_VERSION_MIN;
    host.context = this;
    host.log = &Instance::log;
    host.closest_points = &Instance::closest_points;
    host.closest_self = &Instance::closest_self;
    host.obstacles = &Instance::obstacles;
    host.declare_series = &Instance::declare_series;
    host.open_query = &Instance::open_query;
    host.close_query = [](hamelin_query* query) noexcept { delete query; };
    host.query_refresh = &Instance::query_refresh;
    add_query_functions(host);
    host.closest_ahead = &Instance::closest_ahead;
    host.obstacles_ahead = &Instance::obstacles_ahead;
    host.draw_path = &Instance::draw_path;
    host.request_path = &Instance::request_path;
    error[0] = '\0';
  }
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;
  ~Instance() {
    if (planner != nullptr) plugin.library_->raw->destroy(planner);
  }

  // No exception of the host may propagate through the plugin's frames: its message is kept and the
  // plugin's call fails.
  template <class F>
  void guarded(F&& call) noexcept {
    try {
      call();
    } catch (const std::exception& e) {
      fail(e.what());
    } catch (...) {
      fail("a host service failed");
    }
  }
  void fail(std::string_view text) noexcept {
    host_failed = true;
    const std::size_t size = std::min(text.size(), error.size() - 1);
    std::copy_n(text.data(), size, error.data());
    error[size] = '\0';
  }
  static void log(void* context, std::int32_t level, const char* text, std::size_t size) noexcept {
    auto& self = *static_cast<Instance*>(context);
    self.guarded([&] { self.services->log(level, {text, size}); });
  }
  static std::size_t closest_points(void* context, const double* q, double influence_m,
                                    hamelin_contact* out, std::size_t capacity,
                                    std::size_t stride) noexcept {
    auto& self = *static_cast<Instance*>(context);
    std::size_t count = 0;
    self.guarded([&] {
      count =
          self.services->closest_points({q, self.setup.dof}, influence_m, {out, capacity, stride});
    });
    return count;
  }
  static std::size_t closest_ahead(void* context, const double* q, double time_ahead_s,
                                   std::int32_t kinds, double influence_m, hamelin_contact* out,
                                   std::size_t capacity, std::size_t stride) noexcept {
    auto& self = *static_cast<Instance*>(context);
    std::size_t count = 0;
    self.guarded([&] {
      count = self.services->closest_ahead({q, self.setup.dof}, time_ahead_s, kinds, influence_m,
                                           {out, capacity, stride});
    });
    return count;
  }
  static std::size_t closest_self(void* context, const double* q, double influence_m,
                                  hamelin_self_contact* out, std::size_t capacity,
                                  std::size_t stride) noexcept {
    auto& self = *static_cast<Instance*>(context);
    std::size_t count = 0;
    self.guarded([&] {
      count =
          self.services->closest_self({q, self.setup.dof}, influence_m, {out, capacity, stride});
    });
    return count;
  }
  static std::size_t obstacles_ahead(void* context, double time_ahead_s, std::int32_t kinds,
                                     hamelin_obstacle_state* out, std::size_t capacity,
                                     std::size_t stride) noexcept {
    auto& self = *static_cast<Instance*>(context);
    std::size_t count = 0;
    self.guarded([&] {
      count = self.services->obstacles_ahead(time_ahead_s, kinds, {out, capacity, stride});
    });
    return count;
  }
  static std::size_t obstacles(void* context, hamelin_obstacle_state* out, std::size_t capacity,
                               std::size_t stride) noexcept {
    auto& self = *static_cast<Instance*>(context);
    std::size_t count = 0;
    self.guarded([&] { count = self.services->obstacles({out, capacity, stride}); });
    return count;
  }
  static void draw_path(void* context, const double* points_world_m, std::size_t count) noexcept {
    auto& self = *static_cast<Instance*>(context);
    self.guarded([&] { self.services->draw_path({points_world_m, 3 * count}); });
  }
  static std::int32_t request_path(void* context) noexcept {
    auto& self = *static_cast<Instance*>(context);
    bool will_search = false;
    self.guarded([&] { will_search = self.services->request_path(); });
    return will_search ? 1 : 0;
  }
  static std::int32_t declare_series(void* context, const char* name, const char* unit) noexcept {
    auto& self = *static_cast<Instance*>(context);
    std::int32_t index = -1;
    self.guarded([&] {
      const std::string text = name != nullptr ? name : "";
      const bool used = std::any_of(self.series.begin(), self.series.end(),
                                    [&](const Series& other) { return other.name == text; });
      if (text.empty() || used) return;
      self.series.push_back({text, unit != nullptr ? unit : ""});
      index = static_cast<std::int32_t>(self.series.size()) - 1;
    });
    return index;
  }

  // Queries may come from any thread, so they must not touch `error`.
  static hamelin_query* open_query(void* context) noexcept {
    auto& self = *static_cast<Instance*>(context);
    try {
      return std::make_unique<hamelin_query>(hamelin_query{self.services->open_query()}).release();
    } catch (const std::exception&) {
      return nullptr;
    }
  }
  static std::int32_t query_refresh(hamelin_query* query, std::uint64_t* world,
                                    double* time_s) noexcept {
    try {
      const QueryServices::Snapshot now = query->services->refresh();
      if (world != nullptr) *world = now.world;
      if (time_s != nullptr) *time_s = now.time_s;
      return 0;
    } catch (const std::exception&) {
      return 1;
    }
  }
  static void add_query_functions(hamelin_host& host) noexcept {
    host.query_clearance = [](hamelin_query* query, const double* q, std::size_t count,
                              double time_ahead_s, double at_least_m, double* out) noexcept {
      query->services->clearance(q, count, time_ahead_s, at_least_m, out);
    };
    host.query_contacts = [](hamelin_query* query, const double* q, double time_ahead_s,
                             double influence_m, hamelin_contact* out, std::size_t capacity,
                             std::size_t stride) noexcept {
      return query->services->contacts(q, time_ahead_s, influence_m, {out, capacity, stride});
    };
    host.query_self_contacts = [](hamelin_query* query, const double* q, double influence_m,
                                  hamelin_self_contact* out, std::size_t capacity,
                                  std::size_t stride) noexcept {
      return query->services->self_contacts(q, influence_m, {out, capacity, stride});
    };
    host.query_motion_clear = [](hamelin_query* query, const double* q0, const double* q1,
                                 double t0_s, double t1_s, double* margin_m) noexcept {
      double margin = 0.0;
      const bool clear = query->services->motion_clear(q0, q1, t0_s, t1_s, margin);
      if (clear && margin_m != nullptr) *margin_m = margin;
      return static_cast<std::int32_t>(clear ? 1 : 0);
    };
    host.query_distance = [](hamelin_query* query, const double* points, std::size_t count,
                             double time_ahead_s, double limit_m, double* distance_m,
                             double* gradient) noexcept {
      query->services->distance(points, count, time_ahead_s, limit_m, distance_m, gradient);
    };
    host.query_boxes = [](hamelin_query* query, const double* low, const double* high,
                          hamelin_box* out, std::size_t capacity, std::size_t stride) noexcept {
      return query->services->boxes(Eigen::Vector3d::Map(low), Eigen::Vector3d::Map(high),
                                    {out, capacity, stride});
    };
    host.query_obstacles = [](hamelin_query* query, double time_ahead_s,
                              hamelin_obstacle_state* out, std::size_t capacity,
                              std::size_t stride) noexcept {
      return query->services->obstacles(time_ahead_s, {out, capacity, stride});
    };
  }

  Plugin plugin;
  SetupData setup_data;
  HostServices* services;
  hamelin_setup setup{};
  hamelin_host host{};
  std::vector<Series> series;
  void* planner = nullptr;
  bool host_failed = false;
  std::array<char, 512> error{};
};

// ---- PreparedParams

struct PreparedParams::Data {
  Plugin plugin;
  void* raw = nullptr;
  ~Data() {
    if (raw != nullptr) plugin.library_->raw->free_params(raw);
  }
  Data(Plugin of, void* params) : plugin(std::move(of)), raw(params) {}
  Data(const Data&) = delete;
  Data& operator=(const Data&) = delete;
};

PreparedParams::PreparedParams(std::unique_ptr<Data> data) : data_(std::move(data)) {}
PreparedParams::~PreparedParams() = default;
PreparedParams::PreparedParams(PreparedParams&&) noexcept = default;

LoadedPlanner Plugin::create(SetupData setup, HostServices& services,
                             const Json& checked_params) const {
  auto instance = std::make_unique<LoadedPlanner::Instance>(*this, std::move(setup), services);
  const std::string params = checked_params.dump();
  std::array<char, 512> text{};
  const auto failed =
      library_->raw->create(&instance->host, &instance->setup, params.data(), params.size(),
                            &instance->planner, text.data(), text.size());
  text.back() = '\0';
  std::string reason;
  if (instance->host_failed) {
    reason = instance->error.data();
  } else if (failed != 0) {
    reason = text.front() != '\0' ? text.data() : "no reason given";
  } else if (instance->planner == nullptr) {
    reason = "create returned no planner";
  }
  if (!reason.empty())
    throw Error(ErrorCode::plugin, one_line(fmt::format("{}: planner '{}' cannot start: {}",
                                                        file().string(), name(), reason)));
  return LoadedPlanner(std::move(instance));
}

LoadedPlanner::LoadedPlanner(std::unique_ptr<Instance> instance) : instance_(std::move(instance)) {}
LoadedPlanner::~LoadedPlanner() = default;
LoadedPlanner::LoadedPlanner(LoadedPlanner&&) noexcept = default;
LoadedPlanner& LoadedPlanner::operator=(LoadedPlanner&&) noexcept = default;

const Plugin& LoadedPlanner::plugin() const noexcept {
  return instance_->plugin;
}

bool LoadedPlanner::tick(const hamelin_tick& tick, CommandBuffers& out) noexcept {
  Instance& self = *instance_;
  out.clear();
  self.host_failed = false;
  self.error[0] = '\0';
  const std::size_t gyroscopic_capacity = out.raw().gyroscopic_capacity;
  const auto failed = self.plugin.library_->raw->tick(self.planner, &tick, &out.raw(),
                                                      self.error.data(), self.error.size());
  self.error.back() = '\0';
  if (self.host_failed) return false;
  if (failed != 0) {
    if (self.error[0] == '\0') self.fail("no reason given");
    return false;
  }
  if (const char* reason = defect(out, self.setup.dof, gyroscopic_capacity); reason != nullptr) {
    self.fail(reason);
    return false;
  }
  return true;
}

std::string_view LoadedPlanner::error() const noexcept {
  return instance_->error.data();
}

const std::vector<Series>& LoadedPlanner::series() const noexcept {
  return instance_->series;
}

PreparedParams LoadedPlanner::prepare_params(const Json& checked_params) const {
  const Plugin& plugin = instance_->plugin;
  const auto fail = [&](std::string_view reason) {
    throw Error(ErrorCode::invalid,
                one_line(fmt::format("parameters of planner '{}': {}", plugin.name(), reason)));
  };
  if (!plugin.can_change_params()) fail("cannot be changed while it runs");
  const std::string text = checked_params.dump();
  std::array<char, 512> error{};
  // made first, so that what the plugin makes has an owner
  auto data = std::make_unique<PreparedParams::Data>(plugin, nullptr);
  const auto failed = plugin.library_->raw->prepare_params(
      instance_->planner, text.data(), text.size(), &data->raw, error.data(), error.size());
  error.back() = '\0';
  if (failed != 0) fail(error.front() != '\0' ? error.data() : "no reason given");
  return PreparedParams(std::move(data));
}

void LoadedPlanner::apply_params(const PreparedParams& params) noexcept {
  instance_->plugin.library_->raw->apply_params(instance_->planner, params.data_->raw);
}

void LoadedPlanner::reset(const Eigen::VectorXd& q, const Eigen::VectorXd& v) noexcept {
  const auto* raw = instance_->plugin.library_->raw;
  if (raw->reset != nullptr) raw->reset(instance_->planner, q.data(), v.data());
}

void LoadedPlanner::world_changed(std::uint64_t world) noexcept {
  const auto* raw = instance_->plugin.library_->raw;
  if (raw->world_changed != nullptr) raw->world_changed(instance_->planner, world);
}

// ---- finding plugins

namespace {

std::vector<fs::path> plugin_files(const fs::path& directory) {
  std::vector<fs::path> files;
  std::error_code code;
  for (fs::directory_iterator it(directory, code), end; !code && it != end; it.increment(code)) {
    const std::string name = it->path().filename().string();
    if (name.size() > plugin_suffix.size() &&
        std::string_view(name).substr(name.size() - plugin_suffix.size()) == plugin_suffix)
      files.push_back(it->path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string planner_name(const fs::path& file) {
  const std::string name = file.filename().string();
  return name.substr(0, name.size() - plugin_suffix.size());
}

}  // namespace

std::vector<fs::path> plugin_directories(const std::vector<fs::path>& given,
                                         const std::vector<fs::path>& own) {
  std::vector<fs::path> all;
  const auto add = [&](const fs::path& directory) {
    if (!directory.empty() && std::find(all.begin(), all.end(), directory) == all.end())
      all.push_back(directory);
  };
  for (const auto& directory : given) add(directory);
  if (const char* variable = std::getenv("HAMELIN_PLUGIN_PATH"); variable != nullptr) {
    std::string_view rest = variable;
    while (!rest.empty()) {
      const auto colon = rest.find(':');
      add(fs::path(rest.substr(0, colon)));
      rest = colon == std::string_view::npos ? std::string_view{} : rest.substr(colon + 1);
    }
  }
  for (const auto& directory : own) add(directory);
  return all;
}

Plugin find_plugin(const std::string& name_or_path, const std::vector<fs::path>& directories) {
  return Plugin::load(find_plugin_file(name_or_path, directories));
}

fs::path find_plugin_file(const std::string& name_or_path,
                          const std::vector<fs::path>& directories) {
  const bool is_path =
      name_or_path.find('/') != std::string::npos ||
      (name_or_path.size() > plugin_suffix.size() &&
       name_or_path.substr(name_or_path.size() - plugin_suffix.size()) == plugin_suffix);
  if (is_path) return name_or_path;
  std::string searched;
  std::vector<std::string> names;
  for (const auto& directory : directories) {
    std::vector<std::string> here;
    for (const auto& file : plugin_files(directory)) {
      if (planner_name(file) == name_or_path) return file;
      here.push_back(planner_name(file));
    }
    std::error_code code;
    const std::string found = !here.empty() ? fmt::format("{}", fmt::join(here, ", "))
                              : fs::is_directory(directory, code) ? "no plugins"
                                                                  : "no such directory";
    searched += fmt::format("{}{} ({})", searched.empty() ? "" : "; ", directory.string(), found);
    names.insert(names.end(), here.begin(), here.end());
  }
  const std::string near = nearest_name(name_or_path, names);
  throw Error(
      ErrorCode::plugin,
      fmt::format("planner '{}': not found{}; searched for {}{} in: {}", name_or_path,
                  near.empty() ? "" : fmt::format(", did you mean '{}'?", near), name_or_path,
                  plugin_suffix, searched.empty() ? "no directory" : searched));
}

std::vector<ListedPlugin> list_plugins(const std::vector<fs::path>& directories) {
  std::vector<ListedPlugin> all;
  for (const auto& directory : directories) {
    for (const auto& file : plugin_files(directory)) {
      ListedPlugin listed{file, std::nullopt, {}};
      try {
        listed.plugin = Plugin::load(file);
      } catch (const Error& e) {
        listed.refusal = e.what();
      }
      all.push_back(std::move(listed));
    }
  }
  return all;
}

}  // namespace hamelin::planning
