#pragma once
#include <cstddef>

#include "hamelin/model/chain.hpp"

/// Forward and inverse dynamics, called directly in the library's sweeps, for revolute joints
/// without rotors.
namespace hamelin::cost {

/// Size of the memory that both functions need, aligned to 64 bytes.
[[nodiscard]] std::size_t memory_bytes(std::size_t links);
void forward_dynamics(const model::SpatialChain& chain, void* memory, const double* q,
                      const double* v, const double* tau, double* a) noexcept;
void inverse_dynamics(const model::SpatialChain& chain, void* memory, const double* q,
                      const double* v, const double* a, double* tau) noexcept;

}  // namespace hamelin::cost
