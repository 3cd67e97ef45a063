#include "further_integrators.hpp"

#include <variant>

#include "reference/composition.hpp"
#include "reference/dop853.hpp"
#include "reference/energy_attractor.hpp"
#include "reference/lie_exact.hpp"
#include "reference/newmark.hpp"
#include "reference/rosenbrock.hpp"
#include "schemes/gauss.hpp"

namespace hamelin::integration {

std::unique_ptr<Integrator> make_further(const Model& model, const Options& options) {
  if (const auto* o = std::get_if<GaussOptions>(&options))
    return std::make_unique<GaussLegendre>(model, *o);
  if (const auto* o = std::get_if<LieExactOptions>(&options))
    return std::make_unique<LieExact>(model, *o);
  if (const auto* o = std::get_if<CompositionOptions>(&options))
    return std::make_unique<Composition>(model, *o);
  if (const auto* o = std::get_if<NewmarkOptions>(&options))
    return std::make_unique<Newmark>(model, *o);
  if (const auto* o = std::get_if<EnergyAttractorOptions>(&options))
    return std::make_unique<EnergyAttractor>(model, *o);
  if (const auto* o = std::get_if<Dop853Options>(&options))
    return std::make_unique<Dop853>(model, *o);
  return std::make_unique<Rosenbrock>(model, std::get<RosenbrockOptions>(options));
}

}  // namespace hamelin::integration
