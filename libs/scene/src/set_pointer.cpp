#include <fmt/format.h>

#include <charconv>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

namespace {

/// A parsed "/json/pointer=VALUE".
struct Assignment {
  std::string text;  ///< prefix of each message, printable
  std::vector<std::string> keys;
  Json value;

  [[noreturn]] void fail(const std::string& message) const {
    throw Error(ErrorCode::usage, fmt::format("{}: {}", text, message));
  }
};

Assignment read_assignment(std::string_view text) {
  Assignment assignment;
  assignment.text = text.substr(0, 200);
  for (char& c : assignment.text) c = c < ' ' && c >= 0 ? ' ' : c;
  const auto equals = text.find('=');
  if (text.empty() || text.front() != '/' || equals == std::string_view::npos)
    assignment.fail("expected /json/pointer=VALUE");
  try {
    for (Json::json_pointer rest{std::string(text.substr(0, equals))}; !rest.empty();
         rest.pop_back())
      assignment.keys.insert(assignment.keys.begin(), rest.back());
  } catch (const Json::exception&) {
    assignment.fail("the part before '=' is not a JSON pointer");
  }
  const std::string value(text.substr(equals + 1));
  assignment.value = try_parse_json(value);
  if (assignment.value.is_discarded()) assignment.value = value;
  return assignment;
}

Json& element_of(Json& list, const std::string& key, const Assignment& assignment) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), index);
  if (error != std::errc{} || end != key.data() + key.size() || index >= list.size())
    assignment.fail(fmt::format("no element '{}', expected an index below {}", key, list.size()));
  return list[index];
}

void check_known(const Json& properties, const std::string& key, const Assignment& assignment) {
  if (properties.contains(key)) return;
  std::vector<std::string> known;
  for (const auto& item : properties.items()) known.push_back(item.key());
  const auto near = nearest_name(key, known);
  assignment.fail(fmt::format(
      "unknown key '{}', expected {}", key,
      near.empty() ? fmt::format("one of {}", fmt::join(known, ", ")) : fmt::format("'{}'", near)));
}

}  // namespace

void set_pointer(Json& document, std::string_view text) {
  Assignment assignment = read_assignment(text);
  const Json schema = shipped_schema("scene");
  const Json* rule = &schema;  // of the value that `at` points to; null where the schema has none
  Json changed = document;
  Json* at = &changed;
  for (const std::string& key : assignment.keys) {
    if (at->is_array()) {
      at = &element_of(*at, key, assignment);
      rule = rule != nullptr && rule->contains("items")
                 ? &resolve_reference(schema, (*rule)["items"])
                 : nullptr;
      continue;
    }
    if (!at->is_object() && !at->is_null())
      assignment.fail(
          fmt::format("'{}' cannot be set: its parent is a plain value, expected an object", key));
    const bool has_properties = rule != nullptr && rule->contains("properties");
    if (has_properties) check_known((*rule)["properties"], key, assignment);
    if (at->is_null()) *at = Json::object();
    at = &(*at)[key];
    rule = has_properties ? &resolve_reference(schema, (*rule)["properties"][key]) : nullptr;
  }
  *at = std::move(assignment.value);
  document = std::move(changed);
}

}  // namespace hamelin::scene
