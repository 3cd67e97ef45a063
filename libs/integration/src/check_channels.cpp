#include "check_channels.hpp"

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

void check_channels(const char* function, const Model& model, const Channels& channels) {
  const auto sized = [&](const char* argument, const VectorXd& x) {
    if (x.size() != 0) check_size(function, argument, model, x.size());
  };
  sized("channels.damping", channels.damping);
  sized("channels.coulomb", channels.coulomb);
  sized("channels.held_torque", channels.held_torque);
  for (const auto& term : channels.gyroscopic)
    if (term.link < 0 || term.link >= model.dof()) [[unlikely]]
      throw Error(
          ErrorCode::usage,
          formatted("{}: channels.gyroscopic: link {} given, expected an index from 0 to {}",
                    function, term.link, model.dof() - 1));
}

}  // namespace hamelin::integration
