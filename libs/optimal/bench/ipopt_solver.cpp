#include "ipopt_solver.hpp"

#include <IpIpoptApplication.hpp>
#include <IpTNLP.hpp>
#include <algorithm>
#include <cmath>

#include "transcription_program.hpp"

namespace hamelin::optimal {

namespace {

using Ipopt::Index;
using Ipopt::Number;

constexpr double infinite = 2e19;  // what IPOPT takes for no bound

Eigen::Map<const Eigen::VectorXd> map(const Number* x, Index n) {
  return {x, n};
}

class Adapter final : public Ipopt::TNLP {
 public:
  Adapter(NonlinearProgram& program, const Eigen::VectorXd& guess, std::function<bool()> stop)
      : program_(program),
        stop_(std::move(stop)),
        jacobian_(program.jacobian_entries()),
        hessian_(program.hessian_entries()) {
    result.x = guess;
  }
  IpoptResult result;

  bool get_nlp_info(Index& n, Index& m, Index& jacobian, Index& hessian,
                    IndexStyleEnum& style) override {
    n = static_cast<Index>(program_.variables());
    m = static_cast<Index>(program_.lower().size());
    jacobian = static_cast<Index>(jacobian_.size());
    hessian = static_cast<Index>(hessian_.size());
    style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Index n, Number* x_lower, Number* x_upper, Index m, Number* lower,
                       Number* upper) override {
    std::fill_n(x_lower, n, -infinite);
    std::fill_n(x_upper, n, infinite);
    for (Index r = 0; r < m; ++r) {
      lower[r] = std::max(program_.lower()[r], -infinite);
      upper[r] = std::min(program_.upper()[r], infinite);
    }
    return true;
  }
  bool get_starting_point(Index n, bool, Number* x, bool, Number*, Number*, Index, bool,
                          Number*) override {
    std::copy_n(result.x.data(), n, x);
    return true;
  }
  bool eval_f(Index n, const Number* x, bool fresh, Number& f) override {
    if (!at(n, x, fresh)) return false;
    f = program_.cost();
    return true;
  }
  bool eval_grad_f(Index n, const Number* x, bool fresh, Number* out) override {
    if (!at(n, x, fresh)) return false;
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
    program_.gradient(gradient);
    std::copy_n(gradient.data(), n, out);
    return true;
  }
  bool eval_g(Index n, const Number* x, bool fresh, Index m, Number* out) override {
    if (!at(n, x, fresh)) return false;
    std::copy_n(program_.values().data(), m, out);
    return true;
  }
  bool eval_jac_g(Index n, const Number* x, bool fresh, Index, Index, Index* rows, Index* columns,
                  Number* values) override {
    if (values == nullptr) {
      list(jacobian_, rows, columns);
      return true;
    }
    if (!at(n, x, fresh)) return false;
    program_.jacobian(values);
    return true;
  }
  bool eval_h(Index n, const Number* x, bool fresh, Number factor, Index m, const Number* y, bool,
              Index, Index* rows, Index* columns, Number* values) override {
    if (values == nullptr) {
      list(hessian_, rows, columns);
      return true;
    }
    if (!at(n, x, fresh)) return false;
    program_.hessian(factor, map(y, m), values);
    return true;
  }
  bool intermediate_callback(Ipopt::AlgorithmMode, Index iteration, Number, Number, Number dual,
                             Number, Number, Number, Number, Number, Index, const Ipopt::IpoptData*,
                             Ipopt::IpoptCalculatedQuantities*) override {
    result.iterations = iteration;
    result.stationarity = dual;
    return !(stop_ && stop_());
  }
  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* x, const Number*,
                         const Number*, Index, const Number*, const Number*, Number,
                         const Ipopt::IpoptData*, Ipopt::IpoptCalculatedQuantities*) override {
    result.x = map(x, n);
  }

 private:
  using Entries = std::vector<NonlinearProgram::Entry>;
  static void list(const Entries& entries, Index* rows, Index* columns) {
    for (const auto& entry : entries) {
      *rows++ = static_cast<Index>(entry.row);
      *columns++ = static_cast<Index>(entry.column);
    }
  }
  bool at(Index n, const Number* x, bool fresh) {
    if (fresh || !evaluated_) {
      finite_ = program_.evaluate(map(x, n));
      evaluated_ = true;
    }
    return finite_;
  }

  NonlinearProgram& program_;
  std::function<bool()> stop_;
  Entries jacobian_, hessian_;
  bool evaluated_ = false, finite_ = false;
};

}  // namespace

IpoptResult solve_by_ipopt(NonlinearProgram& program, const Eigen::VectorXd& guess,
                           const SolveOptions& options) {
  const Ipopt::SmartPtr<Adapter> adapter = new Adapter(program, guess, options.stop);
  const Ipopt::SmartPtr<Ipopt::IpoptApplication> application = new Ipopt::IpoptApplication(false);
  auto& settings = *application->Options();
  settings.SetNumericValue("tol", options.tolerance);
  settings.SetIntegerValue("max_iter", options.iterations_max);
  settings.SetIntegerValue("print_level", 0);
  settings.SetStringValue("sb", "yes");
  // bounds are kept exactly, and not relaxed by 1e-8
  settings.SetNumericValue("bound_relax_factor", 0.0);
  if (program.hessian_entries().empty())
    settings.SetStringValue("hessian_approximation", "limited-memory");
  const auto initialized = application->Initialize();
  const auto status = initialized == Ipopt::Solve_Succeeded
                          ? application->OptimizeTNLP(GetRawPtr(adapter))
                          : initialized;
  IpoptResult& result = adapter->result;
  result.converged = status == Ipopt::Solve_Succeeded;
  if (!result.converged)
    result.cause = "IPOPT ended with status " + std::to_string(static_cast<int>(status));
  (void)program.evaluate(result.x);
  return result;
}

Solution solve_by_ipopt(const Problem& problem, const MatrixXd& guess,
                        const SolveOptions& options) {
  Transcription program(problem);
  TranscriptionProgram adapted(program);
  const IpoptResult found = solve_by_ipopt(adapted, program.variables_of(guess), options);
  Solution out;
  out.converged = found.converged;
  out.cause = found.cause;
  out.iterations = found.iterations;
  out.stationarity = found.stationarity;
  complete(out, program, options.no_violation());
  return out;
}

}  // namespace hamelin::optimal
