// Compiled once per instruction set; dynamics/kernel/lanes.hpp says what may be used here.
#include "gauss.hpp"
#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"

namespace hamelin::integration::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

namespace {

// Up to four stages use registers of four lanes: half-empty wide registers cost more than full
// narrow ones.
template <template <class> class Group>
struct Entry {
  using Chain = typename Group<double>::Chain;
  static constexpr int narrow =
      dynamics::kernel::native_lanes < 4 ? dynamics::kernel::native_lanes : 4;
  static constexpr int wide = dynamics::kernel::native_lanes;

  static std::size_t bytes(std::size_t n, std::size_t stages) noexcept {
    // the momentum form has more unknowns
    return stages <= 4 ? Gauss<Group, narrow, GaussForm::momentum>::bytes(n, stages)
                       : Gauss<Group, wide, GaussForm::momentum>::bytes(n, stages);
  }
  static GaussOutcome step(const GaussCall<Chain>& call, void* memory) noexcept {
    return call.tableau.stages <= 4 ? step_in_form<narrow>(call, memory)
                                    : step_in_form<wide>(call, memory);
  }
  template <int W>
  static GaussOutcome step_in_form(const GaussCall<Chain>& call, void* memory) noexcept {
    return call.form == GaussForm::momentum
               ? Gauss<Group, W, GaussForm::momentum>::step(call, memory)
               : Gauss<Group, W, GaussForm::velocity>::step(call, memory);
  }
  static constexpr GaussEntry<Chain> entry{bytes, step};
};

}  // namespace

extern const GaussSet gauss_set;
constexpr GaussSet gauss_set{
    Entry<dynamics::kernel::SpatialPlain>::entry, Entry<dynamics::kernel::SpatialMixed>::entry,
    Entry<dynamics::kernel::PlanarPlain>::entry, Entry<dynamics::kernel::PlanarMixed>::entry};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel
