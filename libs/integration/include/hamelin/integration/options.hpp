#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "hamelin/core/isa.hpp"

/// Options of the schemes; docs/theory.md, chapters 3 to 7, has their equations.
namespace hamelin::integration {

/// First step of hamel and hamel-midpoint, docs/theory.md (3.14): half of the potential at the
/// first node, or the whole potential.
enum class Start : std::int32_t { consistent, published };
/// Root-finding methods of all schemes.
enum class Solver : std::int32_t { newton, feedback, riqn };

// In all structs below: a step that finds no root is divided into at most 2^max_halvings parts,
// docs/theory.md (4.30), and `isa` is the instruction set to compute with.

struct HamelOptions {
  double alpha = 0.5;  ///< where in the step velocities are taken, 0 to 1
  Start start = Start::consistent;
  double feedback_tolerance = 1e-8;  ///< on ‖τ_e‖ [Nm], docs/theory.md (3.9)
  int max_updates = 100;
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct HamelMidpointOptions {
  Start start = Start::consistent;
  double feedback_tolerance = 1e-8;  ///< on ‖τ_e‖ [Nm], docs/theory.md (3.9)
  int max_updates = 100;
  int max_halvings = 8;
  Isa isa = default_isa();
};

/// Options of hamel-variational.
struct VariationalOptions {
  enum class Solver : std::int32_t { newton, feedback };
  Solver solver = Solver::newton;
  double tolerance = 1e-12;          ///< newton: on ‖δΔ‖∞ [rad or m], docs/theory.md (4.25)
  double feedback_tolerance = 1e-8;  ///< feedback: on ‖τ_e‖ [Nm], docs/theory.md (4.29)
  int max_updates = 100;             ///< of feedback; newton stops if it does not contract
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct GaussOptions {
  int order = 8;  ///< even, 4 to 16
  /// Of the iteration at fixed steps, on ‖δΔ‖∞ [rad or m]. Up to 1e-12 the steps are symplectic and
  /// iterated to rounding, docs/theory.md (5.4); above, accelerations are collocated, (5.6).
  double tolerance = 1e-12;
  /// A value above 0 switches step control on; State::step_next is then the first step. rtol alone
  /// sets atol to the same number [rad or m, and per second]; atol alone stays absolute. The larger
  /// of them is at least 1e-16.
  double rtol = 0.0, atol = 0.0;
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct LieExactOptions {
  enum class Solver : std::int32_t { newton, riqn };
  Solver solver = Solver::newton;
  double tolerance = 1e-12;  ///< on ‖δΔ‖∞ [rad or m]
  int max_updates = 100;     ///< of riqn; newton stops if it does not contract
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct CompositionOptions {
  int order = 4;             ///< 4, 6 or 8
  double tolerance = 1e-12;  ///< on ‖δΔ‖∞ of a sub-step [rad or m]
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct SemiImplicitEulerOptions {
  Isa isa = default_isa();
};

struct NewmarkOptions {
  double newmark_beta = 0.25, newmark_gamma = 0.5;
  double tolerance = 1e-12;  ///< on h² times the change of the acceleration [rad or m]
  int max_updates = 100;
  int max_halvings = 8;
  Isa isa = default_isa();
};

/// Options of energy-attractor, a feedback integrator after Chang, Jiménez, Perlmutter (2016).
struct EnergyAttractorOptions {
  Isa isa = default_isa();
};

struct Rk4Options {
  Isa isa = default_isa();
};

struct Dop853Options {
  double rtol = 0.0, atol = 0.0;  ///< as in GaussOptions
  Isa isa = default_isa();
};

/// Always under step control: rtol = atol = 1e-10 if neither is given.
struct RosenbrockOptions {
  double rtol = 0.0, atol = 0.0;  ///< as in GaussOptions
  Isa isa = default_isa();
};

/// A scheme and its options, in the order of integrator_names().
using Options =
    std::variant<HamelOptions, HamelMidpointOptions, VariationalOptions, GaussOptions,
                 LieExactOptions, CompositionOptions, SemiImplicitEulerOptions, NewmarkOptions,
                 EnergyAttractorOptions, Rk4Options, Dop853Options, RosenbrockOptions>;

/// Options of a scheme that is chosen by name, as in scene files and on command lines; what is not
/// set keeps the scheme's default. Solver, order and step control are refused by schemes that have
/// none. Schemes ignore the other options that they do not have, so that schemes can be compared by
/// changing only the name.
struct Parameters {
  std::optional<int> order;
  std::optional<Solver> solver;
  std::optional<double> rtol, atol;
  std::optional<double> alpha, tolerance, feedback_tolerance, newmark_beta, newmark_gamma;
  std::optional<Start> start;
  std::optional<int> max_updates, max_halvings;
  std::optional<Isa> isa;

  [[nodiscard]] bool step_control() const noexcept {
    return rtol.value_or(0.0) > 0.0 || atol.value_or(0.0) > 0.0;
  }
};

/// The Parameters that a scheme takes.
struct Scheme {
  std::string name;
  std::vector<Solver> solvers;  ///< methods of root-finding, the default first; empty for others
  std::vector<int> orders;      ///< orders to choose from; empty if there is only one
  bool step_control = false;    ///< whether it takes rtol and atol
  bool iterates = false;        ///< whether it takes a tolerance of its iterations
};

/// Names of all schemes.
[[nodiscard]] const std::vector<std::string>& integrator_names();

/// The scheme of a name, with or without an order ("gauss:8"); null if the name is unknown.
[[nodiscard]] const Scheme* find_scheme(std::string_view name);

/// The parts of a name with an order ("gauss:8") or without ("rk4").
struct SchemeName {
  std::string name;
  std::optional<int> order;
};

/// Does not check that the name exists.
/// @throws Error usage if the text after the colon is not a positive integer
[[nodiscard]] SchemeName parse_scheme_name(std::string_view text);

/// @param name one of integrator_names(), possibly with an order: "gauss:8"
/// @throws Error usage for an unknown name (with the most similar one), a solver, an order or step
/// control that the scheme does not have, two orders, or values out of range
[[nodiscard]] Options make_options(std::string_view name, const Parameters& parameters = {});

}  // namespace hamelin::integration
