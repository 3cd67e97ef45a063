#pragma once
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "urdf_file.hpp"

/// Which links of a URDF move with which joint on the way to a tip.
namespace hamelin::description::detail {

/// One moving link, and all that is fixed to it or carried by joints that are locked at 0.
struct UrdfBody {
  const UrdfLink* own = nullptr;
  std::vector<const UrdfLink*> members;  ///< `own` first
};

struct UrdfTree {
  const UrdfLink* tip = nullptr;
  std::vector<const UrdfLink*> order;             ///< all links, parents first
  std::map<std::string, geometry::SE3> poses;     ///< link frames in the base frame at q = 0
  std::map<std::string, const UrdfJoint*> joint;  ///< the joint that carries a link
  std::vector<UrdfBody> bodies;                   ///< from the base to the tip
  std::map<std::string, int> body_of;             ///< index into `bodies` by link; −1: the base
  std::vector<std::string> notes;                 ///< what was locked, lumped or ignored
};

/// @param file must outlive the tree
/// @param where the file's name, for messages
/// @param tip name of a link; none: the only leaf
/// @throws Error invalid for a tip that is not there or not clear, and for joints on the way that this library cannot
/// move
[[nodiscard]] UrdfTree make_tree(const UrdfFile& file, const std::string& where, const std::optional<std::string>& tip);

}  // namespace hamelin::description::detail
