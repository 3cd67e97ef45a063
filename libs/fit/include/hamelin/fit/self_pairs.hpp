#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/fit/robot_fit.hpp"
#include "hamelin/fit/self_check.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::fit {

/// Pairs of links that are not checked for collision.
struct SelfPairs {
  std::vector<description::DisabledPair> pairs;  ///< with reasons, in the file's order of links
  std::vector<std::string> notes;
  /// The names of the links alone, as sidecar_json() takes them.
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> names() const;
};

/// The pairs that the sidecar of a URDF should list as disabled, by the rules of MoveIt's setup
/// assistant:
/// - "Adjacent": links with shapes that a joint connects, also across links without shapes;
/// - "Always": in contact in at least 95 % of random configurations within the limits (check_self);
/// - "Default": in contact at rest, where each joint is at 0, or in the middle of limits without 0.
/// If these pairs were checked, shapes that stick out over a joint would end each run at its start.
/// @param sidecar the shapes, as sidecar_json writes them
/// @param tip the robot's tip; none: the chain to each leaf is sampled, and a pair counts as Always
/// or Default only if it does so in each chain that moves it. If the file gives no robot for a
/// chain, a note says why.
/// @throws Error io, parse or invalid, as read_urdf_geometry and read_robot do
[[nodiscard]] SelfPairs pairs_to_disable(const std::filesystem::path& urdf, const Json& sidecar,
                                         const std::optional<std::string>& tip,
                                         const SelfCheckOptions& options);

/// The pairs that the sidecar of a fit lists: those of an SRDF with the reason "SRDF", then those
/// of pairs_to_disable(), each once. @param srdf none: only the latter
/// @throws Error as pairs_to_disable() and read_srdf() do
[[nodiscard]] SelfPairs sidecar_pairs(const std::filesystem::path& urdf, const RobotFit& fit,
                                      const std::optional<std::filesystem::path>& srdf,
                                      const std::optional<std::string>& tip,
                                      const SelfCheckOptions& options);

}  // namespace hamelin::fit
