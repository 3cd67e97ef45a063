#include <fmt/format.h>

#include "explicit.hpp"
#include "hamel.hpp"
#include "hamelin/core/error.hpp"
#include "variational.hpp"

namespace hamelin::integration {

const std::vector<std::string>& integrator_names() {
  static const std::vector<std::string> names{"hamel", "hamel-midpoint", "hamel-variational", "semi-implicit-euler",
                                              "rk4"};
  return names;
}

std::unique_ptr<Integrator> make_integrator(const std::string& name, const Model& model, const Options& asked) {
  Options options = asked;
  const bool rooted = name == "hamel" || name == "hamel-midpoint";
  if (rooted) {
    if (options.solver_given && options.solver != Solver::feedback)
      throw Error(ErrorCode::usage, fmt::format("integrator '{}' has the solver 'feedback' only", name));
    options.solver = Solver::feedback;
  }
  if (rooted) return std::make_unique<Hamel>(model, options, name == "hamel-midpoint");
  if (name == "hamel-variational") return std::make_unique<Variational>(model, options);
  if (name == "semi-implicit-euler" || name == "rk4") {
    if (options.solver_given)
      throw Error(ErrorCode::usage, fmt::format("integrator '{}' is explicit and takes no solver", name));
    options.max_halvings = 0;
    if (name == "rk4") return std::make_unique<Rk4>(model, options);
    return std::make_unique<SemiImplicitEuler>(model, options);
  }
  const auto near = nearest_name(name, integrator_names());
  throw Error(ErrorCode::usage, fmt::format("integrator '{}' is not known, expected one of {}{}", name,
                                            fmt::join(integrator_names(), ", "),
                                            near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
}

}  // namespace hamelin::integration
