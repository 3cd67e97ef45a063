#pragma once
#include <cstddef>
#include <functional>
#include <memory>

namespace hamelin::reference {

/// One step of Boost.odeint's rosenbrock4, with plain pointers as arguments. The linear algebra of
/// Boost 1.74 does not compile as C++20, so the source is compiled as C++17, and this header must
/// be valid in both versions.
class OdeintRosenbrock {
 public:
  using Derivative = std::function<void(const double* y, double* dy)>;
  using Jacobian = std::function<void(const double* y, double* by_rows)>;

  /// Solves y' = derivative(y), with `size` numbers in y. `jacobian` gives ∂y'/∂y row by row.
  OdeintRosenbrock(std::size_t size, Derivative derivative, Jacobian jacobian);
  ~OdeintRosenbrock();

  /// Takes a step of length h from y to `next`, with an estimate of the error of each component.
  void step(const double* y, double h, double* next, double* error);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace hamelin::reference
