#include "kernels.hpp"

#include "hamelin/dynamics/kernel/dispatch.hpp"

namespace hamelin::dynamics {

HAMELIN_SELECT_KERNELS(KernelSet, set)

const KernelSet& kernels() {
  return selected_set();
}

}  // namespace hamelin::dynamics
