// Compiled once per instruction set; dynamics/kernel/lanes.hpp says what may be used here.
#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "variational.hpp"

namespace hamelin::integration::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

namespace {

template <template <class> class Group>
constexpr VariationalEntry<typename Group<double>::Chain> entry{
    Variational<Group<double>>::bytes, Variational<Group<double>>::step,
    Variational<Group<double>>::evaluate};

}  // namespace

extern const VariationalSet variational_set;
constexpr VariationalSet variational_set{
    entry<dynamics::kernel::SpatialPlain>, entry<dynamics::kernel::SpatialMixed>,
    entry<dynamics::kernel::PlanarPlain>, entry<dynamics::kernel::PlanarMixed>};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel
