#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace hamelin::description {

/// `<disable_collisions link1 link2 reason>`: two links that never count as colliding.
struct DisabledPair {
  std::string link_a, link_b;
  std::string reason;  ///< as the file gives it ("Adjacent", "Never", ...); may be empty
  int line = 0;
};

/// The pairs that an SRDF disables, in the file's order. An SRDF is the semantic description that
/// accompanies a URDF, as written by MoveIt's setup assistant. Its groups, states and other
/// elements are skipped.
/// @throws Error io, parse or invalid: "file: line N: what is wrong, what was expected"; also for
/// `<disable_default_collisions>`, which disables pairs that the file does not list
[[nodiscard]] std::vector<DisabledPair> read_srdf(const std::filesystem::path& file);

/// As above, and checks that the links exist.
/// @param links names of all links of the robot
/// @throws Error invalid, with the nearest name, for a link that is not among them
[[nodiscard]] std::vector<DisabledPair> read_srdf(const std::filesystem::path& file,
                                                  const std::vector<std::string>& links);

}  // namespace hamelin::description
