#include "urdf_tree.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "detail.hpp"

namespace hamelin::description::detail {

namespace {

class Builder {
 public:
  Builder(const UrdfFile& file, const std::string& where) : file_(file), where_(where) {}

  UrdfTree build(const std::optional<std::string>& tip) {
    for (const UrdfLink& link : file_.links) links_.emplace(link.name(), &link);
    for (const UrdfJoint& joint : file_.joints) tree_.joint.emplace(joint.child, &joint);
    place_links();
    choose_tip(tip);
    find_path();
    collect_bodies();
    note_bodies();
    return std::move(tree_);
  }

 private:
  [[noreturn]] void fail_at(const UrdfJoint& joint, const std::string& message) const {
    fail(ErrorCode::invalid, where_, joint.line,
         fmt::format("joint '{}': {}", joint.name, message));
  }
  [[nodiscard]] const UrdfJoint* joint_of(const UrdfLink* link) const {
    const auto at = tree_.joint.find(link->name());
    return at == tree_.joint.end() ? nullptr : at->second;
  }

  // Breadth-first order from the root, children sorted by the names of their joints. It does not
  // depend on the order in the file.
  void place_links() {
    std::map<std::string, std::map<std::string, const UrdfJoint*>> children;
    for (const UrdfJoint& joint : file_.joints) children[joint.parent].emplace(joint.name, &joint);
    tree_.order.push_back(links_.at(file_.root));
    tree_.poses[file_.root] = {};
    for (std::size_t i = 0; i < tree_.order.size(); ++i) {
      const std::string& parent = tree_.order[i]->name();
      if (children.count(parent) == 0) leaves_.push_back(parent);
      for (const auto& [name, joint] : children[parent]) {
        tree_.poses[joint->child] = tree_.poses.at(parent) * joint->origin;
        tree_.order.push_back(links_.at(joint->child));
      }
    }
  }

  void choose_tip(const std::optional<std::string>& tip) {
    if (!tip && leaves_.size() != 1)
      fail(ErrorCode::invalid, where_, 0,
           fmt::format("several leaves, name one as the tip (--tip, or /robot/tip of a scene): {}",
                       join(leaves_)));
    const auto at = links_.find(tip.value_or(leaves_.front()));
    if (at == links_.end()) {
      std::vector<std::string> names;
      for (const UrdfLink* link : tree_.order) names.push_back(link->name());
      fail(ErrorCode::invalid, where_, 0,
           fmt::format("no link '{}' for the tip{}; leaves are: {}", *tip,
                       did_you_mean(*tip, names), join(leaves_)));
    }
    tree_.tip = at->second;
  }

  void find_path() {
    for (const UrdfLink* link = tree_.tip; joint_of(link) != nullptr;
         link = links_.at(joint_of(link)->parent))
      if (joint_of(link)->type != UrdfJoint::Type::fixed) path_.push_back(link);
    std::reverse(path_.begin(), path_.end());
    if (path_.empty())
      fail(ErrorCode::invalid, where_, 0,
           fmt::format("no joint moves between '{}' and the tip '{}', expected at least one",
                       file_.root, tree_.tip->name()));
    for (const UrdfLink* link : path_) {
      const UrdfJoint& joint = *joint_of(link);
      if (joint.type == UrdfJoint::Type::floating || joint.type == UrdfJoint::Type::planar)
        fail_at(joint,
                fmt::format("its type is {}, expected revolute, continuous, prismatic or fixed",
                            to_string(joint.type)));
      if (joint.mimics)
        fail_at(joint,
                fmt::format("it mimics '{}', expected no <mimic> between the base and the tip",
                            *joint.mimics));
    }
  }

  void collect_bodies() {
    for (const UrdfLink* link : path_) {
      tree_.body_of[link->name()] = static_cast<int>(tree_.bodies.size());
      tree_.bodies.push_back({link, {link}});
    }
    for (const UrdfLink* link : tree_.order) {
      if (tree_.body_of.count(link->name()) != 0) continue;
      const UrdfJoint* joint = joint_of(link);
      const int body = joint == nullptr ? -1 : tree_.body_of.at(joint->parent);
      tree_.body_of[link->name()] = body;
      if (body < 0) {
        base_links_.push_back(link->name());
      } else {
        tree_.bodies[static_cast<std::size_t>(body)].members.push_back(link);
      }
      if (joint == nullptr) continue;
      if (joint->type != UrdfJoint::Type::fixed) locked_.push_back(describe_locked(*joint));
      if (joint->mimics)
        tree_.notes.push_back(
            fmt::format("joint '{}': <mimic> ignored, since the joint does not move", joint->name));
    }
  }

  static std::string describe_locked(const UrdfJoint& joint) {
    const bool outside = joint.limits && joint.limits->has_position &&
                         joint.type != UrdfJoint::Type::continuous &&
                         (joint.limits->lower > 0.0 || joint.limits->upper < 0.0);
    return fmt::format("{} ({}{})", joint.name, to_string(joint.type),
                       outside ? ", though 0 is outside its limits" : "");
  }

  void note_bodies() {
    tree_.notes.push_back(
        fmt::format("base: {} (does not move; its mass is not used)", join(base_links_)));
    if (!locked_.empty())
      tree_.notes.push_back(fmt::format("not on the path to the tip '{}', locked at 0: {}",
                                        tree_.tip->name(), join(locked_)));
    for (const UrdfBody& body : tree_.bodies) {
      if (body.members.size() == 1) continue;
      std::vector<std::string> names;
      for (std::size_t k = 1; k < body.members.size(); ++k)
        names.push_back(body.members[k]->name());
      tree_.notes.push_back(
          fmt::format("lumped into link '{}': {}", body.own->name(), join(names)));
    }
  }

  const UrdfFile& file_;
  const std::string& where_;
  UrdfTree tree_;
  std::map<std::string, const UrdfLink*> links_;
  std::vector<std::string> leaves_, base_links_, locked_;
  std::vector<const UrdfLink*> path_;  // child links of the moving joints, from base to tip
};

}  // namespace

UrdfTree make_tree(const UrdfFile& file, const std::string& where,
                   const std::optional<std::string>& tip) {
  return Builder(file, where).build(tip);
}

}  // namespace hamelin::description::detail
