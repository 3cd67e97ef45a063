#include "kernels.hpp"

#include "hamelin/dynamics/kernel/dispatch.hpp"

namespace hamelin::dynamics {

HAMELIN_SELECT_KERNELS(KernelSet, set)

const KernelSet& kernels(Isa isa) {
  return select_set(isa);
}

}  // namespace hamelin::dynamics
