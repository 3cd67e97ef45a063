#include <console_bridge/console.h>
#include <fmt/format.h>
#include <tinyxml.h>
#include <urdf_model/link.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <mutex>
#include <set>
#include <string_view>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/srdf.hpp"
#include "hamelin/description/urdf_geometry.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::description {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::SE3;

// ---- the text: what urdfdom passes over or says without a place ----

// TinyXML and urdfdom recurse into the tree of elements, urdfdom into the tree of links too.
constexpr int nesting_max = 100, attributes_max = 100;
constexpr std::size_t size_max = std::size_t{4} << 20;

// One line, whatever the file's names and values hold.
[[noreturn]] void fail(ErrorCode code, const std::string& where, std::string what) {
  std::replace_if(
      what.begin(), what.end(), [](unsigned char c) { return c < ' '; }, ' ');
  throw Error(code, fmt::format("{}: {}", where, what));
}

std::string at_line(const std::string& where, int line) {
  return line > 0 ? fmt::format("{}: line {}", where, line) : where;
}

// Where TinyXML would see other elements than we do, or take a time that grows with the square of the file: one rule
// for both, that only markup passes which has one meaning.
void check_text(std::string_view text, const std::string& where) {
  if (text.size() > size_max)
    fail(ErrorCode::parse, where,
         fmt::format("the file has {} bytes, expected a URDF of at most {}", text.size(), size_max));
  if (text.find_first_not_of(" \t\r\n") == std::string_view::npos)
    fail(ErrorCode::parse, where, "the file is empty, expected a <robot>");
  if (text.find('\0') != std::string_view::npos)
    fail(ErrorCode::parse, where, "the file is not text, expected URDF (XML)");
  if (const auto good = utf8_prefix(text); good != text.size())
    fail(ErrorCode::parse, where, fmt::format("byte {} is not UTF-8, expected URDF (XML) in UTF-8", good));
  int depth = 0;
  std::size_t at = 0;
  const auto refuse = [&](const std::string& what) {
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    fail(ErrorCode::parse, at_line(where, static_cast<int>(line)), what);
  };
  const auto skip_past = [&](std::string_view end) {
    const auto found = text.find(end, at);
    at = found == std::string_view::npos ? text.size() : found + end.size();
  };
  // Past the tag's '>', which may stand in an attribute's value as well.
  const auto skip_tag = [&] {
    int attributes = 0;
    for (++at; at < text.size() && text[at] != '>'; ++at) {
      const char c = text[at];
      if (c == '<') refuse("not XML: '<' inside a tag");
      if (c == '=' && ++attributes > attributes_max)
        refuse(fmt::format("a tag has more than {} attributes", attributes_max));
      if (c == '"' || c == '\'') at = std::min(text.find(c, at + 1), text.size() - 1);
    }
    at = std::min(at + 1, text.size());
  };
  while ((at = text.find('<', at)) != std::string_view::npos) {
    const std::string_view tag = text.substr(at, 9);
    if (tag.substr(0, 4) == "<!--") {
      skip_past("-->");
    } else if (tag == "<![CDATA[") {
      skip_past("]]>");
    } else if (tag.substr(0, 2) == "<!") {
      skip_past(">");
    } else if (tag.substr(0, 2) == "<?") {
      const std::size_t begin = at;
      skip_past(">");
      const std::string_view declaration = text.substr(begin, at - begin);
      for (const char quote : {'"', '\''})
        if (std::count(declaration.begin(), declaration.end(), quote) % 2 != 0)
          refuse("not XML: a quote in <? ?> is not closed");
    } else {
      const bool closing = tag.substr(0, 2) == "</";
      skip_tag();
      const bool empty = at >= 2 && text[at - 2] == '/';
      if (closing) depth = std::max(0, depth - 1);
      if (!closing && !empty && ++depth > nesting_max) refuse(fmt::format("elements nest deeper than {}", nesting_max));
    }
  }
}

std::string text_of(const char* attribute) {
  return attribute == nullptr ? "" : attribute;
}

bool is_number(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc{} && end == word.data() + word.size() && std::isfinite(value);
}

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  constexpr std::string_view blank = " \t\r\n";
  std::size_t at = 0;
  while ((at = text.find_first_not_of(blank, at)) != std::string_view::npos) {
    const auto end = std::min(text.find_first_of(blank, at), text.size());
    words.push_back(text.substr(at, end - at));
    at = end;
  }
  return words;
}

