#pragma once
#include <utility>
#include <variant>

#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/dynamics/kernel/groups.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::dynamics::kernel {

/// Calls f(entry, chain) with the entry for this kind of chain. This takes two branches per call.
template <template <class> class Entry, class F>
decltype(auto) with_group(const std::variant<model::SpatialChain, model::PlanarChain>& chain,
                          bool has_prismatic_or_rotor, const Groups<Entry>& groups, F&& f) {
  if (const auto* planar = std::get_if<model::PlanarChain>(&chain))
    return f(has_prismatic_or_rotor ? groups.planar_mixed : groups.planar_plain, *planar);
  return f(has_prismatic_or_rotor ? groups.spatial_mixed : groups.spatial_plain,
           std::get<model::SpatialChain>(chain));
}
template <template <class> class Entry, class F>
decltype(auto) with_group(const model::Model& model, const Groups<Entry>& groups, F&& f) {
  return with_group(model.chain(), model.has_prismatic_or_rotor(), groups, std::forward<F>(f));
}

}  // namespace hamelin::dynamics::kernel
