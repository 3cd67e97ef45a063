#include "hamelin/integration/options.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "check_options.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/core/text.hpp"

namespace hamelin::integration {

namespace {

[[noreturn]] void refuse(const std::string& message) {
  throw Error(ErrorCode::usage, message);
}

struct Entry {
  Scheme scheme;
  Options defaults;
};

// In the order of the alternatives of Options.
const std::vector<Entry>& table() {
  using enum Solver;
  static const std::vector<Entry> entries{
      {{"hamel", {feedback}, {}, false, true}, HamelOptions{}},
      {{"hamel-midpoint", {feedback}, {}, false, true}, HamelMidpointOptions{}},
      {{"hamel-variational", {newton, feedback}, {}, false, true}, VariationalOptions{}},
      {{"gauss", {}, {4, 6, 8, 10, 12, 14, 16}, true, true}, GaussOptions{}},
      {{"lie-exact", {newton, riqn}, {}, false, true}, LieExactOptions{}},
      {{"composition", {newton}, {4, 6, 8}, false, true}, CompositionOptions{}},
      {{"semi-implicit-euler", {}, {}, false, false}, SemiImplicitEulerOptions{}},
      {{"newmark", {}, {}, false, true}, NewmarkOptions{}},
      {{"energy-attractor", {}, {}, false, false}, EnergyAttractorOptions{}},
      {{"rk4", {}, {}, false, false}, Rk4Options{}},
      {{"dop853", {}, {}, true, false}, Dop853Options{}},
      {{"rosenbrock", {}, {}, true, false}, RosenbrockOptions{}},
  };
  return entries;
}

const Entry* find_entry(std::string_view name) {
  for (const auto& entry : table())
    if (entry.scheme.name == name) return &entry;
  return nullptr;
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

void check_solver(const Scheme& scheme, Solver solver) {
  const auto& known = scheme.solvers;
  if (known.empty())
    refuse(
        formatted("integrator '{}' takes no solver, '{}' given", scheme.name, to_string(solver)));
  if (std::find(known.begin(), known.end(), solver) != known.end()) return;
  std::vector<std::string> names;
  names.reserve(known.size());
  for (const Solver one : known) names.push_back(formatted("'{}'", to_string(one)));
  refuse(formatted("integrator '{}' has no solver '{}', expected {}", scheme.name,
                   to_string(solver), joined(names, " or ")));
}

void check_order(const Scheme& scheme, int order) {
  if (scheme.orders.empty())
    refuse(formatted("integrator '{}' has one order, expected none", scheme.name));
  if (std::find(scheme.orders.begin(), scheme.orders.end(), order) == scheme.orders.end())
    refuse(formatted("integrator '{}' has no order {}, expected one of {}", scheme.name, order,
                     joined(scheme.orders, ", ")));
}

constexpr double least_step_tolerance = 1e-16;

void check_step_control(const Scheme& scheme, double rtol, double atol) {
  const auto valid = [](double x) { return std::isfinite(x) && x >= 0.0; };
  if (!valid(rtol) || !valid(atol))
    refuse(formatted("integrator '{}': rtol {} and atol {}, expected finite numbers of at least 0",
                     scheme.name, rtol, atol));
  if (!scheme.step_control && (rtol > 0.0 || atol > 0.0))
    refuse(formatted("integrator '{}' has no step control, expected neither rtol nor atol",
                     scheme.name));
  // Step control would look for steps without rounding, and end only when no time is left to add.
  const double larger = std::max(rtol, atol);
  if (larger > 0.0 && larger < least_step_tolerance)
    refuse(
        formatted("integrator '{}': rtol {} and atol {} are below rounding, expected one of them "
                  "to be at least {}",
                  scheme.name, rtol, atol, least_step_tolerance));
}

void check_range(const Scheme& scheme, const char* option, double x, double least, double most) {
  if (!(x >= least && x <= most))
    refuse(formatted("integrator '{}': {} {}, expected a number from {} to {}", scheme.name, option,
                     x, least, most));
}

constexpr double largest = std::numeric_limits<double>::max();

// Checks each option that the scheme has.
template <class O>
void check(const Scheme& scheme, O& o) {
  require_available(o.isa);
  if constexpr (requires { o.order; }) check_order(scheme, o.order);
  if constexpr (requires { o.alpha; }) check_range(scheme, "alpha", o.alpha, 0.0, 1.0);
  if constexpr (requires { o.tolerance; })
    check_range(scheme, "tolerance", o.tolerance, 0.0, largest);
  if constexpr (requires { o.feedback_tolerance; })
    check_range(scheme, "feedback_tolerance", o.feedback_tolerance, 0.0, largest);
  if constexpr (requires { o.newmark_beta; }) {
    check_range(scheme, "newmark_beta", o.newmark_beta, 0.0, largest);
    check_range(scheme, "newmark_gamma", o.newmark_gamma, 0.0, largest);
  }
  if constexpr (requires { o.max_updates; })
    check_range(scheme, "max_updates", o.max_updates, 0.0, largest);
  if constexpr (requires { o.max_halvings; })
    check_range(scheme, "max_halvings", o.max_halvings, 0.0, 30.0);
  if constexpr (requires { o.rtol; }) {
    check_step_control(scheme, o.rtol, o.atol);
    if (o.atol == 0.0) o.atol = o.rtol;  // a purely relative tolerance cannot be met at rest
  }
}

template <class T>
void set_if_given(const std::optional<T>& given, T& into) {
  if (given) into = *given;
}

void set_solver(Solver given, VariationalOptions::Solver& into) {
  into = given == Solver::feedback ? VariationalOptions::Solver::feedback
                                   : VariationalOptions::Solver::newton;
}
void set_solver(Solver given, LieExactOptions::Solver& into) {
  into = given == Solver::riqn ? LieExactOptions::Solver::riqn : LieExactOptions::Solver::newton;
}

template <class O>
void set_all(const Parameters& p, O& o) {
  set_if_given(p.isa, o.isa);
  if constexpr (requires { o.order; }) set_if_given(p.order, o.order);
  if constexpr (requires { o.solver; })
    if (p.solver) set_solver(*p.solver, o.solver);
  if constexpr (requires { o.rtol; }) {
    set_if_given(p.rtol, o.rtol);
    set_if_given(p.atol, o.atol);
  }
  if constexpr (requires { o.alpha; }) set_if_given(p.alpha, o.alpha);
  if constexpr (requires { o.start; }) set_if_given(p.start, o.start);
  if constexpr (requires { o.tolerance; }) set_if_given(p.tolerance, o.tolerance);
  if constexpr (requires { o.feedback_tolerance; })
    set_if_given(p.feedback_tolerance, o.feedback_tolerance);
  if constexpr (requires { o.newmark_beta; }) {
    set_if_given(p.newmark_beta, o.newmark_beta);
    set_if_given(p.newmark_gamma, o.newmark_gamma);
  }
  if constexpr (requires { o.max_updates; }) set_if_given(p.max_updates, o.max_updates);
  if constexpr (requires { o.max_halvings; }) set_if_given(p.max_halvings, o.max_halvings);
}

}  // namespace

Options checked(Options options) {
  const Scheme& scheme = table()[options.index()].scheme;
  std::visit([&](auto& o) { check(scheme, o); }, options);
  return options;
}

const std::vector<std::string>& integrator_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const auto& entry : table()) all.push_back(entry.scheme.name);
    return all;
  }();
  return names;
}

