#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "composition.hpp"
#include "dop853.hpp"
#include "explicit.hpp"
#include "feedback.hpp"
#include "gauss.hpp"
#include "hamel.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "lie_exact.hpp"
#include "newmark.hpp"
#include "rosenbrock.hpp"
#include "variational.hpp"

namespace hamelin::integration {

namespace {

template <class Type, class... Extra>
std::unique_ptr<Integrator> make(const Model& model, const Options& options, Extra... extra) {
  return std::make_unique<Type>(model, options, extra...);
}

struct Entry {
  Scheme scheme;
  std::unique_ptr<Integrator> (*make)(const Model&, const Options&);
};

const std::vector<Entry>& table() {
  using enum Solver;
  static const std::vector<Entry> entries{
      {{"hamel", {feedback}, {}, false, true},
       [](const Model& m, const Options& o) { return make<Hamel>(m, o, false); }},
      {{"hamel-midpoint", {feedback}, {}, false, true},
       [](const Model& m, const Options& o) { return make<Hamel>(m, o, true); }},
      {{"hamel-variational", {newton, feedback}, {}, false, true}, make<Variational>},
      {{"gauss", {}, {4, 6, 8, 10, 12, 14, 16}, true, true}, make<GaussLegendre>},
      {{"lie-exact", {newton, riqn}, {}, false, true}, make<LieExact>},
      {{"composition", {newton}, {4, 6, 8}, false, true}, make<Composition>},
      {{"semi-implicit-euler", {}, {}, false, false}, make<SemiImplicitEuler>},
      {{"newmark", {}, {}, false, true}, make<Newmark>},
      {{"feedback", {}, {}, false, false}, make<Feedback>},
      {{"rk4", {}, {}, false, false}, make<Rk4>},
      {{"dop853", {}, {}, true, false}, make<Dop853>},
      {{"rosenbrock", {}, {}, true, false}, make<Rosenbrock>},
  };
  return entries;
}

const char* to_string(Solver solver) {
  switch (solver) {
    case Solver::newton:
      return "newton";
    case Solver::feedback:
      return "feedback";
    case Solver::riqn:
      return "riqn";
  }
  return "";
}

void set_solver(const Scheme& scheme, Options& options) {
  const auto& known = scheme.solvers;
  if (!options.solver_given) {
    if (!known.empty()) options.solver = known.front();
    return;
  }
  if (known.empty()) throw Error(ErrorCode::usage, fmt::format("integrator '{}' takes no solver", scheme.name));
  if (std::find(known.begin(), known.end(), options.solver) != known.end()) return;
  std::vector<std::string> names;
  for (const Solver solver : known) names.push_back(fmt::format("'{}'", to_string(solver)));
  throw Error(ErrorCode::usage,
              fmt::format("integrator '{}' has the solver {} only", scheme.name, fmt::join(names, " or ")));
}

void set_order(const Scheme& scheme, Options& options) {
  if (options.order == 0) return;
  if (scheme.orders.empty())
    throw Error(ErrorCode::usage, fmt::format("integrator '{}' has one order, it takes none", scheme.name));
  if (std::find(scheme.orders.begin(), scheme.orders.end(), options.order) == scheme.orders.end())
    throw Error(ErrorCode::usage, fmt::format("integrator '{}' has no order {}, expected one of {}", scheme.name,
                                              options.order, fmt::join(scheme.orders, ", ")));
}

void set_step_control(const Scheme& scheme, Options& options) {
  const auto valid = [](double x) { return std::isfinite(x) && x >= 0.0; };
  if (!valid(options.rtol) || !valid(options.atol))
    throw Error(ErrorCode::usage, fmt::format("integrator '{}': rtol {} and atol {}, expected finite numbers from 0",
                                              scheme.name, options.rtol, options.atol));
  if (!options.step_control()) return;
  if (!scheme.step_control)
    throw Error(ErrorCode::usage,
                fmt::format("integrator '{}' has no step control, it takes neither rtol nor atol", scheme.name));
  // Alone, a relative tolerance asks for the impossible at rest.
  if (options.atol == 0.0) options.atol = options.rtol;
}

}  // namespace

const std::vector<std::string>& integrator_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const auto& entry : table()) all.push_back(entry.scheme.name);
    return all;
  }();
  return names;
}

const Scheme* find_scheme(const std::string& name) {
  for (const auto& entry : table())
    if (entry.scheme.name == name) return &entry.scheme;
  return nullptr;
}

std::unique_ptr<Integrator> make_integrator(const std::string& name, const Model& model, const Options& asked) {
  for (const auto& entry : table()) {
    if (entry.scheme.name != name) continue;
    Options options = asked;
    set_solver(entry.scheme, options);
    set_order(entry.scheme, options);
    set_step_control(entry.scheme, options);
    if (!entry.scheme.iterates) options.max_halvings = 0;  // explicit: a shorter step finds no other root
    return entry.make(model, options);
  }
  throw Error(ErrorCode::usage,
              fmt::format("integrator '{}' is not known, expected one of {}{}", name,
                          fmt::join(integrator_names(), ", "), did_you_mean(name, integrator_names())));
}

}  // namespace hamelin::integration
