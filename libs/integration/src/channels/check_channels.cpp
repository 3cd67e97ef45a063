#include "check_channels.hpp"

#include <cmath>

#include "finite.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::integration {

void check_size(const char* function, const char* argument, const Model& model,
                Eigen::Index given) {
  if (given != model.dof()) [[unlikely]]
    throw Error(ErrorCode::usage,
                formatted("{}: {}: {} numbers given, expected {} (one per joint of '{}')", function,
                          argument, given, model.dof(), model.robot().name));
}

void check_finite(const char* function, const char* argument, const ConstVectorRef& x) {
  if (!all_finite(x)) [[unlikely]]
    throw Error(
        ErrorCode::usage,
        formatted("{}: {}: a number is not finite, expected finite numbers", function, argument));
}

void check_channels(const char* function, const Model& model, const Channels& channels) {
  const auto sized = [&](const char* argument, const VectorXd& x) {
    if (x.size() != 0) check_size(function, argument, model, x.size());
  };
  sized("channels.damping", channels.damping);
  sized("channels.coulomb", channels.coulomb);
  sized("channels.held_torque", channels.held_torque);
  // Negative ones would feed energy in. NaN passes: the step then fails.
  const auto dissipates = [&](const char* argument, const VectorXd& x) {
    if ((x.array() < 0.0).any()) [[unlikely]]
      throw Error(ErrorCode::usage,
                  formatted("{}: {}: {} given for a joint, expected numbers of at least 0",
                            function, argument, x.minCoeff()));
  };
  dissipates("channels.damping", channels.damping);
  dissipates("channels.coulomb", channels.coulomb);
  if (channels.coulomb.size() != 0 &&
      !(channels.coulomb_speed > 0.0 && std::isfinite(channels.coulomb_speed))) [[unlikely]]
    throw Error(ErrorCode::usage,
                formatted("{}: channels.coulomb_speed: {} given, expected a positive number",
                          function, channels.coulomb_speed));
  for (const auto& term : channels.gyroscopic)
    if (term.link < 0 || term.link >= model.dof()) [[unlikely]]
      throw Error(
          ErrorCode::usage,
          formatted("{}: channels.gyroscopic: link {} given, expected an index from 0 to {}",
                    function, term.link, model.dof() - 1));
  const auto frames = static_cast<int>(model.frames().size());
  for (const auto& each : channels.wrenches)
    if (each.frame < 0 || each.frame >= frames)
      throw Error(ErrorCode::usage,
                  formatted("{}: channels.wrenches: frame {} given, expected an index from 0 to {}",
                            function, each.frame, frames - 1));
}

}  // namespace hamelin::integration
