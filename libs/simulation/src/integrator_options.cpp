#include "hamelin/simulation/integrator_options.hpp"

namespace hamelin::simulation {

using integration::Options;
using integration::Solver;
using integration::Start;

Options integrator_options(const Json& params, const std::string& where) {
  check_shipped_schema(params, "integrator", where);
  Options options;
  options.alpha = params.value("alpha", options.alpha);
  if (params.value("start", "consistent") == "published") options.start = Start::published;
  if (params.contains("solver")) {
    options.solver_given = true;
    const std::string solver = params["solver"];
    options.solver = solver == "newton" ? Solver::newton : solver == "riqn" ? Solver::riqn : Solver::feedback;
  }
  options.tolerance = params.value("tolerance", options.tolerance);
  options.feedback_tolerance = params.value("feedback_tolerance", options.feedback_tolerance);
  options.max_updates = params.value("max_updates", options.max_updates);
  options.max_halvings = params.value("max_halvings", options.max_halvings);
  options.order = params.value("order", options.order);
  options.rtol = params.value("rtol", options.rtol);
  options.atol = params.value("atol", options.atol);
  options.newmark_beta = params.value("newmark_beta", options.newmark_beta);
  options.newmark_gamma = params.value("newmark_gamma", options.newmark_gamma);
  return options;
}

}  // namespace hamelin::simulation
