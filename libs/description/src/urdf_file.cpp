#include "urdf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <string_view>

#include "detail.hpp"

namespace hamelin::description::detail {

namespace {

using Eigen::Vector3d;
using tinyxml2::XMLElement;

constexpr std::array<const char*, 6> type_names{"revolute", "continuous", "prismatic",
                                                "fixed",    "floating",   "planar"};

class Reader {
 public:
  Reader(const std::string& where, Visuals visuals) : where_(where), visuals_(visuals) {}

  UrdfFile read(const XMLElement& robot) {
    file_.name = text_of(robot, "name");
    check_robot(robot);
    for (const XMLElement* e = robot.FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      const std::string_view tag = e->Name();
      if (tag == "link") {
        add_link(*e);
      } else if (tag == "joint") {
        add_joint(*e);
      } else if (tag != "material") {
        if (tag.substr(0, 6) == "xacro:")
          refuse(*e, fmt::format("<{}>: the file is xacro source, expected expanded URDF", tag));
        skip(*e);
      }
    }
    if (file_.links.empty()) fail(ErrorCode::invalid, where_, 0, "the robot has no <link>");
    connect();
    return std::move(file_);
  }

 private:
  [[noreturn]] void refuse(const XMLElement& element, const std::string& message) const {
    fail(ErrorCode::parse, where_, element.GetLineNum(), message);
  }

  void skip(const XMLElement& element) { ++file_.skipped[fmt::format("<{}>", element.Name())]; }

  void check_robot(const XMLElement& robot) const {
    if (file_.name.empty()) refuse(robot, "the <robot> has no name");
    const std::string version = text_of(robot, "version");
    if (!version.empty() && version != "1" && version != "1.0")
      refuse(robot, fmt::format("version=\"{}\" of URDF is not supported, expected 1.0", version));
  }

  // The name of a link or joint, which must not occur before.
  std::string new_name(const XMLElement& element, std::map<std::string, int>& lines) const {
    std::string name = text_of(element, "name");
    if (name.empty()) refuse(element, fmt::format("a <{}> has no name", element.Name()));
    const auto [before, is_new] = lines.emplace(name, element.GetLineNum());
    if (!is_new)
      fail(ErrorCode::invalid, where_, element.GetLineNum(),
           fmt::format("{} '{}' is given twice, first in line {}", element.Name(), name,
                       before->second));
    return name;
  }

  void add_link(const XMLElement& element) {
    UrdfLink link;
    link.shapes.name = new_name(element, link_lines_);
    link.shapes.line = element.GetLineNum();
    const Owner owner{where_, fmt::format("link '{}'", link.name())};
    if (const XMLElement* inertial = only_child(element, "inertial", owner); inertial != nullptr)
      link.inertial = inertial_of(*inertial, owner);
    link.shapes.collision = read_shapes(element, "collision", owner);
    if (visuals_ == Visuals::read) link.shapes.visual = read_shapes(element, "visual", owner);
    for (const XMLElement* e = element.FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      const std::string_view tag = e->Name();
      if (tag != "inertial" && tag != "collision") skip(*e);
    }
    for (const LinkShape& shape : link.shapes.collision)
      if (shape.kind != LinkShape::Kind::sphere)
        ++file_.skipped[fmt::format("<collision><{}>", tag_of(shape.kind))];
    file_.links.push_back(std::move(link));
  }

  UrdfInertial inertial_of(const XMLElement& element, const Owner& owner) const {
    UrdfInertial out;
    out.pose = origin_of(element, owner);
    out.mass_kg = number(required_child(element, "mass", owner), "value", owner);
    const XMLElement& inertia = required_child(element, "inertia", owner);
    const auto entry = [&](const char* name) { return number(inertia, name, owner); };
    const double xy = entry("ixy"), xz = entry("ixz"), yz = entry("iyz");
    out.inertia_kg_m2 << entry("ixx"), xy, xz, xy, entry("iyy"), yz, xz, yz, entry("izz");
    return out;
  }

  UrdfJoint::Type type_of(const XMLElement& element, const Owner& owner) const {
    const std::string type = text_of(element, "type");
    const auto at = std::find(type_names.begin(), type_names.end(), type);
    if (at == type_names.end())
      refuse(element, fmt::format("{}: its type is '{}', expected one of {}", owner.name, type,
                                  fmt::join(type_names, ", ")));
    return static_cast<UrdfJoint::Type>(at - type_names.begin());
  }

