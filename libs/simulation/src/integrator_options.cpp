#include "hamelin/simulation/integrator_options.hpp"

namespace hamelin::simulation {

using integration::Solver;
using integration::Start;

namespace {

template <class T>
void take(const Json& params, const char* key, std::optional<T>& into) {
  if (params.contains(key)) into = params[key].get<T>();
}

}  // namespace

integration::Parameters integrator_options(const Json& params, const std::string& where) {
  check_shipped_schema(params, "integrator", where);
  integration::Parameters options;
  take(params, "alpha", options.alpha);
  if (params.contains("start"))
    options.start = params["start"] == "published" ? Start::published : Start::consistent;
  if (params.contains("solver")) {
    const std::string solver = params["solver"];
    options.solver = solver == "newton" ? Solver::newton
                     : solver == "riqn" ? Solver::riqn
                                        : Solver::feedback;
  }
  take(params, "tolerance", options.tolerance);
  take(params, "feedback_tolerance", options.feedback_tolerance);
  take(params, "max_updates", options.max_updates);
  take(params, "max_halvings", options.max_halvings);
  take(params, "order", options.order);
  take(params, "rtol", options.rtol);
  take(params, "atol", options.atol);
  take(params, "newmark_beta", options.newmark_beta);
  take(params, "newmark_gamma", options.newmark_gamma);
  return options;
}

}  // namespace hamelin::simulation
