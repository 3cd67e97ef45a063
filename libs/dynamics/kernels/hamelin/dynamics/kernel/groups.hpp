#pragma once
#include "hamelin/model/chain.hpp"

namespace hamelin::dynamics::kernel {

/// Entry points for the four kinds of chains; `Entry<Chain>` is a table of functions of a chain.
/// Plain chains have revolute joints and no rotor inertias; mixed chains may have prismatic joints
/// and rotor inertias. dispatch.hpp chooses between them.
template <template <class> class Entry>
struct Groups {
  Entry<model::SpatialChain> spatial_plain, spatial_mixed;
  Entry<model::PlanarChain> planar_plain, planar_mixed;
};

}  // namespace hamelin::dynamics::kernel
