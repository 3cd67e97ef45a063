#pragma once
#include "hamelin/model/chain.hpp"

namespace hamelin::dynamics::kernel {

/// Entry points for the four kinds of chains, each compiled for what it needs only: `Entry<Chain>` is a table of
/// functions over a chain. Plain chains have revolute joints and no rotor inertias. dispatch.hpp chooses.
template <template <class> class Entry>
struct Groups {
  Entry<model::SpatialChain> spatial_plain, spatial_mixed;
  Entry<model::PlanarChain> planar_plain, planar_mixed;
};

}  // namespace hamelin::dynamics::kernel
