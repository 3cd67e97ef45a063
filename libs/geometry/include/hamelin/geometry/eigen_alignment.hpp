#pragma once
#include <Eigen/Core>

/// Eigen chooses the layout and alignment of its types by the instruction set in the compiler's
/// options. Two parts of a program built with different options (-mavx2 in one of them) corrupt
/// each other's memory. Every header of hamelin with Eigen types includes this one, so each object
/// file refers to a symbol that is named after its alignment. The library defines only the symbol
/// of its own alignment; a program that would crash does not link.
#define HAMELIN_JOIN_EXPANDED(a, b) a##b
#define HAMELIN_JOIN(a, b) HAMELIN_JOIN_EXPANDED(a, b)
#define HAMELIN_EIGEN_ALIGNMENT HAMELIN_JOIN(hamelin_eigen_max_align_, EIGEN_MAX_ALIGN_BYTES)

extern "C" const char HAMELIN_EIGEN_ALIGNMENT;

namespace hamelin::geometry::detail {

// The attribute "used" keeps this pointer, and with it the reference, in the object file.
[[gnu::used]] inline const char* const eigen_alignment = &HAMELIN_EIGEN_ALIGNMENT;

}  // namespace hamelin::geometry::detail
