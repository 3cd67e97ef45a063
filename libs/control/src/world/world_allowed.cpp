// What goals may touch: the same world with that left out.
#include <algorithm>
#include <utility>

#include "hamelin/control/world.hpp"
#include "hamelin/core/error.hpp"

namespace hamelin::control {

namespace {

scene::Allowance of_map(const scene::Allowance& all) {
  return {all.boxes_m, {}};
}

}  // namespace

World::View& World::View::with(std::uint64_t allowance) noexcept {
  for (View& view : allowed)
    if (view.snapshot->allowance == allowance) return view;
  return *this;
}

World::Allowed& World::allowed(std::vector<Allowed>& among, const scene::Allowance& allowance) {
  const auto known = std::find_if(among.begin(), among.end(), [&](const Allowed& other) {
    return other.allowance == allowance;
  });
  if (known != among.end()) return *known;
  scene::Environment map = latest()->environment.with_allowance(of_map(allowance));
  if (prepares_maps()) map.prepare();
  return among.emplace_back(Allowed{++last_allowance_, 0, allowance, std::move(map)});
}

bool World::allows() const {
  const std::lock_guard lock(mutex_);
  return !allowed_.empty();
}

std::vector<std::uint64_t> World::allow(const std::vector<scene::Allowance>& allowances) {
  for (const scene::Allowance& allowance : allowances) check(allowance, "may_touch");
  std::vector<std::uint64_t> out(allowances.size(), 0);
  const bool none = std::all_of(allowances.begin(), allowances.end(),
                                [](const auto& allowance) { return allowance.empty(); });
  if (none && !allows()) return out;
  const std::lock_guard map_lock(map_mutex_);
  std::vector<Allowed> next = allowed_;
  ++allowed_lists_;
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (allowances[i].empty()) continue;
    Allowed& entry = allowed(next, allowances[i]);
    entry.list = allowed_lists_;
    out[i] = entry.number;
  }
  std::erase_if(next, [&](const Allowed& entry) { return entry.list + 1 < allowed_lists_; });
  const std::lock_guard lock(mutex_);
  allowed_ = std::move(next);
  publish(latest_->environment, latest_->obstacle_ids, Changes::moving);
  return out;
}

std::vector<World::Allowed> World::allowed_in(const scene::Environment& environment) const {
  std::vector<Allowed> out = allowed_;
  for (Allowed& entry : out) {
    entry.map = environment.with_allowance(of_map(entry.allowance));
    if (prepares_maps()) entry.map.prepare();
  }
  return out;
}

std::shared_ptr<const WorldSnapshot> World::snapshot_with(const Allowed& allowed,
                                                          const WorldSnapshot& all,
                                                          Changes changes) {
  auto out = std::make_shared<WorldSnapshot>();
  out->number = ++last_number_;
  out->environment = allowed.map.with_obstacles(all.environment.obstacles())
                         .with_allowance({{}, allowed.allowance.obstacles});
  out->obstacle_ids = all.obstacle_ids;
  out->allowance = allowed.number;
  const auto& before = latest_->allowed;
  const auto same = std::find_if(before.begin(), before.end(), [&](const auto& snapshot) {
    return snapshot->allowance == allowed.number;
  });
  out->standing =
      changes == Changes::standing || same == before.end() ? out->number : (*same)->standing;
  return out;
}

}  // namespace hamelin::control
