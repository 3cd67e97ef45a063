#pragma once
#include <cstddef>
#include <functional>
#include <memory>

namespace hamelin::reference {

/// One step of Boost.odeint's rosenbrock4 behind plain pointers: the linear algebra of Boost 1.74 does not compile as
/// C++20, so its source is built as C++17 and this header must read as both.
class OdeintRosenbrock {
 public:
  using Derivative = std::function<void(const double* y, double* dy)>;
  using Jacobian = std::function<void(const double* y, double* by_rows)>;

  /// y' = derivative(y), y of `size` numbers.
  OdeintRosenbrock(std::size_t size, Derivative derivative, Jacobian jacobian);
  ~OdeintRosenbrock();

  /// From y over h to `next`, with an estimate of the error of each component.
  void step(const double* y, double h, double* next, double* error);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace hamelin::reference