const Scheme* find_scheme(std::string_view name) {
  const Entry* const entry = find_entry(name.substr(0, name.find(':')));
  return entry != nullptr ? &entry->scheme : nullptr;
}

SchemeName parse_scheme_name(std::string_view text) {
  const auto colon = text.find(':');
  SchemeName parsed{std::string(text.substr(0, colon)), {}};
  if (colon == std::string_view::npos) return parsed;
  const std::string_view digits = text.substr(colon + 1);
  int order = 0;
  const auto [read_to, ec] = std::from_chars(digits.data(), digits.data() + digits.size(), order);
  if (ec != std::errc() || read_to != digits.data() + digits.size() || order < 1)
    refuse(formatted("'{}': '{}' is not an order, expected a name and a number such as gauss:8",
                     text, digits));
  parsed.order = order;
  return parsed;
}

Options make_options(std::string_view name, const Parameters& given) {
  const SchemeName parsed = parse_scheme_name(name);
  const Entry* const entry = find_entry(parsed.name);
  if (entry == nullptr)
    refuse(formatted("integrator '{}' is not known, expected one of {}{}", parsed.name,
                     joined(integrator_names(), ", "),
                     did_you_mean(parsed.name, integrator_names())));
  Parameters parameters = given;
  if (parsed.order) {
    if (given.order && *given.order != *parsed.order)
      refuse(formatted("integrator '{}': order {} is also given, expected only one order", name,
                       *given.order));
    parameters.order = parsed.order;
  }
  const Scheme& scheme = entry->scheme;
  if (parameters.order) check_order(scheme, *parameters.order);
  if (parameters.solver) check_solver(scheme, *parameters.solver);
  check_step_control(scheme, parameters.rtol.value_or(0.0), parameters.atol.value_or(0.0));
  Options options = entry->defaults;
  std::visit(
      [&](auto& o) {
        o.isa = default_isa();
        set_all(parameters, o);
      },
      options);
  return checked(options);
}

}  // namespace hamelin::integration