// Numbers each attribute must hold, by its name.
int numbers_in(std::string_view attribute) {
  constexpr std::array<std::string_view, 3> triples{"xyz", "rpy", "size"};
  constexpr std::array<std::string_view, 20> singles{"ixx",    "ixy",      "ixz",        "iyy",        "iyz",
                                                     "izz",    "radius",   "length",     "lower",      "upper",
                                                     "effort", "velocity", "offset",     "damping",    "friction",
                                                     "rising", "falling",  "k_position", "k_velocity", "multiplier"};
  if (std::find(triples.begin(), triples.end(), attribute) != triples.end()) return 3;
  return std::find(singles.begin(), singles.end(), attribute) != singles.end() ? 1 : 0;
}

void check_numbers(const TiXmlElement& element, const std::string& where, const std::string& owner) {
  for (const TiXmlAttribute* a = element.FirstAttribute(); a != nullptr; a = a->Next()) {
    const bool mass = element.ValueStr() == "mass" && a->NameTStr() == "value";
    const int count = mass ? 1 : numbers_in(a->NameTStr());
    if (count == 0) continue;
    // urdfdom takes blanks around the numbers of a list, not around a single one.
    const auto words = count == 1 ? std::vector<std::string_view>{a->ValueStr()} : words_of(a->ValueStr());
    const bool good = static_cast<int>(words.size()) == count && std::all_of(words.begin(), words.end(), is_number);
    if (!good)
      fail(ErrorCode::parse, at_line(where, element.Row()),
           fmt::format("{}: <{}>: {}=\"{}\", expected {}", owner, element.ValueStr(), a->NameTStr(), a->ValueStr(),
                       count == 1 ? "a finite number" : "three finite numbers"));
  }
  for (const TiXmlElement* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
    check_numbers(*e, where, owner);
}

struct Outline {
  std::map<std::string, int> link_lines, joint_lines;
  std::map<std::string, int> skipped;  // element by element, how often
  std::set<std::string> limits_given;  // joints whose <limit> names lower or upper
};

void check_once(const TiXmlElement& element, const std::string& where, const std::string& owner,
                std::initializer_list<const char*> tags) {
  for (const char* tag : tags) {
    const TiXmlElement* first = element.FirstChildElement(tag);
    if (first != nullptr && first->NextSiblingElement(tag) != nullptr)
      fail(ErrorCode::parse, at_line(where, first->NextSiblingElement(tag)->Row()),
           fmt::format("{}: <{}> is given twice, expected once", owner, tag));
  }
}

void check_attributes(const TiXmlElement& parent, const char* tag, std::initializer_list<const char*> attributes,
                      const std::string& where, const std::string& owner) {
  const TiXmlElement* element = parent.FirstChildElement(tag);
  if (element == nullptr)
    fail(ErrorCode::parse, at_line(where, parent.Row()), fmt::format("{}: <{}> is missing", owner, tag));
  for (const char* attribute : attributes)
    if (element->Attribute(attribute) == nullptr)
      fail(ErrorCode::parse, at_line(where, element->Row()), fmt::format("{}: <{}> has no {}", owner, tag, attribute));
}

void outline_link(const TiXmlElement& element, const std::string& where, Outline& outline) {
  const std::string name = text_of(element.Attribute("name")), place = at_line(where, element.Row());
  if (name.empty()) fail(ErrorCode::parse, place, "a <link> has no name");
  const std::string owner = fmt::format("link '{}'", name);
  const auto [before, is_new] = outline.link_lines.emplace(name, element.Row());
  if (!is_new)
    fail(ErrorCode::invalid, place, fmt::format("{} is given twice, first in line {}", owner, before->second));
  check_once(element, where, owner, {"inertial"});
  if (const TiXmlElement* inertial = element.FirstChildElement("inertial"); inertial != nullptr) {
    check_once(*inertial, where, owner, {"origin", "mass", "inertia"});
    check_attributes(*inertial, "mass", {"value"}, where, owner);
    check_attributes(*inertial, "inertia", {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}, where, owner);
    check_numbers(*inertial, where, owner);
  }
  for (const TiXmlElement* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    const std::string tag = e->ValueStr();
    if (tag == "inertial") continue;
    if (tag != "collision") {
      ++outline.skipped[fmt::format("<{}>", tag)];
      continue;
    }
    check_once(*e, where, owner, {"origin", "geometry"});
    check_numbers(*e, where, owner);
    const TiXmlElement* geometry = e->FirstChildElement("geometry");
    const TiXmlElement* shape = geometry == nullptr ? nullptr : geometry->FirstChildElement();
    if (shape != nullptr && shape->ValueStr() != "sphere")
      ++outline.skipped[fmt::format("<collision><{}>", shape->ValueStr())];
  }
}

void outline_joint(const TiXmlElement& element, const std::string& where, Outline& outline) {
  const std::string name = text_of(element.Attribute("name")), place = at_line(where, element.Row());
  if (name.empty()) fail(ErrorCode::parse, place, "a <joint> has no name");
  const std::string owner = fmt::format("joint '{}'", name);
  const auto [before, is_new] = outline.joint_lines.emplace(name, element.Row());
  if (!is_new)
    fail(ErrorCode::invalid, place, fmt::format("{} is given twice, first in line {}", owner, before->second));
  check_once(element, where, owner, {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic"});
  check_numbers(element, where, owner);
  constexpr std::array<std::string_view, 6> types{"revolute", "continuous", "prismatic", "fixed", "floating", "planar"};
  const std::string type = text_of(element.Attribute("type"));
  if (std::find(types.begin(), types.end(), type) == types.end())
    fail(ErrorCode::parse, place,
         fmt::format("{}: its type is '{}', expected one of {}", owner, type, fmt::join(types, ", ")));
  const TiXmlElement* limit = element.FirstChildElement("limit");
  if (limit != nullptr || type == "revolute" || type == "prismatic")
    check_attributes(element, "limit", {"effort", "velocity"}, where, owner);
  if (limit != nullptr && (limit->Attribute("lower") != nullptr || limit->Attribute("upper") != nullptr))
    outline.limits_given.insert(name);
  for (const char* tag : {"safety_controller", "calibration"})
    if (element.FirstChildElement(tag) != nullptr) ++outline.skipped[fmt::format("<{}>", tag)];
}

// Every link is some joint's child at most once, all names exist, and no links carry each other in a circle (urdfdom
// never gives those back).
void check_edges(const TiXmlElement& robot, const std::string& where, const Outline& outline) {
  std::vector<std::string> names;
  for (const auto& [name, line] : outline.link_lines) names.push_back(name);
  std::map<std::string, std::string> carrier, parent_of;
  for (const TiXmlElement* e = robot.FirstChildElement("joint"); e != nullptr; e = e->NextSiblingElement("joint")) {
    const std::string joint = e->Attribute("name"), place = at_line(where, e->Row());
    for (const char* end : {"parent", "child"}) {
      const TiXmlElement* tag = e->FirstChildElement(end);
      const std::string link = tag == nullptr ? "" : text_of(tag->Attribute("link"));
      if (link.empty()) fail(ErrorCode::parse, place, fmt::format("joint '{}' has no <{} link=...>", joint, end));
      if (outline.link_lines.count(link) == 0)
        fail(ErrorCode::invalid, place,
             fmt::format("joint '{}': its {} '{}' is no link of the file{}", joint, end, link,
                         did_you_mean(link, names)));
      if (std::string_view(end) == "child") {
        const auto [before, is_new] = carrier.emplace(link, joint);
        if (!is_new)
          fail(ErrorCode::invalid, place,
               fmt::format("link '{}' is the child of two joints, '{}' and '{}', expected one", link, before->second,
                           joint));
        parent_of.emplace(link, e->FirstChildElement("parent")->Attribute("link"));
      }
    }
  }
  std::set<std::string> rooted;
  for (const auto& [name, line] : outline.link_lines) {
    std::set<std::string> way;
    for (auto at = parent_of.find(name); at != parent_of.end() && rooted.count(at->first) == 0;
         at = parent_of.find(at->second))
      if (!way.insert(at->first).second)
        fail(ErrorCode::invalid, at_line(where, line),
             fmt::format("link '{}': it hangs in a cycle of joints, expected a tree from one root", name));
    rooted.merge(way);
  }
}

Outline read_outline(const std::string& text, const std::string& where) {
  TiXmlDocument document;
  document.Parse(text.c_str());
  if (document.Error())
    fail(
        ErrorCode::parse, where,
        fmt::format("line {}, column {}: not XML: {}", document.ErrorRow(), document.ErrorCol(), document.ErrorDesc()));
  const TiXmlElement* robot = document.RootElement();
  if (robot == nullptr || robot->ValueStr() != "robot")
    fail(ErrorCode::parse, at_line(where, robot == nullptr ? 1 : robot->Row()),
         fmt::format("expected <robot> as the root, found {}",
                     robot == nullptr ? "no element" : "<" + robot->ValueStr() + ">"));
  Outline outline;
  for (const TiXmlElement* e = robot->FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    const std::string tag = e->ValueStr();
    if (tag == "link") {
      outline_link(*e, where, outline);
    } else if (tag == "joint") {
      outline_joint(*e, where, outline);
    } else if (tag != "material") {
      if (tag.substr(0, 6) == "xacro:")
        fail(ErrorCode::parse, at_line(where, e->Row()),
             fmt::format("<{}>: the file is xacro source, expected expanded URDF", tag));
      ++outline.skipped[fmt::format("<{}>", tag)];
    }
  }
  if (outline.link_lines.empty()) fail(ErrorCode::invalid, where, "the robot has no <link>");
  check_edges(*robot, where, outline);
  return outline;
}

// ---- urdfdom ----

// Takes urdfdom's complaints instead of stderr.
class Listener : public console_bridge::OutputHandler {
 public:
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) errors.push_back(text);
  }
  std::vector<std::string> errors;
};

urdf::ModelInterfaceSharedPtr parse(const std::string& text, const std::string& where, const Outline& outline) {
  static std::mutex one_at_a_time;  // console_bridge has one handler a process
  Listener listener;
  urdf::ModelInterfaceSharedPtr model;
  {
    const std::lock_guard lock(one_at_a_time);
    const auto level = console_bridge::getLogLevel();
    auto* const handler = console_bridge::getOutputHandler();
    console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_ERROR);
    console_bridge::useOutputHandler(&listener);
    try {
      model = urdf::parseURDF(text);
    } catch (const std::exception& e) {
      listener.errors.emplace_back(e.what());
    }
    console_bridge::useOutputHandler(handler);
    console_bridge::setLogLevel(level);
  }
  if (model && listener.errors.empty()) return model;
  std::string reason = listener.errors.empty() ? "not a URDF robot" : listener.errors.front();
  if (listener.errors.size() > 1) reason += fmt::format(" ({})", listener.errors.back());
  // urdfdom names the element in brackets or quotes; the longest name found says where.
  int line = 0;
  std::size_t longest = 0;
  for (const auto* lines : {&outline.joint_lines, &outline.link_lines})
    for (const auto& [name, row] : *lines)
      for (const auto* marks : {"[]", "''", "\"\""})
        if (name.size() > longest && reason.find(marks[0] + name + marks[1]) != std::string::npos) {
          longest = name.size();
          line = row;
        }
  fail(ErrorCode::parse, at_line(where, line), reason);
}

