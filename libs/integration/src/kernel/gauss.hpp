#pragma once
#include <cstddef>

#include "corrections.hpp"
#include "forces.hpp"
#include "hamelin/dynamics/kernel/groups.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

namespace hamelin::integration::kernel {

inline constexpr std::size_t max_stages = 8;

/// Gauss–Legendre collocation with s stages on [0, 1], docs/theory.md (5.2): nodes c, weights b,
/// a_ij by columns, and the barycentric weights 1/Π_{m≠j}(c_j − c_m). Rows beyond s repeat the
/// first, for lanes without a stage.
struct GaussTableau {
  std::size_t stages;
  double c[max_stages], b[max_stages], a_column[max_stages][max_stages], barycentric[max_stages];
};

/// One step y = (q, p) → y + h Σ b_j K_j with K_i = f(y + h Σ a_ij K_j), docs/theory.md (5.1), by
/// fixed-point sweeps over all stages.
template <class Chain>
struct GaussCall {
  const Chain& chain;
  const GaussTableau& tableau;
  double h;
  const double *q, *p;
  double *q_next, *p_next;  ///< written if the step converges
  /// Slopes K, 2n × stages: all of q̇, then all of ṗ, with the stages of one component adjacent.
  /// In: those of the step before, of length `h_before` (0: none). Out, if it converges: this
  /// step's.
  double* slopes;
  double h_before;
  bool jumped;       ///< whether p was changed after that step
  Forces forces;     ///< evaluated at the stages and their velocities
  double tolerance;  ///< on the remaining error of the displacement [rad or m]
  int max_sweeps;
};

struct GaussOutcome {
  bool converged;
  int sweeps;            ///< each evaluates all stages once
  double residual;       ///< docs/theory.md (5.8), of the last sweep [rad or m]
  double starter_error;  ///< the change in the first sweep [rad or m]; 0 without a guess
  Work work;             ///< docs/theory.md (5.4)
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
template <template <class> class Group, int W>
class Gauss {
  using Pack = dynamics::kernel::Lanes<W>;
  using Space = Group<Pack>;
  using Chain = typename Space::Chain;
  using Scratch = dynamics::kernel::Scratch<Space>;
  static constexpr auto lanes = static_cast<std::size_t>(W);
  static constexpr std::size_t max_groups = (max_stages + lanes - 1) / lanes;

 public:
  static std::size_t bytes(std::size_t n, std::size_t stages) noexcept {
    return (2 * n * groups(stages) + 5 * n) * sizeof(Pack) + Scratch::alignment + Scratch::bytes(n);
  }

  static GaussOutcome step(const GaussCall<Chain>& call, void* memory) noexcept {
    return Gauss(call, memory).solve();
  }

 private:
  Gauss(const GaussCall<Chain>& call, void* memory) noexcept
      : call_(call),
        n_(dynamics::kernel::count<Space>(call.chain)),
        s_(call.tableau.stages),
        groups_(groups(s_)),
        slopes_(static_cast<Pack*>(memory)),
        y_(slopes_ + 2 * n_ * groups_),
        rate_(y_ + 2 * n_),
        force_(rate_ + 2 * n_),
        scratch_(Scratch::at(aligned(force_ + n_), n_)) {}

  static std::size_t groups(std::size_t stages) noexcept { return (stages + lanes - 1) / lanes; }
  static void* aligned(Pack* p) noexcept {
    auto address = reinterpret_cast<std::size_t>(p);
    address = (address + Scratch::alignment - 1) / Scratch::alignment * Scratch::alignment;
    return reinterpret_cast<void*>(address);
  }
  /// Slope of component r at stage j.
  HAMELIN_INLINE double slope(std::size_t r, std::size_t j) const noexcept {
    return slopes_[r * groups_ + j / lanes].v[j % lanes];
  }

