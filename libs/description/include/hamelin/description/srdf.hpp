#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace hamelin::description {

/// <disable_collisions link1 link2 reason>: two links that never count as colliding.
struct DisabledPair {
  std::string link_a, link_b;
  std::string reason;  ///< as the file gives it ("Adjacent", "Never", ...); may be empty
  int line = 0;
};

/// The pairs that an SRDF (the semantic file beside a URDF, as MoveIt's setup assistant writes it) switches off, in its
/// order. Groups, states and all else in it are passed over.
/// @throws Error io, parse or invalid: "file: line N: what is wrong, what was expected"; also for
/// <disable_default_collisions>, which means another list than the pairs in the file
[[nodiscard]] std::vector<DisabledPair> read_srdf(const std::filesystem::path& file);

/// The same for links of a known robot.
/// @param links all names it has
/// @throws Error invalid, with the nearest name, for a link that is not among them
[[nodiscard]] std::vector<DisabledPair> read_srdf(const std::filesystem::path& file,
                                                  const std::vector<std::string>& links);

}  // namespace hamelin::description
