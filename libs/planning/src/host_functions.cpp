#include "host_functions.hpp"

#include <algorithm>
#include <memory>
#include <string>

#include "hamelin/core/numbers.hpp"

/// A query handle.
struct hamelin_query {
  std::unique_ptr<hamelin::planning::QueryServices> services;
};

namespace hamelin::planning {

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

HostFunctions::HostFunctions(HostServices& services, std::size_t dof)
    : services_(services), dof_(dof) {
  raw_.struct_size = sizeof raw_;
  raw_.abi_version = HAMELIN_PLUGIN_ABI_VERSION;
  raw_.abi_version_min = HAMELIN_PLUGIN_ABI_VERSION_MIN;
  raw_.context = this;
  add_functions();
  add_contact_functions();
  add_obstacle_functions();
  add_query_handles();
  add_query_functions();
}

void HostFunctions::add_functions() noexcept {
  raw_.log = [](void* context, std::int32_t level, const char* text, std::size_t size) noexcept {
    auto& self = of(context);
    self.guarded([&] { self.services_.log(level, {text, size}); });
  };
  raw_.draw_path = [](void* context, const double* points_world_m, std::size_t count) noexcept {
    auto& self = of(context);
    self.guarded([&] { self.services_.draw_path({points_world_m, 3 * count}); });
  };
  raw_.request_path = [](void* context) noexcept {
    auto& self = of(context);
    const bool will_search = self.guarded_or(false, [&] { return self.services_.request_path(); });
    return std::int32_t{will_search ? 1 : 0};
  };
  raw_.declare_series = [](void* context, const char* name, const char* unit) noexcept {
    auto& self = of(context);
    return self.guarded_or(std::int32_t{-1}, [&] {
      return self.declare_series(name != nullptr ? name : "", unit != nullptr ? unit : "");
    });
  };
}

std::int32_t HostFunctions::declare_series(const std::string& name, const char* unit) {
  const bool used = std::any_of(series_.begin(), series_.end(),
                                [&](const Series& other) { return other.name == name; });
  if (name.empty() || used) return -1;
  series_.push_back({name, unit});
  return static_cast<std::int32_t>(series_.size()) - 1;
}

void HostFunctions::add_contact_functions() noexcept {
  raw_.closest_points = [](void* context, const double* q, double influence_m, hamelin_contact* out,
                           std::size_t capacity, std::size_t stride) noexcept {
    auto& self = of(context);
    return self.guarded_or(std::size_t{0}, [&] {
      return self.services_.closest_points({q, self.dof_}, influence_m, {out, capacity, stride});
    });
  };
  raw_.closest_ahead = [](void* context, const double* q, double time_ahead_s, std::int32_t kinds,
                          double influence_m, hamelin_contact* out, std::size_t capacity,
                          std::size_t stride) noexcept {
    auto& self = of(context);
    return self.guarded_or(std::size_t{0}, [&] {
      return self.services_.closest_ahead({q, self.dof_}, time_ahead_s, kinds, influence_m,
                                          {out, capacity, stride});
    });
  };
  raw_.closest_self = [](void* context, const double* q, double influence_m,
                         hamelin_self_contact* out, std::size_t capacity,
                         std::size_t stride) noexcept {
    auto& self = of(context);
    return self.guarded_or(std::size_t{0}, [&] {
      return self.services_.closest_self({q, self.dof_}, influence_m, {out, capacity, stride});
    });
  };
}

void HostFunctions::add_obstacle_functions() noexcept {
  raw_.obstacles = [](void* context, hamelin_obstacle_state* out, std::size_t capacity,
                      std::size_t stride) noexcept {
    auto& self = of(context);
    return self.guarded_or(std::size_t{0}, [&] {
      return self.services_.obstacles({out, capacity, stride});
    });
  };
  raw_.obstacles_ahead = [](void* context, double time_ahead_s, std::int32_t kinds,
                            hamelin_obstacle_state* out, std::size_t capacity,
                            std::size_t stride) noexcept {
    auto& self = of(context);
    return self.guarded_or(std::size_t{0}, [&] {
      return self.services_.obstacles_ahead(time_ahead_s, kinds, {out, capacity, stride});
    });
  };
}

// Queries may come from any thread, so they must not touch the error.
void HostFunctions::add_query_handles() noexcept {
  raw_.open_query = [](void* context) noexcept -> hamelin_query* {
    try {
      return std::make_unique<hamelin_query>(hamelin_query{of(context).services_.open_query()})
          .release();
    } catch (const std::exception&) {
      return nullptr;
    }
  };
  raw_.close_query = [](hamelin_query* query) noexcept { delete query; };
  raw_.query_refresh = [](hamelin_query* query, std::uint64_t* world,
                          double* time_s) noexcept -> std::int32_t {
    try {
      const QueryServices::Snapshot now = query->services->refresh();
      if (world != nullptr) *world = now.world;
      if (time_s != nullptr) *time_s = now.time_s;
      return 0;
    } catch (const std::exception&) {
      return 1;
    }
  };
}

void HostFunctions::add_query_functions() noexcept {
  raw_.query_clearance = [](hamelin_query* query, const double* q, std::size_t count,
                            double time_ahead_s, double at_least_m, double* out) noexcept {
    query->services->clearance(q, count, time_ahead_s, at_least_m, out);
  };
  raw_.query_contacts = [](hamelin_query* query, const double* q, double time_ahead_s,
                           double influence_m, hamelin_contact* out, std::size_t capacity,
                           std::size_t stride) noexcept {
    return query->services->contacts(q, time_ahead_s, influence_m, {out, capacity, stride});
  };
  raw_.query_self_contacts = [](hamelin_query* query, const double* q, double influence_m,
                                hamelin_self_contact* out, std::size_t capacity,
                                std::size_t stride) noexcept {
    return query->services->self_contacts(q, influence_m, {out, capacity, stride});
  };
  raw_.query_motion_clear = [](hamelin_query* query, const double* q0, const double* q1,
                               double t0_s, double t1_s, double* margin_m) noexcept {
    double margin = 0.0;
    const bool clear = query->services->motion_clear(q0, q1, t0_s, t1_s, margin);
    if (clear && margin_m != nullptr) *margin_m = margin;
    return static_cast<std::int32_t>(clear ? 1 : 0);
  };
  raw_.query_distance = [](hamelin_query* query, const double* points, std::size_t count,
                           double time_ahead_s, double limit_m, double* distance_m,
                           double* gradient) noexcept {
    query->services->distance(points, count, time_ahead_s, limit_m, distance_m, gradient);
  };
  raw_.query_boxes = [](hamelin_query* query, const double* low, const double* high,
                        hamelin_box* out, std::size_t capacity, std::size_t stride) noexcept {
    return query->services->boxes(Eigen::Vector3d::Map(low), Eigen::Vector3d::Map(high),
                                  {out, capacity, stride});
  };
  raw_.query_obstacles = [](hamelin_query* query, double time_ahead_s, hamelin_obstacle_state* out,
                            std::size_t capacity, std::size_t stride) noexcept {
    return query->services->obstacles(time_ahead_s, {out, capacity, stride});
  };
}

}  // namespace hamelin::planning
