#pragma once
#include <string>

#include "hamelin/optimal/solve.hpp"
#include "nonlinear_program.hpp"

namespace hamelin::optimal {

struct IpoptResult {
  bool converged = false;
  std::string cause;
  Eigen::VectorXd x;
  int iterations = 0;
  double stationarity = 0.0;
};

/// Solves a program by IPOPT (A. Wächter, L. T. Biegler, Mathematical Programming 106, 2006,
/// doi:10.1007/s10107-004-0559-y), with a quasi-Newton Hessian where none is known.
[[nodiscard]] IpoptResult solve_by_ipopt(NonlinearProgram& program, const Eigen::VectorXd& guess,
                                         const SolveOptions& options);

/// The problem of `solve`, by IPOPT.
[[nodiscard]] Solution solve_by_ipopt(const Problem& problem, const MatrixXd& guess,
                                      const SolveOptions& options);

}  // namespace hamelin::optimal
