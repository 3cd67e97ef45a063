#pragma once
#include <fmt/format.h>

#include <memory>
#include <string>

#include "bound_model.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/integration/step_derivatives.hpp"
#include "hamelin/simulation/integrator_options.hpp"
#include "module.hpp"

namespace hamelin::python {

using integration::Channels;
using integration::State;
using integration::StepReport;
/// What Python sees of them.
using PyChannels = Boxed<Channels>;
using PyState = Boxed<State>;
using PyReport = Boxed<StepReport>;

/// hamelin.Integrator. It holds Python's lock during a step, whose scratch memory it owns.
struct BoundIntegrator : Whole {
  BoundIntegrator(SharedModel given, const std::string& name, const Json& json)
      : model(std::move(given)),
        options(integration::make_options(
            name, simulation::integrator_options(json, fmt::format("Integrator: {}", name)))),
        scheme(integration::make_integrator(model->model, options)) {}

  SharedModel model;
  integration::Options options;
  std::unique_ptr<integration::Integrator> scheme;
  std::unique_ptr<integration::StepDifferentiator> differentiator;  // made when first used
  bool busy = false;  // a call runs without Python's lock, or calls back
};

/// Refuses calls from another thread, or from a callback, while a call uses the integrator.
class Use {
 public:
  explicit Use(BoundIntegrator& integrator) : integrator_(integrator) {
    if (integrator.busy)
      throw Error(ErrorCode::usage,
                  "Integrator: another call uses it, expected one call at a time");
    integrator_.busy = true;
  }
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;
  ~Use() { integrator_.busy = false; }

 private:
  BoundIntegrator& integrator_;
};

inline const Channels& given_or_none(const PyChannels* given) {
  static const Channels none;
  return given != nullptr ? *given : none;
}

}  // namespace hamelin::python
