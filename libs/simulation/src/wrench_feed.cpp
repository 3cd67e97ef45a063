#include "wrench_feed.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <limits>

#include "scene_places.hpp"

namespace hamelin::simulation {

WrenchFeed::WrenchFeed(const std::vector<scene::WrenchSpec>& given, const model::Model& model,
                       const std::string& place) {
  for (std::size_t i = 0; i < given.size(); ++i) {
    const scene::WrenchSpec& spec = given[i];
    Timed out{model.robot().tip.name,
              {},
              spec.from_s,
              spec.to_s.value_or(std::numeric_limits<double>::infinity())};
    if (!spec.frame.empty()) {
      out.name = spec.frame;
      out.wrench.frame = named_frame(model, spec.frame, fmt::format("{}/{}/frame", place, i));
    }
    out.wrench.reference = spec.reference;
    out.wrench.wrench << spec.moment_Nm, spec.force_N;
    all_.push_back(std::move(out));
  }
  active_.reserve(all_.size());
}

bool WrenchFeed::advance(double time_s) {
  bool changed = false;
  for (Timed& each : all_) {
    const double now_s = time_s + time_rounding_s;
    const bool acts = each.from_s <= now_s && now_s < each.to_s;
    changed = changed || acts != each.acts;
    each.acts = acts;
  }
  if (!changed) return false;
  active_.clear();
  for (const Timed& each : all_)
    if (each.acts) active_.push_back(each.wrench);
  return true;
}

std::string WrenchFeed::describe() const {
  std::vector<std::string> parts;
  for (const Timed& each : all_) {
    if (!each.acts) continue;
    const Eigen::Vector3d force = each.wrench.wrench.tail<3>(),
                          moment = each.wrench.wrench.head<3>();
    std::string part = fmt::format("'{}'", each.name);
    if (!force.isZero(0.0)) part += fmt::format(" by {:.6g} N", force.norm());
    if (!moment.isZero(0.0)) part += fmt::format(" by {:.6g} Nm", moment.norm());
    parts.push_back(std::move(part));
  }
  return parts.empty() ? "nothing pushes the arm any more"
                       : fmt::format("the arm is pushed: {}", fmt::join(parts, ", "));
}

}  // namespace hamelin::simulation