  GaussOutcome solve() noexcept {
    GaussOutcome out{};
    const double h = call_.h;
    Pack weights[max_groups][max_stages];
    for (std::size_t g = 0; g < groups_; ++g)
      for (std::size_t j = 0; j < s_; ++j)
        weights[g][j] = Pack::load(call_.tableau.a_column[j] + g * lanes) * h;
    const bool guessed = call_.h_before > 0.0;
    if (call_.jumped || !guessed) evaluate_start();
    if (guessed)
      extrapolate();
    else
      repeat_start();
    // the first sweeps may change much, later ones less and less
    Corrections corrections({1e3, 1.0, 0.0, 2});
    for (int sweep = 0;; ++sweep) {
      Pack change(0.0);
      for (std::size_t g = 0; g < groups_; ++g) {
        for (std::size_t r = 0; r < 2 * n_; ++r) {
          Pack sum(r < n_ ? call_.q[r] : call_.p[r - n_]);
          for (std::size_t j = 0; j < s_; ++j) sum += weights[g][j] * slope(r, j);
          y_[r] = sum;
        }
        rates();
        for (std::size_t r = 0; r < n_; ++r) {
          Pack& v = slopes_[r * groups_ + g];
          Pack& p_rate = slopes_[(n_ + r) * groups_ + g];
          change = max(change, abs(rate_[r] - v));
          // docs/theory.md (5.7): the change of momentum as a displacement
          change = max(change, abs(rate_[n_ + r] - p_rate) * scratch_[r].inv_d * h);
          v = rate_[r];
          p_rate = rate_[n_ + r];
        }
      }
      const double now = h * largest(change);
      ++out.sweeps;
      if (sweep == 0 && guessed) out.starter_error = now;
      // docs/theory.md (5.8). An extrapolated guess is assumed to contract by 1/10 at first. After
      // a constant guess each sweep gains one order in h, at a pace that says nothing about the
      // next.
      const double ratio = !guessed                      ? 1.0
                           : sweep == 0 && !call_.jumped ? 0.1
                                                         : corrections.ratio(now);
      out.residual = now * (ratio < 1.0 ? ratio : 1.0);
      if (out.residual <= call_.tolerance || corrections.at_rounding_floor(now, rounding())) break;
      if (!corrections.record(now) || sweep + 1 == call_.max_sweeps) return out;
    }
    out.converged = true;
    finish(out);
    return out;
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

  /// Evaluates the polynomial through the slopes of the step before at this step's stages:
  /// docs/theory.md (5.5) and (5.6). The latter, after an impulse, saves more than one sweep per
  /// step where every tick sets a velocity.
  void extrapolate() noexcept {
    const Pack ratio(call_.h / call_.h_before);
    const auto& t = call_.tableau;
    Pack weights[max_groups][max_stages];
    for (std::size_t g = 0; g < groups_; ++g) {
      const Pack at = Pack(1.0) + ratio * Pack::load(t.c + g * lanes);  // beyond all nodes
      Pack product(1.0);
      for (std::size_t j = 0; j < s_; ++j) product *= at - t.c[j];
      for (std::size_t j = 0; j < s_; ++j)
        weights[g][j] = product * t.barycentric[j] / (at - t.c[j]);
    }
    double end[max_stages];  // ℓ_j(1), the end of the step before
    for (std::size_t j = 0; j < s_; ++j) {
      end[j] = t.barycentric[j];
      for (std::size_t m = 0; m < s_; ++m)
        if (m != j) end[j] *= 1.0 - t.c[m];
    }
    for (std::size_t r = 0; r < 2 * n_; ++r) {
      const double* const old = call_.slopes + r * s_;
      Pack jump(0.0);
      if (call_.jumped) {
        jump = rate_[r];
        for (std::size_t j = 0; j < s_; ++j) jump -= Pack(end[j] * old[j]);
      }
      for (std::size_t g = 0; g < groups_; ++g) {
        Pack sum = jump;
        for (std::size_t j = 0; j < s_; ++j) sum += weights[g][j] * old[j];
        slopes_[r * groups_ + g] = sum;
      }
    }
  }

  /// rate_ = f(y) at the start of the step, in all lanes.
  void evaluate_start() noexcept {
    for (std::size_t r = 0; r < n_; ++r) {
      y_[r] = Pack(call_.q[r]);
      y_[n_ + r] = Pack(call_.p[r]);
    }
    rates();
  }

  void repeat_start() noexcept {
    for (std::size_t r = 0; r < 2 * n_; ++r)
      for (std::size_t g = 0; g < groups_; ++g) slopes_[r * groups_ + g] = rate_[r];
  }

  /// rate_ = f(y_), docs/theory.md (5.3): Hamilton's equations, and the forces at the velocities of
  /// the stages.
  HAMELIN_INLINE void rates() noexcept {
    dynamics::kernel::hamilton<Space>(call_.chain, scratch_, y_, y_ + n_, rate_, rate_ + n_);
    const Forces& f = call_.forces;
    if (f.held != nullptr || f.damping != nullptr || f.coulomb != nullptr)
      for (std::size_t r = 0; r < n_; ++r) rate_[n_ + r] += joint_force(f, r, rate_[r]);
    if (f.spin_count > 0) {
      dynamics::kernel::gyroscopic_torque<Space>(call_.chain, scratch_, f.spins, f.spin_count,
                                                 force_);
      for (std::size_t r = 0; r < n_; ++r) rate_[n_ + r] += force_[r];
    }
  }

  void finish(GaussOutcome& out) noexcept {
    const double h = call_.h;
    const auto& b = call_.tableau.b;
    for (std::size_t r = 0; r < n_; ++r) {
      double dq = 0.0, dp = 0.0;
      for (std::size_t j = 0; j < s_; ++j) {
        const double v = slope(r, j), p_rate = slope(n_ + r, j), weight = h * b[j];
        dq += weight * v;
        dp += weight * p_rate;
        call_.slopes[r * s_ + j] = v;
        call_.slopes[(n_ + r) * s_ + j] = p_rate;
      }
      call_.q_next[r] = call_.q[r] + dq;
      call_.p_next[r] = call_.p[r] + dp;
    }
    for (std::size_t j = 0; j < s_; ++j)
      add_joint_work(call_.forces, n_, h * b[j], out.work,
                     [&](std::size_t r) { return slope(r, j); });
    if (call_.forces.spin_count == 0) return;
    for (std::size_t g = 0; g < groups_; ++g) {
      // the power of the gyroscopic terms at the converged stages
      for (std::size_t r = 0; r < 2 * n_; ++r) {
        Pack sum(r < n_ ? call_.q[r] : call_.p[r - n_]);
        for (std::size_t j = 0; j < s_; ++j)
          sum += Pack::load(call_.tableau.a_column[j] + g * lanes) * (h * slope(r, j));
        y_[r] = sum;
      }
      rates();
      for (std::size_t r = 0; r < n_; ++r)
        for (std::size_t lane = 0; lane < lanes && g * lanes + lane < s_; ++lane)
          out.work.gyroscopic += h * b[g * lanes + lane] * force_[r].v[lane] * rate_[r].v[lane];
    }
  }

  const GaussCall<Chain>& call_;
  std::size_t n_, s_, groups_;
  Pack* slopes_;  ///< 2n × groups
  Pack *y_, *rate_, *force_;
  Scratch scratch_;
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel
