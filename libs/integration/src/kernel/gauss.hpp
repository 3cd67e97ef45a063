#pragma once
#include <cstddef>

#include "corrections.hpp"
#include "forces.hpp"
#include "hamelin/dynamics/kernel/groups.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

namespace hamelin::integration::kernel {

inline constexpr std::size_t max_stages = 8;

/// The guess of a step from the increments of the step before, docs/theory.md (5.9): the polynomial
/// through its slopes at the nodes c_j, and, if `nodes` is s + 1, through one of the step before
/// that. Increments are columnᵀ times increments; `end` gives h' times the slope at the end of the
/// step before.
struct GaussGuess {
  std::size_t nodes;
  double column[max_stages + 1][max_stages], end[max_stages + 1];
};

/// Gauss–Legendre collocation with s stages on [0, 1], docs/theory.md (5.1), (5.2): nodes c,
/// weights b, and by columns μ_ij = a_ij/b_j and ν_ij = (a²)_ij/b_j of docs/theory.md (5.4), (5.6).
/// μ_ij + μ_ji = 1 holds exactly. Rows beyond s repeat the first, for lanes without a stage.
struct GaussTableau {
  std::size_t stages;
  double c[max_stages], b[max_stages];
  double mu_column[max_stages][max_stages], nu_column[max_stages][max_stages];
};

/// The equations that are collocated.
enum class GaussForm : unsigned char {
  momentum,  ///< y = (q, p), docs/theory.md (5.3): symplectic
  velocity,  ///< q̈ = a(q, q̇), docs/theory.md (5.5): half of the unknowns, fewer sweeps
};

/// What a step leaves to the next. Rows are joints, first for q and then for p in momentum form,
/// joints for v in velocity form.
struct GaussMemory {
  static constexpr std::size_t rows(GaussForm form, std::size_t n) noexcept {
    return form == GaussForm::momentum ? 2 * n : n;
  }
  static constexpr std::size_t size(GaussForm form, std::size_t n, std::size_t stages) noexcept {
    const std::size_t more = form == GaussForm::momentum ? 2 * stages + 1 : 0;
    return rows(form, n) * (stages + 1 + more) + 2;
  }
  GaussMemory(double* memory, GaussForm form, std::size_t n, std::size_t stages) noexcept
      : older_at(memory),
        errors(memory + 1),
        increments(memory + 2),
        older(increments + rows(form, n) * stages),
        carry(older + rows(form, n)),
        error(carry + rows(form, n)),
        error_before(error + rows(form, n) * stages) {}

  double* older_at;      ///< where the stage of `older` is, with this step from 0 to 1; 0: nowhere
  double* errors;        ///< how many of `error` and `error_before` are known
  double* increments;    ///< h b_j K_j, rows × stages, with the stages of one row adjacent
  double* older;         ///< h b_j K_j of the last stage of the step before
  double* carry;         ///< momentum form: what the sums for q and p rounded away, one per row
  double* error;         ///< momentum form: error of the extrapolated increments, rows × stages
  double* error_before;  ///< the same, of the step before
};

/// One step of collocation, docs/theory.md (5.4) or (5.6), by fixed-point sweeps over all stages.
template <class Chain>
struct GaussCall {
  const Chain& chain;
  const GaussTableau& tableau;
  GaussForm form;
  double h;
  const double *q, *u;      ///< u: p or v, as the form has it
  double *q_next, *u_next;  ///< written if the step converges
  GaussMemory memory;       ///< read, and written if the step converges
  const GaussGuess* guess;  ///< null without a step before
  double h_before;          ///< length of that step
  bool jumped;              ///< whether u was changed after it
  bool steady;              ///< whether this step and two before it have one length
  Forces forces;            ///< evaluated at the stages and their velocities
  double tolerance;         ///< on the remaining error of the displacement [rad or m]
  int max_sweeps;
};

struct GaussOutcome {
  bool converged;
  int sweeps;            ///< each evaluates all stages once
  double residual;       ///< docs/theory.md (5.13), of the last sweep [rad or m]
  double starter_error;  ///< the change in the first sweep [rad or m]; 0 without a guess
  Work work;             ///< docs/theory.md (5.8)
};

/// The entry points for one instruction set.
template <class Chain>
struct GaussEntry {
  std::size_t (*bytes)(std::size_t links, std::size_t stages) noexcept;
  GaussOutcome (*step)(const GaussCall<Chain>& call, void* memory) noexcept;
};
using GaussSet = dynamics::kernel::Groups<GaussEntry>;

inline namespace HAMELIN_ISA_NAMESPACE {

/// The stages of a step are independent within a sweep, so they go into the lanes of a register:
/// `W` at a time. Each group of lanes uses the results of the groups before it. Lanes without a
/// stage repeat the first.
template <template <class> class Group, int W, GaussForm Form>
class Gauss {
  using Pack = dynamics::kernel::Lanes<W>;
  using Space = Group<Pack>;
  using Chain = typename Space::Chain;
  using Scratch = dynamics::kernel::Scratch<Space>;
  static constexpr auto lanes = static_cast<std::size_t>(W);
  static constexpr std::size_t max_groups = (max_stages + lanes - 1) / lanes;
  static constexpr bool of_momentum = Form == GaussForm::momentum;

 public:
  static std::size_t bytes(std::size_t n, std::size_t stages) noexcept {
    return (2 * GaussMemory::rows(Form, n) * groups(stages) + 7 * n) * sizeof(Pack) +
           3 * n * sizeof(double) + Scratch::alignment + Scratch::bytes(n);
  }

  static GaussOutcome step(const GaussCall<Chain>& call, void* memory) noexcept {
    return Gauss(call, memory).solve();
  }

 private:
  Gauss(const GaussCall<Chain>& call, void* memory) noexcept
      : call_(call),
        n_(dynamics::kernel::count<Space>(call.chain)),
        rows_(GaussMemory::rows(Form, n_)),
        s_(call.tableau.stages),
        groups_(groups(s_)),
        increments_(static_cast<Pack*>(memory)),
        guess_(increments_ + rows_ * groups_),
        q_(guess_ + rows_ * groups_),
        u_(q_ + n_),
        rate_(u_ + n_),
        force_(rate_ + 2 * n_),
        torque_(force_ + n_),
        external_(torque_ + n_),
        lane_(reinterpret_cast<double*>(external_ + n_)),
        scratch_(Scratch::at(aligned(lane_ + 3 * n_), n_)) {}

  static std::size_t groups(std::size_t stages) noexcept { return (stages + lanes - 1) / lanes; }
  static void* aligned(void* p) noexcept {
    auto address = reinterpret_cast<std::size_t>(p);
    address = (address + Scratch::alignment - 1) / Scratch::alignment * Scratch::alignment;
    return reinterpret_cast<void*>(address);
  }
  HAMELIN_INLINE double increment(std::size_t r, std::size_t j) const noexcept {
    return increments_[r * groups_ + j / lanes].v[j % lanes];
  }
  HAMELIN_INLINE Pack weights(std::size_t group) const noexcept {
    return Pack::load(call_.tableau.b + group * lanes) * call_.h;
  }

  GaussOutcome solve() noexcept {
    GaussOutcome out{};
    const bool guessed = call_.guess != nullptr;
    if (call_.jumped || !guessed) evaluate_start();
    if (guessed)
      extrapolate();
    else
      repeat_start();
    // the first sweeps may change much, later ones less and less
    Corrections corrections({1e3, 1.0, 0.0, 2});
    for (int sweep = 0;; ++sweep) {
      const double now = this->sweep();
      ++out.sweeps;
      if (sweep == 0 && guessed) out.starter_error = now;
      // docs/theory.md (5.13). An extrapolated guess is assumed to contract by 1/10 at first.
      const double ratio = sweep == 0 && guessed && !call_.jumped ? 0.1 : corrections.ratio(now);
      out.residual = now * (ratio < 1.0 ? ratio : 1.0);
      if (out.residual <= call_.tolerance || corrections.at_rounding_floor(now, rounding())) break;
      if (!corrections.record(now) || sweep + 1 == call_.max_sweeps) return out;
    }
    out.converged = true;
    finish(out);
    return out;
  }

  /// Evaluates all stages once. Returns the largest change as a displacement, docs/theory.md
  /// (5.12).
  HAMELIN_INLINE double sweep() noexcept {
    Pack change(0.0);
    for (std::size_t g = 0; g < groups_; ++g) {
      place_stages(g);
      rates();
      const Pack weight = weights(g);
      Pack moved(0.0);
      for (std::size_t r = 0; r < n_; ++r) {
        moved = max(moved, replace(r, g, rate_[r] * weight));
        if constexpr (of_momentum)
          moved =
              max(moved, replace(n_ + r, g, rate_[n_ + r] * weight) * scratch_[r].inv_d * call_.h);
      }
      change = max(change, moved * call_.h / weight);
    }
    const double displacement = largest(change);
    return of_momentum ? displacement : 0.5 * call_.h * displacement;
  }

  /// Sets an increment; returns the size of its change.
  HAMELIN_INLINE Pack replace(std::size_t r, std::size_t g, Pack value) noexcept {
    Pack& increment = increments_[r * groups_ + g];
    const Pack change = abs(value - increment);
    increment = value;
    return change;
  }

  /// q_ and u_ at the stages of a group: docs/theory.md (5.4), (5.6).
  HAMELIN_INLINE void place_stages(std::size_t g) noexcept {
    const auto& t = call_.tableau;
    const double* const carry = call_.memory.carry;
    const Pack time = Pack::load(t.c + g * lanes);
    Pack mu[max_stages], nu[max_stages];
    for (std::size_t j = 0; j < s_; ++j) {
      mu[j] = Pack::load(t.mu_column[j] + g * lanes);
      if constexpr (!of_momentum) nu[j] = Pack::load(t.nu_column[j] + g * lanes);
    }
    for (std::size_t r = 0; r < n_; ++r) {
      if constexpr (of_momentum) {
        q_[r] = Pack(call_.q[r]) + combination(r, mu, carry[r]);
        u_[r] = Pack(call_.u[r]) + combination(n_ + r, mu, carry[n_ + r]);
      } else {
        q_[r] = Pack(call_.q[r]) + combination(r, nu, time * call_.u[r]) * call_.h;
        u_[r] = Pack(call_.u[r]) + combination(r, mu, 0.0);
      }
    }
  }
  /// first + Σ_j weight_j · increment_j of component r.
  HAMELIN_INLINE Pack combination(std::size_t r, const Pack* weight, Pack first) const noexcept {
    for (std::size_t j = 0; j < s_; ++j) first += weight[j] * increment(r, j);
    return first;
  }

  /// The change in a sweep that rounding alone can cause.
  double rounding() const noexcept {
    double most = 1.0;
    for (std::size_t r = 0; r < n_; ++r) {
      const double q = call_.q[r] < 0.0 ? -call_.q[r] : call_.q[r];
      most = q > most ? q : most;
    }
    return 4e-16 * most;
  }

  /// Evaluates the polynomial through the slopes of the step before, and through the last one of
  /// the step before that, at this step's stages: docs/theory.md (5.9) and (5.10). The latter,
  /// after an impulse, saves more than one sweep per step where every tick sets a velocity.
  void extrapolate() noexcept {
    const GaussGuess& guess = *call_.guess;
    Pack column[max_groups][max_stages + 1];
    for (std::size_t g = 0; g < groups_; ++g)
      for (std::size_t j = 0; j < guess.nodes; ++j)
        column[g][j] = Pack::load(guess.column[j] + g * lanes);
    double old[max_stages + 1];
    for (std::size_t r = 0; r < rows_; ++r) {
      for (std::size_t j = 0; j < s_; ++j) old[j] = call_.memory.increments[r * s_ + j];
      old[s_] = call_.memory.older[r];
      Pack jump(0.0);
      if (call_.jumped) {
        double end = 0.0;
        for (std::size_t j = 0; j < guess.nodes; ++j) end += guess.end[j] * old[j];
        jump = rate_[r] - Pack(end / call_.h_before);
      }
      for (std::size_t g = 0; g < groups_; ++g) {
        Pack sum = jump * weights(g);
        for (std::size_t j = 0; j < guess.nodes; ++j) sum += column[g][j] * old[j];
        increments_[r * groups_ + g] = sum;
      }
    }
    if constexpr (of_momentum) correct_guess();
  }

  /// Adds the error of the guess that is extrapolated from the last two steps, docs/theory.md
  /// (5.11).
  void correct_guess() noexcept {
    const GaussMemory& memory = call_.memory;
    const bool known = call_.steady && *memory.errors == 2.0;
    for (std::size_t r = 0; r < rows_; ++r)
      for (std::size_t g = 0; g < groups_; ++g) {
        Pack& increment = increments_[r * groups_ + g];
        guess_[r * groups_ + g] = increment;
        if (known)
          increment +=
              load_stages(memory.error, r, g) * 2.0 - load_stages(memory.error_before, r, g);
      }
  }

  /// Keeps the error of the extrapolated increments.
  void keep_error() noexcept {
    const GaussMemory& memory = call_.memory;
    *memory.errors = !call_.steady ? 0.0 : *memory.errors < 2.0 ? *memory.errors + 1.0 : 2.0;
    if (!call_.steady) return;
    for (std::size_t r = 0; r < rows_; ++r)
      for (std::size_t g = 0; g < groups_; ++g) {
        const std::size_t i = r * groups_ + g;
        store_stages(load_stages(memory.error, r, g), memory.error_before, r, g);
        store_stages(increments_[i] - guess_[i], memory.error, r, g);
      }
  }

  /// Stages of a row of numbers with the stages of one row adjacent. Lanes without a stage repeat
  /// the first.
  HAMELIN_INLINE Pack load_stages(const double* numbers, std::size_t r,
                                  std::size_t g) const noexcept {
    const double* const row = numbers + r * s_;
    if (s_ == groups_ * lanes) return Pack::load(row + g * lanes);
    Pack out;
    for (std::size_t lane = 0; lane < lanes; ++lane)
      out.v[lane] = row[g * lanes + lane < s_ ? g * lanes + lane : 0];
    return out;
  }
  HAMELIN_INLINE void store_stages(Pack value, double* numbers, std::size_t r,
                                   std::size_t g) const noexcept {
    double* const row = numbers + r * s_;
    if (s_ == groups_ * lanes) {
      value.store(row + g * lanes);
      return;
    }
    for (std::size_t lane = 0; lane < lanes && g * lanes + lane < s_; ++lane)
      row[g * lanes + lane] = value.v[lane];
  }

  /// rate_ = f(y) at the start of the step, in all lanes.
  void evaluate_start() noexcept {
    for (std::size_t r = 0; r < n_; ++r) {
      q_[r] = Pack(call_.q[r]);
      u_[r] = Pack(call_.u[r]);
    }
    rates();
  }

  void repeat_start() noexcept {
    for (std::size_t g = 0; g < groups_; ++g)
      for (std::size_t r = 0; r < rows_; ++r) increments_[r * groups_ + g] = rate_[r] * weights(g);
  }

  /// rate_ = f(y) with the forces at the velocities of the stages: Hamilton's equations,
  /// docs/theory.md (5.3), or accelerations, docs/theory.md (5.5).
  HAMELIN_INLINE void rates() noexcept {
    if constexpr (of_momentum) {
      dynamics::kernel::hamilton<Space>(call_.chain, scratch_, q_, u_, rate_, rate_ + n_);
      add_forces(rate_, rate_ + n_);
    } else {
      for (std::size_t r = 0; r < n_; ++r) torque_[r] = Pack(0.0);
      if (call_.forces.spin_count > 0) move_links();
      add_forces(u_, torque_);
      dynamics::kernel::forward_dynamics<Space>(call_.chain, scratch_, q_, u_, torque_, rate_);
    }
  }

  /// Placements and twists, which gyroscopic terms need, at q_ and the velocities u_.
  void move_links() noexcept {
    dynamics::kernel::place<Space>(call_.chain, scratch_, q_);
    dynamics::kernel::twists<Space>(call_.chain, scratch_, u_);
  }

  /// Adds the forces of the channels at the velocities v; those of gyroscopic terms stay in force_.
  HAMELIN_INLINE void add_forces(const Pack* v, Pack* torque) noexcept {
    const Forces& f = call_.forces;
    if (f.held != nullptr || f.damping != nullptr || f.coulomb != nullptr)
      for (std::size_t r = 0; r < n_; ++r) torque[r] += joint_force(f, r, v[r]);
    if (f.spin_count > 0) {
      dynamics::kernel::gyroscopic_torque<Space>(call_.chain, scratch_, f.spins, f.spin_count,
                                                 force_);
      for (std::size_t r = 0; r < n_; ++r) torque[r] += force_[r];
    }
    if (f.external.evaluate != nullptr) {
      evaluate_external(v);
      for (std::size_t r = 0; r < n_; ++r) torque[r] += external_[r];
    }
  }

  /// The torques of the wrenches at q_ and the velocities v, lane by lane.
  void evaluate_external(const Pack* v) noexcept {
    const ExternalTorque& external = call_.forces.external;
    double *const q = lane_, *const rate = q + n_, *const torque = rate + n_;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      for (std::size_t r = 0; r < n_; ++r) {
        q[r] = q_[r].v[lane];
        rate[r] = v[r].v[lane];
      }
      external.evaluate(external.context, q, rate, torque);
      for (std::size_t r = 0; r < n_; ++r) external_[r].v[lane] = torque[r];
    }
  }

  void finish(GaussOutcome& out) noexcept {
    add_works(out.work);
    if constexpr (of_momentum) keep_error();
    const GaussMemory& memory = call_.memory;
    for (std::size_t r = 0; r < n_; ++r) {
      double sum = 0.0, sum_u = 0.0;
      for (std::size_t j = 0; j < s_; ++j) {
        if constexpr (of_momentum) {
          sum += increment(r, j);
          sum_u += increment(n_ + r, j);
        } else {
          sum += (1.0 - call_.tableau.c[j]) * increment(r, j);  // Σ_j b_j a_jk = b_k (1 − c_k)
          sum_u += increment(r, j);
        }
      }
      if constexpr (of_momentum) {
        call_.q_next[r] = compensated(call_.q[r], sum, memory.carry[r]);
        call_.u_next[r] = compensated(call_.u[r], sum_u, memory.carry[n_ + r]);
      } else {
        call_.q_next[r] = call_.q[r] + call_.h * (call_.u[r] + sum);
        call_.u_next[r] = call_.u[r] + sum_u;
      }
    }
    // the motion before an impulse does not continue the polynomial of this step
    const bool continues = call_.guess != nullptr && !call_.jumped;
    *memory.older_at =
        continues ? (call_.tableau.c[s_ - 1] - 1.0) * (call_.h_before / call_.h) : 0.0;
    for (std::size_t r = 0; r < rows_; ++r) {
      if (continues)
        memory.older[r] = memory.increments[r * s_ + s_ - 1] * (call_.h / call_.h_before);
      for (std::size_t g = 0; g < groups_; ++g)
        store_stages(increments_[r * groups_ + g], memory.increments, r, g);
    }
  }

  /// y + dy + carry; carry becomes what this sum rounds away: docs/theory.md (5.7).
  HAMELIN_INLINE static double compensated(double y, double dy, double& carry) noexcept {
    const double add = dy + carry, next = y + add;
    const double added = next - y;  // two-sum, exact for any sizes
    carry = (y - (next - added)) + (add - added);
    return next;
  }

  /// The work of the forces, docs/theory.md (5.8), at the converged stages.
  void add_works(Work& work) noexcept {
    const Forces& f = call_.forces;
    const bool external = f.external.evaluate != nullptr, of_place = f.spin_count > 0 || external;
    if (f.held == nullptr && f.damping == nullptr && f.coulomb == nullptr && !of_place) return;
    for (std::size_t g = 0; g < groups_; ++g) {
      const Pack* const v = of_momentum ? rate_ : u_;
      if (of_place || !of_momentum) place_stages(g);
      if (of_place) rates();
      if (!of_place && of_momentum)
        for (std::size_t r = 0; r < n_; ++r) rate_[r] = increments_[r * groups_ + g] / weights(g);
      for (std::size_t lane = 0; lane < lanes && g * lanes + lane < s_; ++lane) {
        const double weight = call_.h * call_.tableau.b[g * lanes + lane];
        add_joint_work(f, n_, weight, work, [&](std::size_t r) { return v[r].v[lane]; });
        for (std::size_t r = 0; f.spin_count > 0 && r < n_; ++r)
          work.gyroscopic += weight * force_[r].v[lane] * v[r].v[lane];
        for (std::size_t r = 0; external && r < n_; ++r)
          work.external += weight * external_[r].v[lane] * v[r].v[lane];
      }
    }
  }

  const GaussCall<Chain>& call_;
  std::size_t n_, rows_, s_, groups_;
  Pack *increments_, *guess_;  ///< rows × groups
  Pack *q_, *u_, *rate_, *force_, *torque_, *external_;
  double* lane_;  ///< one lane's positions, rates and external torques
  Scratch scratch_;
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel
