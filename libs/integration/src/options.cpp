#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

Options options_from_json(const Json& params, const std::string& where) {
  check_shipped_schema(params, "integrator", where);
  Options options;
  options.alpha = params.value("alpha", options.alpha);
  if (params.value("start", "consistent") == "published") options.start = Start::published;
  if (params.contains("solver")) {
    options.solver_given = true;
    options.solver = params["solver"] == "newton" ? Solver::newton : Solver::feedback;
  }
  options.tolerance = params.value("tolerance", options.tolerance);
  options.feedback_tolerance = params.value("feedback_tolerance", options.feedback_tolerance);
  options.max_updates = params.value("max_updates", options.max_updates);
  options.max_halvings = params.value("max_halvings", options.max_halvings);
  return options;
}

}  // namespace hamelin::integration
