// Compiled once per instruction set; kernel/lanes.hpp explains which functions may be used here.
#include "derivative_kernels.hpp"

namespace hamelin::dynamics {
namespace HAMELIN_ISA_NAMESPACE {

namespace {

using kernel::DerivativeScratch;

std::size_t bytes(std::size_t links) noexcept {
  return DerivativeScratch::bytes(links);
}
std::size_t leading(std::size_t links) noexcept {
  return kernel::padded(links);
}
void inverse_dynamics(std::size_t n, void* memory, const kernel::DerivativeLink* links,
                      const kernel::DerivativeFrame* frames, const geometry::Vec3<double>& gravity,
                      const double* v, const double* a, double* dq, double* dv,
                      double* M) noexcept {
  const DerivativeScratch k = DerivativeScratch::at(memory, n);
  kernel::sweep_outwards(
      k, links, [&](std::size_t i) -> const auto& { return frames[i]; }, gravity, v, a);
  kernel::sweep_inwards(k, links, dq, dv, M);
}
void forward_dynamics(std::size_t n, const double* dq, const double* dv, double* M, double* da_dq,
                      double* da_dv) noexcept {
  const std::size_t ld = leading(n);
  kernel::invert(n, ld, M);
  kernel::minus_product(n, ld, M, dq, da_dq);
  kernel::minus_product(n, ld, M, dv, da_dv);
}

void kinetic(std::size_t n, void* memory, const kernel::DerivativeLink* links,
             const kernel::DerivativeFrame* frames, const double* v,
             const kernel::KineticOutput& out) noexcept {
  kernel::kinetic_hessian(DerivativeScratch::at(memory, n), links, frames, v, out);
}
void potential(std::size_t n, void* memory, const kernel::DerivativeLink* links,
               const kernel::DerivativeFrame* frames, const geometry::Vec3<double>& gravity,
               const kernel::PotentialOutput& out) noexcept {
  kernel::potential_hessian(DerivativeScratch::at(memory, n), links, frames, gravity, out);
}

}  // namespace

extern const DerivativeKernels derivative_set;
constexpr DerivativeKernels derivative_set{bytes,   leading,  inverse_dynamics, forward_dynamics,
                                           kinetic, potential};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics
