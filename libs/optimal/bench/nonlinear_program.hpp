#pragma once
#include <Eigen/Core>
#include <vector>

namespace hamelin::optimal {

/// Minimise f(x) with lower ≤ c(x) ≤ upper, as a general solver sees it.
class NonlinearProgram {
 public:
  using Index = Eigen::Index;
  using VectorXd = Eigen::VectorXd;
  struct Entry {
    Index row, column;
  };

  virtual ~NonlinearProgram() = default;
  [[nodiscard]] virtual Index variables() const = 0;
  [[nodiscard]] virtual const VectorXd& lower() const = 0;
  [[nodiscard]] virtual const VectorXd& upper() const = 0;
  /// Everything below at x. @return false if a number is not finite
  [[nodiscard]] virtual bool evaluate(const VectorXd& x) = 0;
  [[nodiscard]] virtual double cost() const = 0;
  virtual void gradient(VectorXd& out) const = 0;
  [[nodiscard]] virtual const VectorXd& values() const = 0;
  /// The entries of ∂c/∂x that may differ from zero, and their values in the same order; an entry
  /// that is listed several times is a sum.
  [[nodiscard]] virtual std::vector<Entry> jacobian_entries() const = 0;
  virtual void jacobian(double* values) const = 0;
  /// The same for the lower triangle of factor ∇²f + Σ y_i ∇²c_i; empty if it is not known.
  [[nodiscard]] virtual std::vector<Entry> hessian_entries() const = 0;
  virtual void hessian(double factor, const VectorXd& y, double* values) = 0;
};

}  // namespace hamelin::optimal
