// In place of further_integrators.cpp in a build without them.
#include "further_integrators.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::integration {

std::unique_ptr<Integrator> make_further(const Model&, const Options& options) {
  throw Error(ErrorCode::usage,
              formatted("integrator '{}': is not part of this build; `./dev build demo` in the "
                        "checkout builds all integrators",
                        integrator_names()[options.index()]));
}

}  // namespace hamelin::integration
