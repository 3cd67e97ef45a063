#include <fmt/format.h>

#include <array>
#include <memory>
#include <string>
#include <utility>

#include "command_buffers.hpp"
#include "hamelin/core/error.hpp"
#include "host_functions.hpp"
#include "plugin_library.hpp"

namespace hamelin::planning {

struct LoadedPlanner::Instance {
  Instance(Plugin p, SetupData s, HostServices& services)
      : plugin(std::move(p)),
        setup_data(std::move(s)),
        setup(setup_data.view()),
        host(services, setup_data.dof) {}
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;
  ~Instance() {
    if (planner != nullptr) plugin.library_->raw->destroy(planner);
  }

  Plugin plugin;
  SetupData setup_data;
  hamelin_setup setup;
  HostFunctions host;
  void* planner = nullptr;
};

struct PreparedParams::Data {
  explicit Data(Plugin of) : plugin(std::move(of)) {}
  Data(const Data&) = delete;
  Data& operator=(const Data&) = delete;
  ~Data() {
    if (raw != nullptr) plugin.library_->raw->free_params(raw);
  }

  Plugin plugin;
  void* raw = nullptr;
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
      library_->raw->create(&instance->host.raw(), &instance->setup, params.data(), params.size(),
                            &instance->planner, text.data(), text.size());
  text.back() = '\0';
  std::string reason;
  if (instance->host.failed()) {
    reason = instance->host.error().data();
  } else if (failed != 0) {
    reason = text.front() != '\0' ? text.data() : "no reason given";
  } else if (instance->planner == nullptr) {
    reason = "create returned no planner";
  }
  if (!reason.empty())
    throw Error(ErrorCode::plugin,
                fmt::format("{}: planner '{}' cannot start: {}", file().string(), name(), reason));
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
  self.host.clear_error();
  auto& error = self.host.error();
  const std::size_t gyroscopic_capacity = out.raw().gyroscopic_capacity;
  const auto failed =
      self.plugin.library_->raw->tick(self.planner, &tick, &out.raw(), error.data(), error.size());
  error.back() = '\0';
  if (self.host.failed()) return false;
  if (failed != 0) {
    if (error.front() == '\0') self.host.fail("no reason given");
    return false;
  }
  if (const char* reason = defect(out, self.setup.dof, gyroscopic_capacity); reason != nullptr) {
    self.host.fail(reason);
    return false;
  }
  return true;
}

std::string_view LoadedPlanner::error() const noexcept {
  return instance_->host.error().data();
}

const std::vector<Series>& LoadedPlanner::series() const noexcept {
  return instance_->host.series();
}

PreparedParams LoadedPlanner::prepare_params(const Json& checked_params) const {
  const Plugin& plugin = instance_->plugin;
  const auto fail = [&](std::string_view reason) {
    throw Error(ErrorCode::invalid,
                fmt::format("parameters of planner '{}': {}", plugin.name(), reason));
  };
  if (!plugin.can_change_params()) fail("cannot be changed while it runs");
  const std::string text = checked_params.dump();
  std::array<char, 512> error{};
  // made first, so that what the plugin makes has an owner
  auto data = std::make_unique<PreparedParams::Data>(plugin);
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

}  // namespace hamelin::planning
