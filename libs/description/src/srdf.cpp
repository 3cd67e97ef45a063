#include "hamelin/description/srdf.hpp"

#include <fmt/format.h>
#include <tinyxml.h>

#include <algorithm>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::description {

namespace {

// One line, whatever the file's names hold.
[[noreturn]] void fail(ErrorCode code, const std::string& where, int line, std::string what) {
  std::replace_if(
      what.begin(), what.end(), [](unsigned char c) { return c < ' '; }, ' ');
  throw Error(code, fmt::format("{}: line {}: {}", where, std::max(1, line), what));
}

}  // namespace

std::string detail::join_pairs(std::vector<std::pair<std::string, std::string>>& disabled,
                               const std::vector<DisabledPair>& more, const std::filesystem::path& file) {
  const std::size_t before = disabled.size();
  for (const DisabledPair& pair : more) {
    const bool there = std::any_of(disabled.begin(), disabled.end(), [&](const auto& old) {
      return (old.first == pair.link_a && old.second == pair.link_b) ||
             (old.first == pair.link_b && old.second == pair.link_a);
    });
    if (!there) disabled.emplace_back(pair.link_a, pair.link_b);
  }
  std::string said = fmt::format("{}: {} pairs that never count as colliding", file.string(), more.size());
  if (before > 0) said += fmt::format(", {} of them new to the {} listed elsewhere", disabled.size() - before, before);
  return said;
}

std::vector<DisabledPair> read_srdf(const std::filesystem::path& file) {
  const std::string where = file.string(), text = read_file(file);
  detail::check_xml(text, where);
  TiXmlDocument document;
  document.Parse(text.c_str());
  if (document.Error())
    fail(ErrorCode::parse, where, document.ErrorRow(),
         fmt::format("column {}: not XML: {}", document.ErrorCol(), document.ErrorDesc()));
  const TiXmlElement* robot = document.RootElement();
  if (robot == nullptr || robot->ValueStr() != "robot")
    fail(ErrorCode::parse, where, robot == nullptr ? 1 : robot->Row(),
         fmt::format("expected <robot> as the root, found {}",
                     robot == nullptr ? "no element" : "<" + robot->ValueStr() + ">"));
  std::vector<DisabledPair> pairs;
  for (const TiXmlElement* e = robot->FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    const std::string tag = e->ValueStr();
    if (tag == "disable_default_collisions" || tag == "enable_collisions")
      fail(ErrorCode::invalid, where, e->Row(),
           fmt::format("<{}> is not taken, expected the pairs themselves as <disable_collisions>", tag));
    if (tag == "link" || tag == "joint")
      fail(ErrorCode::invalid, where, e->Row(), fmt::format("<{}>: that is a URDF, expected an SRDF", tag));
    if (tag.substr(0, 6) == "xacro:")
      fail(ErrorCode::parse, where, e->Row(),
           fmt::format("<{}>: the file is xacro source, expected expanded SRDF", tag));
    if (tag != "disable_collisions") continue;
    DisabledPair pair;
    pair.line = e->Row();
    const auto name = [&](const char* attribute) -> std::string {
      const char* value = e->Attribute(attribute);
      if (value == nullptr || *value == '\0')
        fail(ErrorCode::parse, where, e->Row(), fmt::format("<disable_collisions> has no {}", attribute));
      return value;
    };
    pair.link_a = name("link1");
    pair.link_b = name("link2");
    if (pair.link_a == pair.link_b)
      fail(ErrorCode::invalid, where, e->Row(),
           fmt::format("<disable_collisions> names '{}' twice, expected two links", pair.link_a));
    const char* reason = e->Attribute("reason");
    if (reason != nullptr) pair.reason = reason;
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

std::vector<DisabledPair> read_srdf(const std::filesystem::path& file, const std::vector<std::string>& links) {
  auto pairs = read_srdf(file);
  for (const DisabledPair& pair : pairs)
    for (const std::string& link : {pair.link_a, pair.link_b})
      if (std::find(links.begin(), links.end(), link) == links.end())
        fail(ErrorCode::invalid, file.string(), pair.line,
             fmt::format("the robot has no link '{}'{}", link, did_you_mean(link, links)));
  return pairs;
}

}  // namespace hamelin::description
