#pragma once
#include <cstddef>

#include "corrections.hpp"
#include "forces.hpp"
#include "hamelin/dynamics/kernel/groups.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

namespace hamelin::integration::kernel {

/// One step of hamel-variational: Δ from docs/theory.md (4.7), and p⁺ of (4.6).
template <class Chain>
struct VariationalCall {
  const Chain& chain;
  double h;                 ///< may be negative (compositions)
  const double* q;          ///< θ^k
  const double* p;          ///< p_k − (h/2) ∂U(θ^k)
  double* delta;            ///< in: the guess; out: Δ
  double* p_next;           ///< out: p_{k+1} + (h/2) ∂U(θ^{k+1})
  Forces forces;            ///< evaluated at θ_mid and the velocity Δ/h
  double tolerance;         ///< on ‖error of Δ‖∞ [rad or m]
  bool accept_unconfirmed;  ///< whether docs/theory.md (4.28) may accept a step
};

struct VariationalOutcome {
  bool converged;
  int updates, factorizations, evaluations;
  double residual;  ///< the last correction, or the estimate made from its square [rad or m]
  Work work;        ///< F·Δ
};

template <class Chain>
struct VariationalEntry {
  std::size_t (*bytes)(std::size_t links) noexcept;
  /// Newton's method, see Variational::solve().
  VariationalOutcome (*step)(const VariationalCall<Chain>& call, void* memory) noexcept;
  /// The step with the given Δ, and the residual R of its equation.
  VariationalOutcome (*evaluate)(const VariationalCall<Chain>& call, void* memory,
                                 double* residual) noexcept;
};
using VariationalSet = dynamics::kernel::Groups<VariationalEntry>;

inline constexpr double largest_correction = 0.3;
// A correction of size e leaves an error of about 0.3 e² (measured on falling chains); 10 is a safe
// bound.
inline constexpr double quadratic_constant = 10.0;

inline namespace HAMELIN_ISA_NAMESPACE {

/// The sweeps, docs/theory.md (4.3)–(4.8), and their exact linearisation, docs/theory.md
/// (4.9)–(4.22), written once over the group and scaled so that h drops out of the linearisation:
///   σ = δΔ/h,  b = (h/2) ad(X)A,  z = (h/2) adᵀ(A)λ,  a = A − b,  B = A + b,
///   u = P B − z,  w = Pᵀa + z,  d = a·P B + z·b + armature + (h/2) D,
///   P_{i−1} = I_{i−1} + Adᵀ(P − u wᵀ/d)Ad,  ρ = (−R − a·s)/d,  s_{i−1} = Adᵀ(s + u ρ),
///   σ = ρ − w·y/d,  y_i = Ad δξ_{i−1},  δξ = y + B σ.
/// Gyroscopic terms have a second pair, δμ = Q δξ + t.
template <class Space>
class Variational {
  using Chain = typename Space::Chain;
  using Link = typename Space::Link;
  using Motion = typename Space::Motion;
  using Force = typename Space::Force;
  using Scratch = dynamics::kernel::Scratch<Space>;

  struct Factors {
    Motion b;  ///< (h/2) ad(X) A
    Force z, w, u;
    Force spin_u;  ///< e = Q B − (h/2) adᵀ(A) μ, docs/theory.md (4.21)
    double inv_d, rho;
  };

 public:
  static std::size_t bytes(std::size_t n) noexcept {
    return Scratch::bytes(n) + n * sizeof(Factors) + 7 * n * sizeof(double);
  }
  static VariationalOutcome step(const VariationalCall<Chain>& call, void* memory) noexcept {
    Variational v(call, memory);
    v.solve();
    return v.out_;
  }

  static VariationalOutcome evaluate(const VariationalCall<Chain>& call, void* memory,
                                     double* residual) noexcept {
    Variational v(call, memory);
    v.evaluate();
    for (std::size_t i = 0; i < v.n_; ++i) {
      residual[i] = v.residual_[i];
      v.residual_[i] = 0.0;
    }
    v.finish();
    return v.out_;
  }

  Variational(const VariationalCall<Chain>& call, void* memory) noexcept
      : call_(call),
        n_(dynamics::kernel::count<Space>(call.chain)),
        links_(dynamics::kernel::links_of<Space>(call.chain)),
        half_(0.5 * call.h),
        k_(Scratch::at(memory, n_)),
        f_(reinterpret_cast<Factors*>(static_cast<char*>(memory) + Scratch::bytes(n_))),
        mid_(reinterpret_cast<double*>(f_ + n_)),
        rate_(mid_ + n_),
        plus_(rate_ + n_),
        residual_(plus_ + n_),
        force_(residual_ + n_),
        sigma_(force_ + n_),
        external_(sigma_ + n_) {}

  /// R and p⁺ at the current Δ.
  void evaluate() noexcept { sweep<false>(); }

  /// The same, and the factors of the linearisation there. False if a pivot is lost.
  bool evaluate_and_factor() noexcept {
    return call_.forces.spin_count > 0 ? eliminate<true>() : eliminate<false>();
  }

  /// Solves for the residual of evaluate_and_factor() and adds δΔ to Δ; returns ‖δΔ‖∞.
  double correct() noexcept { return substitute(); }

  /// R and p⁺ at the current Δ; solves for this R with the kept factors and adds δΔ to Δ; returns
  /// ‖δΔ‖∞. Frames are those of the current Δ, which changes the kept Jacobian by the order of δΔ.
  double evaluate_and_correct() noexcept {
    sweep<true>();
    return substitute();
  }

  const double* residual() const noexcept { return residual_; }

 private:
  /// Places the chain at θ_mid and computes the twists ξ_i, b_i and the forces at the velocity Δ/h:
  /// docs/theory.md (4.3), (4.9), (4.35).
  HAMELIN_INLINE void update_kinematics() noexcept {
    const double inv_h = 1.0 / call_.h;
    for (std::size_t i = 0; i < n_; ++i) {
      mid_[i] = call_.q[i] + 0.5 * call_.delta[i];
      rate_[i] = call_.delta[i] * inv_h;
    }
    dynamics::kernel::place<Space>(call_.chain, k_, mid_);
    auto twist = Space::zero_motion();
    for (std::size_t i = 0; i < n_; ++i) {
      const auto X = i == 0 ? twist : Space::to_child(links_[i], k_[i].x, twist);
      f_[i].b = Space::scaled(Space::bracket(links_[i], X), half_);
      twist = X;
      Space::add_along_axis(links_[i], twist, rate_[i]);
      k_[i].motion = twist;
    }
    const Forces& f = call_.forces;
    for (std::size_t i = 0; i < n_; ++i) force_[i] = joint_force(f, i, rate_[i]);
    if (f.spin_count > 0) {
      dynamics::kernel::gyroscopic_torque<Space>(call_.chain, k_, f.spins, f.spin_count, sigma_);
      for (std::size_t i = 0; i < n_; ++i) force_[i] += sigma_[i];
    }
    if (f.external.evaluate != nullptr) {
      f.external.evaluate(f.external.context, mid_, rate_, external_);
      for (std::size_t i = 0; i < n_; ++i) force_[i] += external_[i];
    }
  }

  /// λ, R and p⁺ inwards; with Correct also ρ for this R by the kept factors.
  template <bool Correct>
  HAMELIN_INLINE void sweep() noexcept {
    ++out_.evaluations;
    update_kinematics();
    auto lambda = Space::zero_force(), s = Space::zero_force(), t = Space::zero_force();
    for (std::size_t i = n_; i-- > 0;) {
      const Link& l = links_[i];
      const auto& x = k_[i].x;
      lambda = Space::sum(lambda, Space::momentum(l, x, k_[i].motion));  // docs/theory.md (4.4)
      store_momenta(i, lambda);
      if (i > 0) lambda = Space::to_parent(l, x, lambda);
      if constexpr (Correct) {
        auto& f = f_[i];
        double right = -residual_[i] - along_a(i, s);
        if (call_.forces.spin_count > 0) right += half_ * Space::along_axis(l, t);
        f.rho = right * f.inv_d;
        if (i == 0) break;
        s = Space::to_parent(l, x, Space::sum(s, Space::scaled(f.u, f.rho)));
        if (call_.forces.spin_count > 0)
          t = Space::to_parent(l, x, Space::sum(t, Space::scaled(f.spin_u, f.rho)));
      }
    }
  }

  /// p⁺ and R of a joint from its λ: docs/theory.md (4.5)–(4.7).
  HAMELIN_INLINE void store_momenta(std::size_t i, const Force& lambda) noexcept {
    double along = Space::along_axis(links_[i], lambda);
    if constexpr (Space::has_prismatic_or_rotor) along += links_[i].armature * rate_[i];
    const double turned = Space::pair(f_[i].b, lambda);
    residual_[i] = along - turned - half_ * force_[i] - call_.p[i];
    plus_[i] = along + turned;
  }

  /// a·s of a joint.
  HAMELIN_INLINE double along_a(std::size_t i, const Force& s) const noexcept {
    return Space::along_axis(links_[i], s) - Space::pair(f_[i].b, s);
  }

  /// One pass inwards: λ, R, p⁺, the factors and ρ. False if a pivot is lost.
  template <bool Spins>
  bool eliminate() noexcept {
    ++out_.evaluations;
    ++out_.factorizations;
    update_kinematics();
    auto P = Space::no_operator(), Q = Space::no_operator();
    auto lambda = Space::zero_force(), mu = Space::zero_force(), s = Space::zero_force(),
         t = Space::zero_force();
    for (std::size_t i = n_; i-- > 0;) {
      const Link& l = links_[i];
      auto& f = f_[i];
      const auto& x = k_[i].x;
      lambda = Space::sum(lambda, Space::momentum(l, x, k_[i].motion));
      store_momenta(i, lambda);
      Space::add_rigid(l, x, P);  // from here docs/theory.md (4.14)–(4.18)
      const Force z = f.z = Space::scaled(Space::ad_transposed_axis(l, lambda), half_);
      const Force PB = Space::times_axis_plus(l, P, f.b);
      f.u = Space::sum(PB, Space::scaled(z, -1.0));
      f.w = Space::sum(Space::transposed_times_axis_minus(l, P, f.b), z);
      const double along = Space::along_axis(l, PB);
      double d = along - Space::pair(f.b, PB) + Space::pair(f.b, z);
      if constexpr (Space::has_prismatic_or_rotor) d += l.armature;
      if (call_.forces.damping != nullptr || call_.forces.coulomb != nullptr)
        d += half_ * joint_force_slope(call_.forces, i, rate_[i]);
      double right = -residual_[i] - along_a(i, s);
      if constexpr (Spins) {
        for (std::size_t j = 0; j < call_.forces.spin_count; ++j)
          if (call_.forces.spins[j].link == i) add_gyroscopic(call_.forces.spins[j], Q, mu);
        // docs/theory.md (4.20)–(4.22)
        const Force QB = Space::times_axis_plus(l, Q, f.b);
        f.spin_u = Space::sum(QB, Space::scaled(Space::ad_transposed_axis(l, mu), -half_));
        f.w = Space::sum(f.w, Space::scaled(Space::row(l, Q), -half_));
        d -= half_ * Space::along_axis(l, QB);
        right += half_ * Space::along_axis(l, t);
      }
      // docs/theory.md (4.23): a pivot that is lost in the rounding of its terms has no meaning
      if (!(__builtin_fabs(d) > 1e-14 * __builtin_fabs(along))) return false;
      f.inv_d = 1.0 / d;
      f.rho = right * f.inv_d;
      if (i == 0) break;
      const Force share = Space::scaled(f.w, f.inv_d);
      Space::subtract_outer(P, f.u, share);
      Space::carry(l, x, P);
      s = Space::to_parent(l, x, Space::sum(s, Space::scaled(f.u, f.rho)));
      lambda = Space::to_parent(l, x, lambda);
      if constexpr (Spins) {
        Space::subtract_outer(Q, f.spin_u, share);
        Space::carry(l, x, Q);
        t = Space::to_parent(l, x, Space::sum(t, Space::scaled(f.spin_u, f.rho)));
        mu = Space::to_parent(l, x, mu);
      }
    }
    return true;
  }

  /// Adds the wrench of a term and its derivative by the link's twist, docs/theory.md (4.19). The
  /// turning of the link relative to w is left out of the derivative: it is of higher order in h.
  void add_gyroscopic(const dynamics::kernel::Spin& spin, typename Space::Operator& Q,
                      Force& mu) const noexcept {
    auto w = Space::spin_axis(spin.w);
    for (std::size_t j = 0; j <= spin.link; ++j) w = Space::to_child_axis(links_[j], k_[j].x, w);
    Space::add(Q, Space::spin_operator(w, k_[spin.link].x, spin.point));
    mu = Space::sum(mu, Space::spin_force(w, k_[spin.link].x, spin.point, k_[spin.link].motion));
  }

  /// One pass outwards, docs/theory.md (4.10), (4.16): σ, and Δ ← Δ + h σ. Returns ‖δΔ‖∞.
  HAMELIN_INLINE double substitute() noexcept {
    auto step = Space::zero_motion();
    double most = 0.0;
    for (std::size_t i = 0; i < n_; ++i) {
      const Link& l = links_[i];
      const auto& f = f_[i];
      auto y = i == 0 ? step : Space::to_child(l, k_[i].x, step);
      sigma_[i] = f.rho - f.inv_d * Space::pair(y, f.w);
      const double correction = sigma_[i] * call_.h;
      call_.delta[i] += correction;
      const double size = __builtin_fabs(correction);
      most = most >= size ? most : size;  // a NaN spreads outwards, so the last joint has it
      step = Space::sum(y, Space::scaled(f.b, sigma_[i]));
      Space::add_along_axis(l, step, sigma_[i]);
    }
    ++out_.updates;
    return most;
  }

  /// p⁺ after a correction that no sweep confirms, docs/theory.md (4.28): p⁻ is p + (h/2) F, and
  /// b·λ changes to first order by b·δλ − z·δX with (4.10) and (4.11). Gyroscopic terms are not
  /// included.
  HAMELIN_INLINE void update_momentum() noexcept {
    const double inv_h = 1.0 / call_.h;
    auto step = Space::zero_motion();
    for (std::size_t i = 0; i < n_; ++i) {
      const Link& l = links_[i];
      const auto y = i == 0 ? step : Space::to_child(l, k_[i].x, step);
      step = Space::sum(y, Space::scaled(f_[i].b, sigma_[i]));
      const double turned = 0.5 * (plus_[i] - residual_[i] - half_ * force_[i] - call_.p[i]);
      plus_[i] = turned - Space::pair(step, f_[i].z);
      Space::add_along_axis(l, step, sigma_[i]);
      k_[i].force = Space::momentum(l, k_[i].x, step);
      rate_[i] = call_.delta[i] * inv_h;
      force_[i] = joint_force(call_.forces, i, rate_[i]);
    }
    auto lambda = Space::zero_force();
    for (std::size_t i = n_; i-- > 0;) {
      lambda = Space::sum(lambda, k_[i].force);
      plus_[i] = call_.p[i] + 2.0 * (plus_[i] + Space::pair(f_[i].b, lambda)) + half_ * force_[i];
      residual_[i] = 0.0;
      if (i > 0)
        lambda = Space::to_parent(links_[i], k_[i].x,
                                  Space::sum(lambda, Space::scaled(f_[i].z, -sigma_[i])));
    }
  }

  HAMELIN_INLINE void solve() noexcept {
    Corrections corrections(newton_rule(largest_correction, call_.tolerance));
    for (;;) {
      if (!evaluate_and_factor()) return;
      const double first = correct();
      out_.residual = first;
      if (!corrections.record(first)) return;
      if (call_.accept_unconfirmed && call_.forces.spin_count == 0 &&
          call_.forces.external.evaluate == nullptr &&
          quadratic_constant * first * first <= call_.tolerance) {
        out_.residual = quadratic_constant * first * first;
        update_momentum();
        finish();
        return;
      }
      // docs/theory.md (4.25): confirm with the sweep that p⁺ needs in any case
      for (bool again = true; again;) {
        const double error = evaluate_and_correct();
        out_.residual = error;
        if (error <= call_.tolerance) {
          finish();
          return;
        }
        const double ratio = corrections.ratio(error);
        // keep the factors if two sweeps suffice, because new factors cost as much as two sweeps
        again = ratio < 0.1 && error * ratio * ratio <= 0.1 * call_.tolerance;
        if (!corrections.record(error)) return;
      }
      if (out_.updates >= max_newton_updates) return;
    }
  }

  /// Δ includes the last correction; p⁺ − R applies it to p⁺ to first order: docs/theory.md (4.26).
  HAMELIN_INLINE void finish() noexcept {
    out_.converged = true;
    for (std::size_t i = 0; i < n_; ++i)
      call_.p_next[i] = plus_[i] - residual_[i] + half_ * force_[i];
    const Forces& f = call_.forces;
    add_joint_work(f, n_, call_.h, out_.work, [&](std::size_t i) { return rate_[i]; });
    if (f.spin_count > 0) {
      dynamics::kernel::gyroscopic_torque<Space>(call_.chain, k_, f.spins, f.spin_count, sigma_);
      for (std::size_t i = 0; i < n_; ++i) out_.work.gyroscopic += sigma_[i] * rate_[i] * call_.h;
    }
    if (f.external.evaluate != nullptr)
      for (std::size_t i = 0; i < n_; ++i) out_.work.external += external_[i] * rate_[i] * call_.h;
  }

  const VariationalCall<Chain>& call_;
  VariationalOutcome out_{};
  std::size_t n_;
  const Link* links_;
  double half_;
  Scratch k_;
  Factors* f_;
  double *mid_, *rate_, *plus_, *residual_, *force_, *sigma_;
  double* external_;  ///< torques of the wrenches in the last sweep
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel
