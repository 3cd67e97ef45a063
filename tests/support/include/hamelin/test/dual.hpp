#pragma once
#include <Eigen/Core>
#include <cmath>

namespace hamelin::test {

inline double inverse(double x) {
  return 1.0 / x;
}

/// A dual number a + b ε with ε² = 0: functions of it carry their exact derivative in b. Nested
/// (Dual<Dual<double>>), the innermost slope is the exact second derivative.
template <class T>
struct Dual {
  T value{}, slope{};

  Dual() = default;
  Dual(double x) : value(x), slope(0.0) {}  // NOLINT: numbers convert, as they do to double
  Dual(const T& x, const T& dx) : value(x), slope(dx) {}

  friend Dual operator+(const Dual& a, const Dual& b) {
    return {a.value + b.value, a.slope + b.slope};
  }
  friend Dual operator-(const Dual& a, const Dual& b) {
    return {a.value - b.value, a.slope - b.slope};
  }
  friend Dual operator-(const Dual& a) { return {-a.value, -a.slope}; }
  friend Dual operator*(const Dual& a, const Dual& b) {
    return {a.value * b.value, a.value * b.slope + a.slope * b.value};
  }
  Dual& operator+=(const Dual& b) { return *this = *this + b; }
  Dual& operator-=(const Dual& b) { return *this = *this - b; }
  Dual& operator*=(const Dual& b) { return *this = *this * b; }
  friend Dual sin(const Dual& a) {
    using std::cos, std::sin;
    return {sin(a.value), cos(a.value) * a.slope};
  }
  friend Dual cos(const Dual& a) {
    using std::cos, std::sin;
    return {cos(a.value), -(sin(a.value) * a.slope)};
  }
  friend Dual inverse(const Dual& a) {
    const T x = inverse(a.value);
    return {x, -(x * x * a.slope)};
  }
};
using HyperDual = Dual<Dual<double>>;

}  // namespace hamelin::test

template <class T>
struct Eigen::NumTraits<hamelin::test::Dual<T>> : Eigen::GenericNumTraits<double> {
  using Real = hamelin::test::Dual<T>;
  using NonInteger = hamelin::test::Dual<T>;
  using Nested = hamelin::test::Dual<T>;
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 1 };
};

namespace hamelin::test {

/// Gradient and Hessian of f at x by nested dual numbers; f takes and returns HyperDual.
template <class Function>
void hessian(const Function& f, const Eigen::VectorXd& x, Eigen::VectorXd& gradient,
             Eigen::MatrixXd& H) {
  const Eigen::Index n = x.size();
  Eigen::Matrix<HyperDual, Eigen::Dynamic, 1> at(n);
  for (Eigen::Index i = 0; i < n; ++i) at[i] = HyperDual(x[i]);
  gradient.resize(n);
  H.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    at[i].slope.value = 1.0;
    for (Eigen::Index j = 0; j <= i; ++j) {
      at[j].value.slope = 1.0;
      const HyperDual y = f(at);
      gradient[i] = y.slope.value;
      H(i, j) = H(j, i) = y.slope.slope;
      at[j].value.slope = 0.0;
    }
    at[i].slope.value = 0.0;
  }
}

}  // namespace hamelin::test
