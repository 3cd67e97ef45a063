#include "kernels.hpp"

namespace hamelin::dynamics {

namespace isa_baseline {
extern const KernelSet set;
}
#if defined(__x86_64__)
namespace isa_v3 {
extern const KernelSet set;
}
namespace isa_v4 {
extern const KernelSet set;
}
#endif

const KernelSet& kernels() {
  switch (selected_isa()) {
#if defined(__x86_64__)
    case Isa::v4:
      return isa_v4::set;
    case Isa::v3:
      return isa_v3::set;
#endif
    default:
      return isa_baseline::set;
  }
}

}  // namespace hamelin::dynamics