SE3 pose_of(const urdf::Pose& pose) {
  const urdf::Rotation& q = pose.rotation;
  return {Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix(),
          {pose.position.x, pose.position.y, pose.position.z}};
}

const char* type_name(const urdf::Joint& joint) {
  switch (joint.type) {
    case urdf::Joint::REVOLUTE:
      return "revolute";
    case urdf::Joint::CONTINUOUS:
      return "continuous";
    case urdf::Joint::PRISMATIC:
      return "prismatic";
    case urdf::Joint::FLOATING:
      return "floating";
    case urdf::Joint::PLANAR:
      return "planar";
    case urdf::Joint::FIXED:
      return "fixed";
    default:
      return "unknown";
  }
}

// ---- one moving link: its own URDF link and all that is fixed or locked to it ----

struct Body {
  const urdf::Link* own = nullptr;
  std::vector<const urdf::Link*> members;  // own first
};

class Reader {
 public:
  Reader(const urdf::ModelInterface& model, const std::string& where, const Outline& outline,
         const RobotOptions& options)
      : model_(model), where_(where), outline_(outline), options_(options) {}

  Robot read() {
    robot_.name = model_.getName();
    place_links();
    find_path();
    collect_bodies();
    take_spheres();
    for (std::size_t i = 0; i < bodies_.size(); ++i) robot_.links.push_back(moving_link(i));
    keep_base_shapes();
    robot_.tip = {tip_->name, static_cast<int>(bodies_.size()) - 1, poses_.at(tip_->name)};
    disable_pairs();
    note_the_rest();
    detail::round_to_quaternions(robot_);
    check(robot_, where_);
    return std::move(robot_);
  }

 private:
  [[noreturn]] void fail_at_link(const std::string& link, const std::string& what) const {
    fail(ErrorCode::invalid, at_line(where_, outline_.link_lines.at(link)), fmt::format("link '{}': {}", link, what));
  }
  [[noreturn]] void fail_at_joint(const urdf::Joint& joint, const std::string& what) const {
    fail(ErrorCode::invalid, at_line(where_, outline_.joint_lines.at(joint.name)),
         fmt::format("joint '{}': {}", joint.name, what));
  }
  template <class... Args>
  void note(const char* format, const Args&... args) {
    robot_.notes.push_back(fmt::format(fmt::runtime(format), args...));
  }

  // Breadth first from the root: poses at q = 0, and an order in which parents come first.
  void place_links() {
    order_.push_back(model_.getRoot().get());
    poses_[order_.front()->name] = SE3();
    for (std::size_t i = 0; i < order_.size(); ++i) {
      const urdf::Link* link = order_[i];
      for (const auto& joint : link->child_joints) {
        const urdf::Link* child = model_.getLink(joint->child_link_name).get();
        poses_[child->name] = poses_.at(link->name) * pose_of(joint->parent_to_joint_origin_transform);
        order_.push_back(child);
      }
    }
  }

  void find_path() {
    std::vector<std::string> leaves, names;
    for (const urdf::Link* link : order_) {
      names.push_back(link->name);
      if (link->child_joints.empty()) leaves.push_back(link->name);
    }
    if (options_.tip) {
      tip_ = model_.getLink(*options_.tip).get();
      if (tip_ == nullptr)
        fail(ErrorCode::invalid, where_,
             fmt::format("no link '{}' for the tip{}; leaves are: {}", *options_.tip,
                         did_you_mean(*options_.tip, names), detail::join(leaves)));
    } else {
      if (leaves.size() != 1)
        fail(ErrorCode::invalid, where_, fmt::format("several leaves, name one as the tip: {}", detail::join(leaves)));
      tip_ = model_.getLink(leaves.front()).get();
    }
    for (const urdf::Link* link = tip_; link->parent_joint; link = link->getParent().get())
      if (link->parent_joint->type != urdf::Joint::FIXED) path_.push_back(link);
    std::reverse(path_.begin(), path_.end());
    if (path_.empty())
      fail(ErrorCode::invalid, where_,
           fmt::format("no joint moves between '{}' and the tip '{}', expected at least one", order_.front()->name,
                       tip_->name));
    for (const urdf::Link* link : path_) {
      const urdf::Joint& joint = *link->parent_joint;
      if (joint.type != urdf::Joint::REVOLUTE && joint.type != urdf::Joint::CONTINUOUS &&
          joint.type != urdf::Joint::PRISMATIC)
        fail_at_joint(
            joint, fmt::format("its type is {}, expected revolute, continuous, prismatic or fixed", type_name(joint)));
      if (joint.mimic)
        fail_at_joint(joint, fmt::format("it moves and mimics '{}', expected joints that move by themselves",
                                         joint.mimic->joint_name));
    }
  }

  void collect_bodies() {
    for (const urdf::Link* link : path_) {
      body_of_[link->name] = static_cast<int>(bodies_.size());
      bodies_.push_back({link, {link}});
    }
    std::vector<std::string> still, locked;
    for (const urdf::Link* link : order_) {
      if (body_of_.count(link->name) != 0) continue;
      const int body = link->parent_joint ? body_of_.at(link->getParent()->name) : -1;
      body_of_[link->name] = body;
      if (body < 0) {
        still.push_back(link->name);
      } else {
        bodies_[static_cast<std::size_t>(body)].members.push_back(link);
      }
      if (!link->parent_joint) continue;
      const urdf::Joint& joint = *link->parent_joint;
      if (joint.type != urdf::Joint::FIXED) {
        const bool outside = joint.limits && outline_.limits_given.count(joint.name) != 0 &&
                             joint.type != urdf::Joint::CONTINUOUS &&
                             (joint.limits->lower > 0.0 || joint.limits->upper < 0.0);
        locked.push_back(
            fmt::format("{} ({}{})", joint.name, type_name(joint), outside ? ", though 0 is outside its limits" : ""));
      }
      if (joint.mimic) note("joint '{}': <mimic> ignored, it does not move", joint.name);
    }
    note("base: {} (does not move; its mass is left out)", detail::join(still));
    if (!locked.empty()) note("not on the way to the tip '{}', locked at 0: {}", tip_->name, detail::join(locked));
    for (const Body& body : bodies_) {
      if (body.members.size() == 1) continue;
      std::vector<std::string> names;
      for (std::size_t k = 1; k < body.members.size(); ++k) names.push_back(body.members[k]->name);
      note("lumped into link '{}': {}", body.own->name, detail::join(names));
    }
  }

  // Spheres by URDF link, in that link's frame.
  void take_spheres() {
    std::size_t own = 0;
    for (const urdf::Link* link : order_)
      for (const auto& collision : link->collision_array)
        if (collision->geometry && collision->geometry->type == urdf::Geometry::SPHERE) {
          const auto& sphere = static_cast<const urdf::Sphere&>(*collision->geometry);
          if (!(sphere.radius > 0.0))
            fail_at_link(link->name,
                         fmt::format("a collision sphere has radius {} m, expected a positive number", sphere.radius));
          spheres_.links[link->name].push_back({pose_of(collision->origin).p(), sphere.radius});
          ++own;
        }
    if (options_.spheres) {
      spheres_ = detail::read_spheres(*options_.spheres);
      if (own > 0)
        note("the file's own {} collision spheres are replaced by those of {}", own,
             options_.spheres->filename().string());
      for (const auto& [name, list] : spheres_.links) require_link(name);
      for (const auto& [name, list] : spheres_.capsules) require_link(name);
      for (const auto& [a, b] : spheres_.self_collision_disabled) {
        require_link(a);
        require_link(b);
      }
    }
    take_srdf();
    std::size_t moving = 0;
    const auto count = [&](const auto& by_link, const char* what) {
      std::size_t still = 0;
      for (const auto& [name, list] : by_link) (body_of_.at(name) < 0 ? still : moving) += list.size();
      if (still > 0) note("{} collision {} on the base do not move: only the arm itself can touch them", still, what);
    };
    count(spheres_.links, "spheres");
    count(spheres_.capsules, "capsules");
    if (moving == 0) note("no collision spheres or capsules: the arm meets nothing");
  }

