#include <type_traits>

#include "check_options.hpp"
#include "reference/composition.hpp"
#include "reference/dop853.hpp"
#include "reference/energy_attractor.hpp"
#include "reference/explicit.hpp"
#include "reference/lie_exact.hpp"
#include "reference/newmark.hpp"
#include "reference/rosenbrock.hpp"
#include "schemes/gauss.hpp"
#include "schemes/hamel.hpp"
#include "schemes/variational.hpp"
#include "state_owner.hpp"

namespace hamelin::integration {

namespace {

std::unique_ptr<Integrator> make(const Model& model, const HamelOptions& o) {
  return std::make_unique<Hamel>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const HamelMidpointOptions& o) {
  return std::make_unique<Hamel>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const VariationalOptions& o) {
  return std::make_unique<Variational>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const GaussOptions& o) {
  return std::make_unique<GaussLegendre>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const LieExactOptions& o) {
  return std::make_unique<LieExact>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const CompositionOptions& o) {
  return std::make_unique<Composition>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const SemiImplicitEulerOptions& o) {
  return std::make_unique<SemiImplicitEuler>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const NewmarkOptions& o) {
  return std::make_unique<Newmark>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const EnergyAttractorOptions& o) {
  return std::make_unique<EnergyAttractor>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const Rk4Options& o) {
  return std::make_unique<Rk4>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const Dop853Options& o) {
  return std::make_unique<Dop853>(model, o);
}
std::unique_ptr<Integrator> make(const Model& model, const RosenbrockOptions& o) {
  return std::make_unique<Rosenbrock>(model, o);
}

}  // namespace

std::unique_ptr<Integrator> make_integrator(const Model& model, const Options& options) {
  const Options valid = checked(options);
  auto integrator = std::visit([&](const auto& o) { return make(model, o); }, valid);
  integrator->prepare(owner_of_states(model, valid));
  return integrator;
}

std::unique_ptr<Integrator> make_integrator(std::string_view name, const Model& model,
                                            const Parameters& parameters) {
  return make_integrator(model, make_options(name, parameters));
}

}  // namespace hamelin::integration