  void add_joint(const XMLElement& element) {
    UrdfJoint joint;
    joint.name = new_name(element, joint_lines_);
    joint.line = element.GetLineNum();
    const Owner owner{where_, fmt::format("joint '{}'", joint.name)};
    joint.type = type_of(element, owner);
    joint.parent = end_of(element, "parent", owner);
    joint.child = end_of(element, "child", owner);
    joint.origin = origin_of(element, owner);
    if (const XMLElement* axis = only_child(element, "axis", owner); axis != nullptr)
      joint.axis = triple_or(*axis, "xyz", owner, Vector3d::UnitX());
    joint.limits = limits_of(element, joint.type, owner);
    if (const XMLElement* dynamics = only_child(element, "dynamics", owner); dynamics != nullptr) {
      joint.damping = number_or(*dynamics, "damping", owner, 0.0);
      joint.friction = number_or(*dynamics, "friction", owner, 0.0);
    }
    if (const XMLElement* mimic = only_child(element, "mimic", owner); mimic != nullptr)
      joint.mimics = mimicked(*mimic, owner);
    for (const char* tag : {"safety_controller", "calibration"})
      if (const XMLElement* unused = element.FirstChildElement(tag); unused != nullptr)
        skip(*unused);
    file_.joints.push_back(std::move(joint));
  }

  std::string mimicked(const XMLElement& mimic, const Owner& owner) const {
    std::string joint = text_of(mimic, "joint");
    if (joint.empty()) refuse(mimic, fmt::format("{}: <mimic> has no joint", owner.name));
    return joint;
  }

  std::string end_of(const XMLElement& element, const char* tag, const Owner& owner) const {
    const XMLElement* end = only_child(element, tag, owner);
    std::string link = end == nullptr ? "" : text_of(*end, "link");
    if (link.empty()) refuse(element, fmt::format("{} has no <{} link=...>", owner.name, tag));
    return link;
  }

  static std::optional<UrdfLimits> limits_of(const XMLElement& element, UrdfJoint::Type type,
                                             const Owner& owner) {
    const bool required = type == UrdfJoint::Type::revolute || type == UrdfJoint::Type::prismatic;
    const XMLElement* limit =
        required ? &required_child(element, "limit", owner) : only_child(element, "limit", owner);
    if (limit == nullptr) return std::nullopt;
    UrdfLimits out;
    out.has_position = limit->Attribute("lower") != nullptr || limit->Attribute("upper") != nullptr;
    out.lower = number_or(*limit, "lower", owner, 0.0);
    out.upper = number_or(*limit, "upper", owner, 0.0);
    out.effort = number(*limit, "effort", owner);
    out.velocity = number(*limit, "velocity", owner);
    return out;
  }

  // Checks that joints name links of the file, that each link is the child of at most one joint,
  // and that exactly one link is the child of none.
  void connect() {
    std::map<std::string, UrdfLink*> links;
    std::vector<std::string> names;
    for (UrdfLink& link : file_.links) {
      links.emplace(link.name(), &link);
      names.push_back(link.name());
    }
    std::map<std::string, std::string> carrier;  // name of the joint, by child link
    for (const UrdfJoint& joint : file_.joints) {
      for (const auto& [end, link] :
           {std::pair("parent", joint.parent), std::pair("child", joint.child)})
        if (links.count(link) == 0)
          fail(ErrorCode::invalid, where_, joint.line,
               fmt::format("joint '{}': its {} '{}' is not a link of the file{}", joint.name, end,
                           link, did_you_mean(link, names)));
      if (const auto [before, is_new] = carrier.emplace(joint.child, joint.name); !is_new)
        fail(ErrorCode::invalid, where_, joint.line,
             fmt::format("link '{}' is the child of two joints, '{}' and '{}', expected one",
                         joint.child, before->second, joint.name));
      links.at(joint.child)->shapes.parent = joint.parent;
    }
    check_cycles(links);
    for (const UrdfLink& link : file_.links) {
      if (!link.shapes.parent.empty()) continue;
      if (!file_.root.empty())
        fail(
            ErrorCode::invalid, where_, link.shapes.line,
            fmt::format("link '{}': neither it nor '{}' is the child of a joint, expected one root",
                        link.name(), file_.root));
      file_.root = link.name();
    }
  }

  void check_cycles(const std::map<std::string, UrdfLink*>& links) const {
    std::set<std::string> rooted;
    for (const auto& [name, link] : links) {
      std::set<std::string> path;
      for (const UrdfLink* at = link; !at->shapes.parent.empty() && rooted.count(at->name()) == 0;
           at = links.at(at->shapes.parent))
        if (!path.insert(at->name()).second)
          fail(ErrorCode::invalid, where_, link->shapes.line,
               fmt::format(
                   "link '{}': its parents form a cycle of joints, expected a tree with one root",
                   name));
      rooted.merge(path);
    }
  }

  const std::string& where_;
  Visuals visuals_;
  UrdfFile file_;
  std::map<std::string, int> link_lines_, joint_lines_;
};

}  // namespace

const char* to_string(UrdfJoint::Type type) {
  return type_names.at(static_cast<std::size_t>(type));
}

UrdfFile read_urdf_file(const std::string& text, const std::string& where, Visuals visuals) {
  tinyxml2::XMLDocument document;
  return Reader(where, visuals).read(parse_robot_xml(document, text, where, "URDF"));
}

}  // namespace hamelin::description::detail
