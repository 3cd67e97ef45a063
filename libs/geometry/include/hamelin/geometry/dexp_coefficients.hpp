#pragma once
#include <array>
#include <cmath>
#include <cstddef>

/// The scalar functions of the angle θ in exp, dexp and dexp⁻¹ of all four groups, to full
/// precision at every angle: docs/theory.md (1.3), (1.7)–(1.11).
namespace hamelin::geometry {

/// Σ c_k xᵏ by Horner's rule.
template <std::size_t n>
[[nodiscard]] constexpr double polynomial(const std::array<double, n>& c, double x) noexcept {
  double sum = c[n - 1];
  for (std::size_t k = n - 1; k-- > 0;) sum = sum * x + c[k];
  return sum;
}

/// exp(ω̂) = 1 + sinc ω̂ + a ω̂², and dexp = 1 + a ad + b ad² where ad³ = −θ² ad. The latter holds
/// for all groups except SE(3).
struct ExpCoefficients {
  double sinc;  ///< sin θ / θ
  double a;     ///< (1 − cos θ)/θ²
  double b;     ///< (θ − sin θ)/θ³
  double da;    ///< a'(θ)/θ = (sinc − 2a)/θ²
  double db;    ///< b'(θ)/θ = (a − 3b)/θ²
};

/// Below this angle [rad] the closed forms in exp_coefficients suffer from cancellation, and a
/// series is used: ten terms, up to θ¹⁸. The first omitted term is below 2e-18 of the sum.
inline constexpr double exp_series_threshold = 1.0;

/// @param theta_squared θ² ≥ 0 [rad²]
[[nodiscard]] inline ExpCoefficients exp_coefficients(double theta_squared) noexcept {
  const double x = theta_squared;
  if (x < exp_series_threshold * exp_series_threshold) {
    constexpr std::size_t terms = 10;
    // (−1)ᵏ/(2k + shift)!
    constexpr auto series = [](int shift) {
      std::array<double, terms + 1> c{};
      double factorial = 1.0;
      for (int i = 2; i <= shift; ++i) factorial *= i;
      for (std::size_t k = 0; k <= terms; ++k) {
        c[k] = (k % 2 == 0 ? 1.0 : -1.0) / factorial;
        const int next = 2 * static_cast<int>(k) + shift + 1;
        factorial *= static_cast<double>(next) * static_cast<double>(next + 1);
      }
      return c;
    };
    // f'(θ)/θ of a series in θ²
    constexpr auto derivative = [](const std::array<double, terms + 1>& c) {
      std::array<double, terms> d{};
      for (std::size_t k = 0; k < terms; ++k) d[k] = 2.0 * static_cast<double>(k + 1) * c[k + 1];
      return d;
    };
    constexpr auto sinc = series(1), a = series(2), b = series(3);
    constexpr auto da = derivative(a), db = derivative(b);
    return {polynomial(sinc, x), polynomial(a, x), polynomial(b, x), polynomial(da, x),
            polynomial(db, x)};
  }
  const double theta = std::sqrt(x);
  const double half_sine = std::sin(0.5 * theta);
  const double sinc = std::sin(theta) / theta;
  const double a = 2.0 * half_sine * half_sine / x;
  const double b = (1.0 - sinc) / x;
  return {sinc, a, b, (sinc - 2.0 * a) / x, (a - 3.0 * b) / x};
}

/// dexp⁻¹ = 1 − ad/2 + e ad² where ad³ = −θ² ad.
struct InverseExpCoefficients {
  double gamma;  ///< (θ/2) cot(θ/2)
  double e;      ///< (1 − γ)/θ²
  double de;     ///< e'(θ)/θ = (1/4 − (γ + 2) e)/θ²
};

/// Below this angle [rad] inverse_exp_coefficients uses the series Σ |B₂ₖ|/(2k)! θ^(2k−2) with the
/// Bernoulli numbers B₂ to B₂₄ (θ²²). The first omitted term is below 1e-19 of the sum.
inline constexpr double inverse_exp_series_threshold = 1.0;

/// @param theta_squared θ² ≥ 0 [rad²]; singular at θ = 2π, 4π, …
[[nodiscard]] inline InverseExpCoefficients inverse_exp_coefficients(
    double theta_squared) noexcept {
  const double x = theta_squared;
  if (x < inverse_exp_series_threshold * inverse_exp_series_threshold) {
    constexpr std::array<double, 12> e{1.0 / 12.0,
                                       1.0 / 720.0,
                                       1.0 / 30240.0,
                                       1.0 / 1209600.0,
                                       1.0 / 47900160.0,
                                       691.0 / 1307674368000.0,
                                       1.0 / 74724249600.0,
                                       3617.0 / 10670622842880000.0,
                                       43867.0 / 5109094217170944000.0,
                                       174611.0 / 330.0 / 2432902008176640000.0,
                                       854513.0 / 138.0 / 1124000727777607680000.0,
                                       236364091.0 / 2730.0 / 620448401733239439360000.0};
    constexpr auto de = [](const std::array<double, 12>& c) {
      std::array<double, 11> d{};
      for (std::size_t k = 0; k < d.size(); ++k) d[k] = 2.0 * static_cast<double>(k + 1) * c[k + 1];
      return d;
    }(e);
    const double value = polynomial(e, x);
    return {1.0 - x * value, value, polynomial(de, x)};
  }
  const double half = 0.5 * std::sqrt(x);
  const double gamma = half * std::cos(half) / std::sin(half);
  const double e = (1.0 - gamma) / x;
  return {gamma, e, (0.25 - (gamma + 2.0) * e) / x};
}

}  // namespace hamelin::geometry
