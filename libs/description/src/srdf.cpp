#include "hamelin/description/srdf.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "xml.hpp"

namespace hamelin::description {

namespace {

using detail::fail;
using tinyxml2::XMLElement;

DisabledPair pair_of(const XMLElement& element, const std::string& where) {
  DisabledPair pair;
  pair.line = element.GetLineNum();
  const auto name = [&](const char* attribute) {
    std::string value = detail::text_of(element, attribute);
    if (value.empty())
      fail(ErrorCode::parse, where, pair.line,
           fmt::format("<disable_collisions> has no {}", attribute));
    return value;
  };
  pair.link_a = name("link1");
  pair.link_b = name("link2");
  pair.reason = detail::text_of(element, "reason");
  if (pair.link_a == pair.link_b)
    fail(ErrorCode::invalid, where, pair.line,
         fmt::format("<disable_collisions> names '{}' twice, expected two links", pair.link_a));
  return pair;
}

void refuse_other_formats(const XMLElement& element, const std::string& where) {
  const std::string tag = element.Name();
  const int line = element.GetLineNum();
  if (tag == "disable_default_collisions" || tag == "enable_collisions")
    fail(ErrorCode::invalid, where, line,
         fmt::format("<{}> is not supported, expected each pair as <disable_collisions>", tag));
  if (tag == "link" || tag == "joint")
    fail(ErrorCode::invalid, where, line,
         fmt::format("<{}> is an element of URDF, expected an SRDF", tag));
  if (tag.substr(0, 6) == "xacro:")
    fail(ErrorCode::parse, where, line,
         fmt::format("<{}>: the file is xacro source, expected expanded SRDF", tag));
}

}  // namespace

std::string detail::merge_pairs(std::vector<std::pair<std::string, std::string>>& disabled,
                                const std::vector<DisabledPair>& more,
                                const std::filesystem::path& file) {
  const std::size_t before = disabled.size();
  for (const DisabledPair& pair : more) {
    const bool listed = std::any_of(disabled.begin(), disabled.end(), [&](const auto& old) {
      return (old.first == pair.link_a && old.second == pair.link_b) ||
             (old.first == pair.link_b && old.second == pair.link_a);
    });
    if (!listed) disabled.emplace_back(pair.link_a, pair.link_b);
  }
  std::string note =
      fmt::format("{}: {} pairs that never count as colliding", file.string(), more.size());
  if (before > 0)
    note += fmt::format(", {} of them new ({} listed elsewhere)", disabled.size() - before, before);
  return note;
}

std::vector<DisabledPair> read_srdf(const std::filesystem::path& file) {
  const std::string where = file.string(), text = read_file(file);
  tinyxml2::XMLDocument document;
  const XMLElement& robot = detail::parse_robot_xml(document, text, where, "SRDF");
  std::vector<DisabledPair> pairs;
  for (const XMLElement* e = robot.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    refuse_other_formats(*e, where);
    if (std::string_view(e->Name()) == "disable_collisions") pairs.push_back(pair_of(*e, where));
  }
  return pairs;
}

std::vector<DisabledPair> read_srdf(const std::filesystem::path& file,
                                    const std::vector<std::string>& links) {
  auto pairs = read_srdf(file);
  for (const DisabledPair& pair : pairs)
    for (const std::string& link : {pair.link_a, pair.link_b})
      if (std::find(links.begin(), links.end(), link) == links.end())
        fail(ErrorCode::invalid, file.string(), pair.line,
             fmt::format("the robot has no link '{}'{}", link, did_you_mean(link, links)));
  return pairs;
}

}  // namespace hamelin::description