  void take_srdf() {
    if (!options_.srdf) return;
    const std::string said = detail::join_pairs(spheres_.self_collision_disabled,
                                                read_srdf(*options_.srdf, link_names()), options_.srdf->filename());
    robot_.notes.push_back(said);
  }

  [[nodiscard]] std::vector<std::string> link_names() const {
    std::vector<std::string> names;
    for (const urdf::Link* link : order_) names.push_back(link->name);
    return names;
  }

  void require_link(const std::string& name) const {
    const std::vector<std::string> names = link_names();
    if (std::find(names.begin(), names.end(), name) == names.end())
      fail(ErrorCode::invalid, options_.spheres->string(),
           fmt::format("the robot has no link '{}'{}", name, did_you_mean(name, names)));
  }

  struct Inertial {
    SE3 frame;  // COM frame in the base frame
    double mass;
    Matrix3d inertia;  // in that frame
    const urdf::Link* link;
  };

  // The inertial of one URDF link, if it has any mass or inertia.
  std::optional<Inertial> inertial_of(const urdf::Link& link) {
    if (!link.inertial) return std::nullopt;
    const urdf::Inertial& given = *link.inertial;
    Matrix3d I;
    I << given.ixx, given.ixy, given.ixz, given.ixy, given.iyy, given.iyz, given.ixz, given.iyz, given.izz;
    if (!(given.mass >= 0.0)) fail_at_link(link.name, fmt::format("mass {} kg, expected at least 0", given.mass));
    const std::string fault = model::inertia_fault(I, false);
    if (!fault.empty()) fail_at_link(link.name, "inertia " + fault);
    if (given.mass == 0.0 && I.isZero(0.0)) return std::nullopt;
    if (given.mass == 0.0) note("warning: link '{}' has inertia but no mass; the inertia counts", link.name);
    return Inertial{poses_.at(link.name) * pose_of(given.origin), given.mass, I, &link};
  }

  void set_inertia(Link& out, const Body& body) {
    std::vector<Inertial> parts;
    for (const urdf::Link* member : body.members)
      if (auto part = inertial_of(*member)) parts.push_back(*part);
    const SE3& own_frame = poses_.at(body.own->name);
    if (parts.size() == 1 && parts.front().link == body.own) {
      out.com = parts.front().frame;
      out.mass_kg = parts.front().mass;
      out.inertia_kg_m2 = parts.front().inertia;
      return;
    }
    Vector3d moment = Vector3d::Zero();
    for (const Inertial& part : parts) {
      out.mass_kg += part.mass;
      moment += part.mass * part.frame.p();
    }
    const Vector3d center = out.mass_kg > 0.0 ? Vector3d(moment / out.mass_kg) : own_frame.p();
    out.com = SE3(own_frame.R(), center);
    Matrix3d I = Matrix3d::Zero();
    for (const Inertial& part : parts) {
      const SE3 in_com = out.com.inverse() * part.frame;
      const Vector3d& c = in_com.p();
      I += in_com.R() * part.inertia * in_com.R().transpose() +
           part.mass * (c.squaredNorm() * Matrix3d::Identity() - c * c.transpose());
    }
    out.inertia_kg_m2 = 0.5 * (I + I.transpose());
  }

  void set_limits(Joint& out, const urdf::Joint& joint) {
    if (joint.dynamics) {
      out.damping = joint.dynamics->damping;
      out.friction = joint.dynamics->friction;
    }
    if (!joint.limits) return;
    const urdf::JointLimits& limits = *joint.limits;
    if (joint.type != urdf::Joint::CONTINUOUS) {
      if (!(limits.lower < limits.upper))
        fail_at_joint(joint, fmt::format("lower limit {} is not below upper limit {}", limits.lower, limits.upper));
      out.lower = limits.lower;
      out.upper = limits.upper;
    } else if (outline_.limits_given.count(joint.name) != 0) {
      note("joint '{}': continuous, so its position limits are ignored", joint.name);
    }
    const auto bound = [&](const char* what, double value) -> std::optional<double> {
      if (value < 0.0) fail_at_joint(joint, fmt::format("{} limit {}, expected a positive number", what, value));
      if (value > 0.0) return value;
      note("joint '{}': {}=\"0\" read as no limit", joint.name, what);
      return std::nullopt;
    };
    out.effort_max = bound("effort", limits.effort);
    out.velocity_max = bound("velocity", limits.velocity);
  }

  Joint moving_joint(const urdf::Link& child) {
    const urdf::Joint& joint = *child.parent_joint;
    const SE3& frame = poses_.at(child.name);
    const Vector3d axis = frame.R() * Vector3d(joint.axis.x, joint.axis.y, joint.axis.z);
    Joint out;
    out.name = joint.name;
    if (joint.type == urdf::Joint::PRISMATIC) {
      out.type = JointType::prismatic;
      out.screw.tail<3>() = axis;
    } else {
      out.screw << axis, frame.p().cross(axis);
    }
    const std::string said = detail::normalise_screw(
        out, fmt::format("{}: joint '{}'", at_line(where_, outline_.joint_lines.at(joint.name)), joint.name));
    if (!said.empty()) robot_.notes.push_back(said);
    set_limits(out, joint);
    return out;
  }

  Link moving_link(std::size_t index) {
    const Body& body = bodies_[index];
    Link out;
    out.name = body.own->name;
    out.parent = static_cast<int>(index) - 1;
    out.joint = moving_joint(*body.own);
    set_inertia(out, body);
    const SE3 to_com = out.com.inverse();
    for (const urdf::Link* member : body.members)
      if (const auto list = spheres_.links.find(member->name); list != spheres_.links.end())
        for (const Sphere& sphere : list->second)
          out.spheres.push_back({to_com * (poses_.at(member->name) * sphere.center_m), sphere.radius_m,
                                 member == body.own ? "" : member->name});
    for (const urdf::Link* member : body.members)
      if (const auto list = spheres_.capsules.find(member->name); list != spheres_.capsules.end())
        for (const Segment& capsule : list->second) {
          const SE3 to_link = to_com * poses_.at(member->name);
          out.segments.push_back({to_link * capsule.from_m, to_link * capsule.to_m, capsule.radius_m,
                                  member == body.own ? "" : member->name});
        }
    return out;
  }

  void keep_base_shapes() {
    for (const urdf::Link* link : order_) {
      if (body_of_.at(link->name) >= 0) continue;
      const SE3& pose = poses_.at(link->name);
      if (const auto list = spheres_.links.find(link->name); list != spheres_.links.end())
        for (const Sphere& sphere : list->second)
          robot_.base_spheres.push_back({pose * sphere.center_m, sphere.radius_m, link->name});
      if (const auto list = spheres_.capsules.find(link->name); list != spheres_.capsules.end())
        for (const Segment& capsule : list->second)
          robot_.base_segments.push_back({pose * capsule.from_m, pose * capsule.to_m, capsule.radius_m, link->name});
    }
  }

  // Pairs keep the names of the file; a pair with a link that bears no shape and does not move by itself means nothing.
  void disable_pairs() {
    const auto bears = [](const auto& by_link, const std::string& name) {
      const auto list = by_link.find(name);
      return list != by_link.end() && !list->second.empty();
    };
    const auto counts = [&](const std::string& name) {
      return bears(spheres_.links, name) || bears(spheres_.capsules, name) ||
             std::any_of(bodies_.begin(), bodies_.end(), [&](const Body& body) { return body.own->name == name; });
    };
    for (const auto& [a, b] : spheres_.self_collision_disabled)
      if (counts(a) && counts(b)) robot_.self_collision_disabled.emplace_back(a, b);
  }

  void note_the_rest() {
    std::vector<std::string> skipped;
    bool shapes = false;
    for (const auto& [what, count] : outline_.skipped) {
      skipped.push_back(fmt::format("{} {}", count, what));
      shapes = shapes || what.rfind("<collision>", 0) == 0;
    }
    if (!skipped.empty())
      note("skipped: {}{}", detail::join(skipped),
           shapes && !options_.spheres ? "; `hamelin robot fit` makes spheres or capsules of collision shapes" : "");
  }

  const urdf::ModelInterface& model_;
  const std::string& where_;
  const Outline& outline_;
  const RobotOptions& options_;
  Robot robot_;
  std::vector<const urdf::Link*> order_;
  std::map<std::string, SE3> poses_;  // link frames in the base frame at q = 0
  const urdf::Link* tip_ = nullptr;
  std::vector<const urdf::Link*> path_;  // links carried by the joints that move
  std::vector<Body> bodies_;
  std::map<std::string, int> body_of_;  // index into bodies_, −1: base
  detail::SphereFile spheres_;
};

