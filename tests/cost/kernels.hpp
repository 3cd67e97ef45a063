#pragma once
#include <cstddef>

#include "hamelin/model/chain.hpp"

/// Forward and inverse dynamics straight from the library's sweeps, for links that turn and have no rotors.
namespace hamelin::cost {

/// Scratch that both need, aligned to 64.
[[nodiscard]] std::size_t memory_bytes(std::size_t links);
void forward_dynamics(const model::SpatialChain& chain, void* memory, const double* q, const double* v,
                      const double* tau, double* a) noexcept;
void inverse_dynamics(const model::SpatialChain& chain, void* memory, const double* q, const double* v, const double* a,
                      double* tau) noexcept;

}  // namespace hamelin::cost
