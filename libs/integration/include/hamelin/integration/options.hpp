#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "hamelin/core/isa.hpp"

/// What each scheme can be told; docs/integrators has a page for each.
namespace hamelin::integration {

/// What hamel and hamel-midpoint count of the potential at the first node: half of it, or as published the whole.
enum class Start : std::int32_t { consistent, published };
/// Root-finding, of all schemes.
enum class Solver : std::int32_t { newton, feedback, riqn };

// In all of them: a step that finds no root is cut into at most 2^max_halvings pieces, and `isa` is the instruction set
// to compute with.

struct HamelOptions {
  double alpha = 0.5;  ///< where in the step velocities are taken, 0 to 1
  Start start = Start::consistent;
  double feedback_tolerance = 1e-8;  ///< ‖τ_e‖ [Nm], the paper's ε
  int max_updates = 100;
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct HamelMidpointOptions {
  Start start = Start::consistent;
  double feedback_tolerance = 1e-8;  ///< ‖τ_e‖ [Nm], the paper's ε
  int max_updates = 100;
  int max_halvings = 8;
  Isa isa = default_isa();
};

/// hamel-variational.
struct VariationalOptions {
  enum class Solver : std::int32_t { newton, feedback };
  Solver solver = Solver::newton;
  double tolerance = 1e-12;          ///< newton: ‖δΔ‖∞ [rad or m]
  double feedback_tolerance = 1e-8;  ///< feedback: ‖τ_e‖ [Nm], the paper's ε
  int max_updates = 100;             ///< feedback; newton gives up where it does not contract
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct GaussOptions {
  int order = 8;             ///< even, 4 to 16
  double tolerance = 1e-12;  ///< of the iteration, for fixed steps: ‖δΔ‖∞ [rad or m]
  /// Either above 0 switches step control on; the first step is the one asked for. rtol alone sets atol to the same
  /// number [rad or m, and per second]; atol alone stays absolute.
  double rtol = 0.0, atol = 0.0;
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct LieExactOptions {
  enum class Solver : std::int32_t { newton, riqn };
  Solver solver = Solver::newton;
  double tolerance = 1e-12;  ///< ‖δΔ‖∞ [rad or m]
  int max_updates = 100;     ///< riqn; newton gives up where it does not contract
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct CompositionOptions {
  int order = 4;             ///< 4, 6 or 8
  double tolerance = 1e-12;  ///< ‖δΔ‖∞ of a sub-step [rad or m]
  int max_halvings = 8;
  Isa isa = default_isa();
};

struct SemiImplicitEulerOptions {
  Isa isa = default_isa();
};

struct NewmarkOptions {
  double newmark_beta = 0.25, newmark_gamma = 0.5;
  double tolerance = 1e-12;  ///< of the iteration: h² times the change of the acceleration [rad or m]
  int max_updates = 100;
  int max_halvings = 8;
  Isa isa = default_isa();
};

/// The feedback integrator after Chang and others.
struct FeedbackOptions {
  Isa isa = default_isa();
};

struct Rk4Options {
  Isa isa = default_isa();
};

struct Dop853Options {
  double rtol = 0.0, atol = 0.0;  ///< as GaussOptions
  Isa isa = default_isa();
};

/// Always under step control: rtol = atol = 1e-10 where neither is given.
struct RosenbrockOptions {
  double rtol = 0.0, atol = 0.0;  ///< as GaussOptions
  Isa isa = default_isa();
};

/// A scheme and its options, in the order of integrator_names().
using Options = std::variant<HamelOptions, HamelMidpointOptions, VariationalOptions, GaussOptions, LieExactOptions,
                             CompositionOptions, SemiImplicitEulerOptions, NewmarkOptions, FeedbackOptions, Rk4Options,
                             Dop853Options, RosenbrockOptions>;

/// Options of a scheme that is chosen by name, as scene files and command lines give them; what is not set is the
/// scheme's default. Solver, order and step control are refused by schemes that have none. The others mean nothing to
/// some schemes, which ignore them, so that schemes can be compared by changing the name alone.
struct Parameters {
  std::optional<int> order;
  std::optional<Solver> solver;
  std::optional<double> rtol, atol;
  std::optional<double> alpha, tolerance, feedback_tolerance, newmark_beta, newmark_gamma;
  std::optional<Start> start;
  std::optional<int> max_updates, max_halvings;
  std::optional<Isa> isa;

  [[nodiscard]] bool step_control() const noexcept { return rtol.value_or(0.0) > 0.0 || atol.value_or(0.0) > 0.0; }
};

/// What a scheme takes of Parameters.
struct Scheme {
  std::string name;
  std::vector<Solver> solvers;  ///< root-finding, the default first; none where nothing is to be solved
  std::vector<int> orders;      ///< to choose from; none where there is but one
  bool step_control = false;    ///< whether it takes rtol and atol
  bool iterates = false;        ///< whether it takes a tolerance of its iterations
};

/// Names of all schemes.
[[nodiscard]] const std::vector<std::string>& integrator_names();

/// By its name, or a name with an order ("gauss:8"); null for an unknown one.
[[nodiscard]] const Scheme* find_scheme(std::string_view name);

/// The parts of "gauss:8", the name of a scheme with an order, or of "rk4" without.
struct SchemeName {
  std::string name;
  std::optional<int> order;
};

/// @throws Error usage if what follows the colon is not a positive whole number; the name is not looked up
[[nodiscard]] SchemeName parse_scheme_name(std::string_view text);

/// @param name as integrator_names() lists it, or with an order: "gauss:8"
/// @throws Error usage for an unknown name (with the nearest), a solver, order or step control that the scheme does not
/// have, two orders, or numbers out of range
[[nodiscard]] Options make_options(std::string_view name, const Parameters& parameters = {});

}  // namespace hamelin::integration
