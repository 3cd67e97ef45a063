#pragma once
#include <Eigen/Core>

/// Eigen lays out and allocates its types as the instruction set of the compiler's options asks for, so two parts of a
/// program built with different ones (-mavx2 in one of them) corrupt each other's memory. Every header of hamelin with
/// Eigen types includes this one: each object file then asks for a symbol named after its alignment, of which the
/// library has its own only, and a program that would crash does not link.
#define HAMELIN_JOIN_EXPANDED(a, b) a##b
#define HAMELIN_JOIN(a, b) HAMELIN_JOIN_EXPANDED(a, b)
#define HAMELIN_EIGEN_ALIGNMENT HAMELIN_JOIN(hamelin_eigen_max_align_, EIGEN_MAX_ALIGN_BYTES)

extern "C" const char HAMELIN_EIGEN_ALIGNMENT;

namespace hamelin::geometry::detail {

// "used": the object file keeps it, and so the reference, though nothing reads it.
[[gnu::used]] inline const char* const eigen_alignment = &HAMELIN_EIGEN_ALIGNMENT;

}  // namespace hamelin::geometry::detail
