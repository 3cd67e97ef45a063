#include "kernels.hpp"

#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

namespace hamelin::cost {

using Space = dynamics::kernel::SpatialPlain<double>;
using Scratch = dynamics::kernel::Scratch<Space>;

std::size_t memory_bytes(std::size_t links) {
  return Scratch::bytes(links);
}
void forward_dynamics(const model::SpatialChain& chain, void* memory, const double* q,
                      const double* v, const double* tau, double* a) noexcept {
  dynamics::kernel::forward_dynamics<Space>(chain, Scratch::at(memory, chain.links.size()), q, v,
                                            tau, a);
}
void inverse_dynamics(const model::SpatialChain& chain, void* memory, const double* q,
                      const double* v, const double* a, double* tau) noexcept {
  dynamics::kernel::inverse_dynamics<Space>(chain, Scratch::at(memory, chain.links.size()), q, v, a,
                                            tau);
}

}  // namespace hamelin::cost