// ---- shapes, for what fits spheres to them ----

std::vector<LinkShape> shapes_of(const TiXmlElement& link, const char* tag, const std::string& where,
                                 const std::string& owner) {
  std::vector<LinkShape> shapes;
  for (const TiXmlElement* e = link.FirstChildElement(tag); e != nullptr; e = e->NextSiblingElement(tag)) {
    check_numbers(*e, where, owner);
    const TiXmlElement* geometry = e->FirstChildElement("geometry");
    const TiXmlElement* shape = geometry == nullptr ? nullptr : geometry->FirstChildElement();
    LinkShape out;
    out.line = shape == nullptr ? e->Row() : shape->Row();
    shapes.push_back(out);
  }
  return shapes;
}

void take_shape(LinkShape& out, const urdf::Geometry& geometry, const urdf::Pose& pose, const std::string& place) {
  const auto positive = [&](const char* what, double value) {
    if (!(value > 0.0))
      fail(ErrorCode::invalid, place, fmt::format("a {} of {} m, expected a positive number", what, value));
    return value;
  };
  out.pose = pose_of(pose);
  switch (geometry.type) {
    case urdf::Geometry::SPHERE:
      out.kind = LinkShape::Kind::sphere;
      out.radius_m = positive("radius", static_cast<const urdf::Sphere&>(geometry).radius);
      break;
    case urdf::Geometry::BOX: {
      const urdf::Vector3& size = static_cast<const urdf::Box&>(geometry).dim;
      out.kind = LinkShape::Kind::box;
      out.size_m = {positive("size", size.x), positive("size", size.y), positive("size", size.z)};
      break;
    }
    case urdf::Geometry::CYLINDER: {
      const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
      out.kind = LinkShape::Kind::cylinder;
      out.radius_m = positive("radius", cylinder.radius);
      out.length_m = positive("length", cylinder.length);
      break;
    }
    case urdf::Geometry::MESH: {
      const auto& mesh = static_cast<const urdf::Mesh&>(geometry);
      out.kind = LinkShape::Kind::mesh;
      out.mesh = mesh.filename;
      out.scale = {mesh.scale.x, mesh.scale.y, mesh.scale.z};
      if (out.mesh.empty()) fail(ErrorCode::invalid, place, "a <mesh> names no file");
      if (!((out.scale.array() != 0.0).all()))
        fail(ErrorCode::invalid, place, "a mesh is scaled by 0, expected factors other than 0");
      break;
    }
  }
}

}  // namespace

void detail::check_xml(const std::string& text, const std::string& where) {
  check_text(text, where);
}

Robot detail::read_urdf(const std::string& text, const std::string& where, const RobotOptions& options) {
  check_text(text, where);
  const Outline outline = read_outline(text, where);
  const urdf::ModelInterfaceSharedPtr model = parse(text, where, outline);
  return Reader(*model, where, outline, options).read();
}

std::vector<LinkGeometry> read_urdf_geometry(const std::filesystem::path& file) {
  const std::string text = read_file(file), where = file.string();
  if (file.extension() != ".urdf")
    fail(ErrorCode::usage, where, fmt::format("unknown kind of file '{}', expected .urdf", file.extension().string()));
  check_text(text, where);
  const Outline outline = read_outline(text, where);
  const urdf::ModelInterfaceSharedPtr model = parse(text, where, outline);
  TiXmlDocument document;
  document.Parse(text.c_str());
  std::vector<LinkGeometry> links;
  for (const TiXmlElement* e = document.RootElement()->FirstChildElement("link"); e != nullptr;
       e = e->NextSiblingElement("link")) {
    const urdf::Link& link = *model->getLink(e->Attribute("name"));
    const std::string owner = fmt::format("link '{}'", link.name);
    LinkGeometry out{link.name, e->Row(), shapes_of(*e, "collision", where, owner),
                     shapes_of(*e, "visual", where, owner)};
    const auto take = [&](std::vector<LinkShape>& shapes, const auto& given) {
      // urdfdom keeps the order of the file, and refuses what it cannot read
      shapes.resize(std::min(shapes.size(), given.size()));
      for (std::size_t i = 0; i < shapes.size(); ++i)
        if (given[i] && given[i]->geometry)
          take_shape(shapes[i], *given[i]->geometry, given[i]->origin,
                     fmt::format("{}: {}", at_line(where, shapes[i].line), owner));
    };
    take(out.collision, link.collision_array);
    take(out.visual, link.visual_array);
    links.push_back(std::move(out));
  }
  return links;
}

}  // namespace hamelin::description
