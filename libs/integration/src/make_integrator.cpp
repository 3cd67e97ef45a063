#include <variant>

#include "check_options.hpp"
#include "further_integrators.hpp"
#include "reference/explicit.hpp"
#include "schemes/hamel.hpp"
#include "schemes/variational.hpp"
#include "state_owner.hpp"

namespace hamelin::integration {

namespace {

std::unique_ptr<Integrator> make(const Model& model, const Options& options) {
  if (const auto* o = std::get_if<HamelOptions>(&options))
    return std::make_unique<Hamel>(model, *o);
  if (const auto* o = std::get_if<HamelMidpointOptions>(&options))
    return std::make_unique<Hamel>(model, *o);
  if (const auto* o = std::get_if<VariationalOptions>(&options))
    return std::make_unique<Variational>(model, *o);
  if (const auto* o = std::get_if<SemiImplicitEulerOptions>(&options))
    return std::make_unique<SemiImplicitEuler>(model, *o);
  if (const auto* o = std::get_if<Rk4Options>(&options)) return std::make_unique<Rk4>(model, *o);
  return make_further(model, options);
}

}  // namespace

std::unique_ptr<Integrator> make_integrator(const Model& model, const Options& options) {
  const Options valid = checked(options);
  auto integrator = make(model, valid);
  integrator->prepare(owner_of_states(model, valid));
  return integrator;
}

std::unique_ptr<Integrator> make_integrator(std::string_view name, const Model& model,
                                            const Parameters& parameters) {
  return make_integrator(model, make_options(name, parameters));
}

}  // namespace hamelin::integration
