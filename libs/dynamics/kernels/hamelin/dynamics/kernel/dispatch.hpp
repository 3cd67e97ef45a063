#pragma once
#include <variant>

#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/dynamics/kernel/groups.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::dynamics::kernel {

/// f(entry, chain) for this model's kind: two branches a call, none inside.
template <template <class> class Entry, class F>
decltype(auto) with_group(const model::Model& model, const Groups<Entry>& groups, F&& f) {
  if (const auto* planar = std::get_if<model::PlanarChain>(&model.chain()))
    return f(model.mixed() ? groups.planar_mixed : groups.planar_plain, *planar);
  return f(model.mixed() ? groups.spatial_mixed : groups.spatial_plain, std::get<model::SpatialChain>(model.chain()));
}

}  // namespace hamelin::dynamics::kernel
