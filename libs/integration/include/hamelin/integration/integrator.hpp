#pragma once
#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/step_history.hpp"

namespace hamelin::integration {

using dynamics::GyroscopicTerm;
using Eigen::VectorXd;
using model::Model;

/// What acts on the arm during one step besides gravity (SPEC §4). Coefficients are kept over the step and evaluated at
/// the scheme's own velocity: midpoint, stage or sub-step. Empty vectors mean none and cost nothing. The nodal
/// potential (a) and the node impulse (e) act between steps: Integrator::kick and Integrator::set_velocity.
struct Channels {
  VectorXd damping;                        ///< (b) torque −damping_i v_i; empty or dof [Nm s/rad]
  VectorXd coulomb;                        ///< dry friction −coulomb_i tanh(v_i / coulomb_speed); empty or dof [Nm]
  double coulomb_speed = 0.01;             ///< below it dry friction turns viscous [rad/s or m/s]
  std::vector<GyroscopicTerm> gyroscopic;  ///< (c)
  VectorXd held_torque;                    ///< (d) empty or dof [Nm]

  [[nodiscard]] bool none() const noexcept {
    return damping.size() == 0 && coulomb.size() == 0 && gyroscopic.empty() && held_torque.size() == 0;
  }
};

/// What an integrator remembers between steps: a plain value, to be copied, kept and restored. Of v and p a state has
/// the one that its scheme steps, and the other is empty: Integrator::velocity() answers for all schemes.
struct State {
  double time_s = 0.0;
  long k = 0;
  VectorXd q;
  VectorXd v;                        ///< velocity at the node: explicit schemes, newmark, feedback
  VectorXd p;                        ///< momentum at the node [Nm s]; hamel: impulses that no step has taken up yet
  bool jumped = true;                ///< whether the velocity was set or kicked since the last step
  VectorXd memory;                   ///< the scheme's own; hamel: body twists of the last step, dof × (6 or 3)
  VectorXd force_previous;           ///< hamel, newmark: generalised force of the last step
  double step_previous = 0.0;        ///< gauss, hamel, newmark: length of the last step; 0 where there is none
  std::vector<StepHistory> history;  ///< composition: one for each sub-step
  double step_next = 0.0;  ///< what step control takes next [s]: set it for a first step; 0 goes as far as asked
};

/// What one step did.
struct StepReport {
  bool converged = true;
  int updates = 0;         ///< corrections of Δ
  int factorizations = 0;  ///< linear solves that made new factors
  int evaluations = 0;     ///< sweeps over the chain: residuals, or forward dynamics for explicit schemes
  int halvings = 0;        ///< how often the step was halved to find a root
  int rejected = 0;        ///< steps that step control took back
  double step_s = 0.0;     ///< how far the state went
  double residual = 0.0;   ///< the figure the criterion looks at, of the accepted step
  double gyroscopic_work_J = 0.0;
  double dissipated_J = 0.0;  ///< by channel (b) and dry friction, positive
  double held_work_J = 0.0;   ///< by channel (d)
};

/// What two parts of a step did, the second after the first.
[[nodiscard]] StepReport together(const StepReport& a, const StepReport& b);

struct Energy {
  double kinetic_J = 0.0, potential_J = 0.0;
  [[nodiscard]] double total() const noexcept { return kinetic_J + potential_J; }
};

enum class Start : std::int32_t { consistent, published };
enum class Solver : std::int32_t { newton, feedback, riqn };

/// Settings of all integrators; each takes what concerns it and refuses what it cannot do.
struct Options {
  double alpha = 0.5;  ///< hamel: where in the step velocities are taken, 0 .. 1
  Start start = Start::consistent;
  bool solver_given = false;  ///< whether `solver` was asked for, or the scheme's own default holds
  Solver solver = Solver::newton;
  double tolerance = 1e-12;          ///< newton: ‖δΔ‖∞ [rad or m]
  double feedback_tolerance = 1e-8;  ///< feedback: ‖τ_e‖ [Nm], the paper's ε
  int max_updates = 100;             ///< feedback; newton gives up where it does not contract
  int max_halvings = 8;              ///< a step is cut into at most 2^max_halvings pieces
  int order = 0;                     ///< composition, gauss: 0 takes the scheme's default
  double rtol = 0.0, atol = 0.0;     ///< either above 0 switches step control on; the first step is the one asked for
  double newmark_beta = 0.25, newmark_gamma = 0.5;  ///< newmark

  [[nodiscard]] bool step_control() const noexcept { return rtol > 0.0 || atol > 0.0; }
};

/// A one-step scheme for a chain: θ^k → θ^{k+1}. One object a thread; State is the memory. No allocation in a step.
class Integrator {
 public:
  virtual ~Integrator() = default;
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const Model& model() const noexcept { return model_; }
  /// What "converged" means, for the result: e.g. "|delta|_inf <= 1e-12".
  [[nodiscard]] virtual std::string criterion() const = 0;
  [[nodiscard]] virtual int order() const = 0;

  /// A state at rest or in motion. q0, v0: dof numbers.
  [[nodiscard]] State start(const VectorXd& q0, const VectorXd& v0);
  /// Velocity at the node.
  virtual void velocity(const State& state, VectorXd& v) = 0;
  /// Node impulse: p += dp [Nm s].
  void kick(State& state, const VectorXd& dp);
  /// Node velocity: p = M(θ^k) v.
  void set_velocity(State& state, const VectorXd& v);
  /// Exactly h > 0 ahead: one step, or under step control as many as it takes. If it reports converged = false no root
  /// was found, and the state is as it was.
  [[nodiscard]] StepReport step(State& state, const Channels& channels, double h);
  /// One step of at most `limit`: all of it for fixed steps, what step control chooses else (StepReport::step_s).
  [[nodiscard]] StepReport advance(State& state, const Channels& channels, double limit);
  /// Whether the scheme chooses its steps itself (Options::rtol, atol).
  [[nodiscard]] bool adaptive() const noexcept { return options_.step_control(); }
  /// "structure": fixed steps of a structure-preserving scheme, iterated to rounding; else "accurate".
  [[nodiscard]] virtual std::string mode() const { return "accurate"; }
  /// Energy at the node, as the scheme defines it (SPEC §3).
  [[nodiscard]] virtual Energy energy(const State& state);

 protected:
  Integrator(std::string name, const Model& model, const Options& options);

  /// Sets whatever the scheme keeps besides q, which is there.
  virtual void begin(State& state, const VectorXd& v0) = 0;
  virtual void add_momentum(State& state, const VectorXd& dp) = 0;
  virtual void replace_velocity(State& state, const VectorXd& v) = 0;
  /// One undivided step. Where it does not converge the state is left as it was.
  virtual StepReport attempt(State& state, const Channels& channels, double h) = 0;
  /// One step under step control, of at most `limit`, chosen by State::step_next; rejected ones are counted. Where it
  /// fails the state is left as it was. Schemes without step control never get here: make_integrator refuses.
  virtual StepReport controlled(State& state, const Channels& channels, double limit);

  const Model& model_;
  Options options_;
  dynamics::Workspace ws_;

 private:
  void make_room(const State& state);
  StepReport parts(State& state, const Channels& channels, double h);
  /// One step, in halves where no root is found.
  StepReport divide(State& state, const Channels& channels, double h, int depth);
  void halve(State& state, const Channels& channels, double h, int depth, StepReport& report);

  std::string name_;
  std::vector<State> saved_;  ///< one a halving level
  VectorXd velocity_;         ///< scratch of energy()
};

/// What a scheme takes of Options.
struct Scheme {
  std::string name;
  std::vector<Solver> solvers;  ///< root-finding, the default first; none where nothing is to be solved
  std::vector<int> orders;      ///< to choose from; none where there is but one
  bool step_control = false;    ///< whether it takes rtol and atol
  bool iterates = false;        ///< whether it takes a tolerance of its iterations
};

/// Null for an unknown name.
[[nodiscard]] const Scheme* find_scheme(const std::string& name);

/// Names that make_integrator knows.
[[nodiscard]] const std::vector<std::string>& integrator_names();

/// rtol without atol sets atol to the same number [rad or m, and per second]; atol without rtol stays absolute.
/// @throws Error usage for an unknown name (with the nearest), or a solver, order or step control the scheme has not
[[nodiscard]] std::unique_ptr<Integrator> make_integrator(const std::string& name, const Model& model,
                                                          const Options& options = {});

}  // namespace hamelin::integration
