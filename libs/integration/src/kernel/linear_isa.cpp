// Compiled once per instruction set; dynamics/kernel/lanes.hpp says what may be used here.
#include "linear.hpp"

namespace hamelin::integration::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

extern const LinearKernels linear_set;
constexpr LinearKernels linear_set{solve, subtract_product, combine};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel
