#pragma once
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "urdf_file.hpp"

/// Finds which links of a URDF move with which joint between the base and a tip.
namespace hamelin::description::detail {

/// One moving link, and the links that are attached to it by fixed joints or by joints locked at 0.
struct UrdfBody {
  const UrdfLink* own = nullptr;
  std::vector<const UrdfLink*> members;  ///< `own` first
};

struct UrdfTree {
  const UrdfLink* tip = nullptr;
  std::vector<const UrdfLink*> order;             ///< all links, parents first
  std::map<std::string, geometry::SE3> poses;     ///< link frames in the base frame at q = 0
  std::map<std::string, const UrdfJoint*> joint;  ///< by child link, the joint that moves it
  std::vector<UrdfBody> bodies;                   ///< from the base to the tip
  std::map<std::string, int> body_of;             ///< index into `bodies` by link; −1: the base
  std::vector<std::string> notes;                 ///< what was locked, lumped or ignored
};

/// @param file must outlive the tree
/// @param where the file's name, for messages
/// @param tip name of a link; by default the only leaf
/// @throws Error invalid for a tip that does not exist or is ambiguous, and for unsupported types
/// of joints between the base and the tip
[[nodiscard]] UrdfTree make_tree(const UrdfFile& file, const std::string& where,
                                 const std::optional<std::string>& tip);

}  // namespace hamelin::description::detail
