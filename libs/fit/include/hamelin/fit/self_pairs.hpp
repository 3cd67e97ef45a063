#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/fit/self_check.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::fit {

/// Pairs of links that never count as colliding.
struct SelfPairs {
  std::vector<description::DisabledPair> pairs;  ///< with their reasons, in the file's order of links
  std::vector<std::string> notes;
};

/// The pairs that a sidecar of a .urdf should list as disabled, by the rules of MoveIt's setup assistant:
/// - "Adjacent": links with shapes that a joint connects, also across links without shapes;
/// - "Always": in contact in at least 95 % of random configurations within the limits (check_self);
/// - "Default": in contact at rest, where all joints are at 0 or in the middle of limits without 0.
/// Without these, what bulges over a joint would end each run at its start.
/// @param sidecar the shapes, as sidecar_json makes them
/// @param tip the robot's tip; none: each leaf in turn, and a pair counts as Always or Default only if it does so on
/// the way to each leaf that moves it. Where the file makes no robot on the way to a leaf, a note says why.
/// @throws Error io, parse or invalid, as read_urdf_geometry and read_robot do
[[nodiscard]] SelfPairs pairs_to_disable(const std::filesystem::path& urdf, const Json& sidecar,
                                         const std::optional<std::string>& tip, const SelfCheckOptions& options);

}  // namespace hamelin::fit
