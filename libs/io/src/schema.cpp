#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>

#define VALIJSON_USE_EXCEPTIONS 1  // otherwise valijson aborts on an invalid schema
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validator.hpp>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin {

// Generated from docs/schema at configure time.
std::string_view embedded_schema(std::string_view name) noexcept;

namespace {

// The place of an error as a JSON pointer; valijson gives it as "<root>[a][0]".
nlohmann::json::json_pointer pointer_of(const std::vector<std::string>& context) {
  nlohmann::json::json_pointer pointer;
  for (std::size_t i = 1; i < context.size(); ++i) {
    std::string token = context[i];
    if (token.size() >= 2 && token.front() == '[') token = token.substr(1, token.size() - 2);
    if (token.size() >= 2 && token.front() == '"') token = token.substr(1, token.size() - 2);
    pointer.push_back(token);
  }
  return pointer;
}

// The part of the schema that applies to the place, found through "properties", "items" and "$ref";
// null if they do not lead to it.
const nlohmann::json* schema_at(const nlohmann::json& schema,
                                nlohmann::json::json_pointer pointer) {
  std::vector<std::string> tokens;
  for (; !pointer.empty(); pointer.pop_back()) tokens.insert(tokens.begin(), pointer.back());
  const nlohmann::json* at = &resolve_reference(schema, schema);
  for (const auto& token : tokens) {
    if (at->contains("properties") && (*at)["properties"].contains(token)) {
      at = &resolve_reference(schema, (*at)["properties"][token]);
    } else if (at->contains("items") && (*at)["items"].is_object()) {
      at = &resolve_reference(schema, (*at)["items"]);
    } else {
      return nullptr;
    }
  }
  return at;
}

std::string abbreviated(const nlohmann::json& value) {
  std::string text = value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

std::string expectation(const nlohmann::json& rule) {
  std::vector<std::string> parts;
  const auto add = [&](const char* key, const char* label, const char* unit = "") {
    if (rule.contains(key))
      parts.push_back(fmt::format(
          "{} {}{}", label, rule[key].is_string() ? rule[key].get<std::string>() : rule[key].dump(),
          unit));
  };
  add("type", "type");
  add("enum", "one of");
  add("const", "exactly");
  add("minimum", "at least");
  add("exclusiveMinimum", "above");
  add("maximum", "at most");
  add("exclusiveMaximum", "below");
  add("minItems", "at least", " items");
  add("maxItems", "at most", " items");
  if (rule.contains("required")) parts.push_back("required keys " + rule["required"].dump());
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::string violation(const nlohmann::json& schema, const nlohmann::json& document,
                      const valijson::ValidationResults::Error& error) {
  const auto pointer = pointer_of(error.context);
  const auto* rule = schema_at(schema, pointer);
  const std::string at = pointer.empty() ? "/" : pointer.to_string();
  const auto* value = document.contains(pointer) ? &document.at(pointer) : nullptr;
  if (rule != nullptr && value != nullptr && value->is_object() && rule->contains("properties") &&
      rule->value("additionalProperties", nlohmann::json(true)) == false) {
    std::vector<std::string> known;
    for (const auto& [key, unused] : (*rule)["properties"].items()) known.push_back(key);
    for (const auto& [key, unused] : value->items()) {
      if ((*rule)["properties"].contains(key)) continue;
      const auto hint = did_you_mean(key, known);
      return fmt::format(
          "{}: unknown key '{}'{}", at, key,
          hint.empty() ? fmt::format(", expected one of {}", fmt::join(known, ", ")) : hint);
    }
    for (const auto& key : rule->value("required", nlohmann::json::array()))
      if (!value->contains(key.get<std::string>()))
        return fmt::format("{}: key '{}' is missing", at, key.get<std::string>());
  }
  if (rule != nullptr && value != nullptr && !expectation(*rule).empty())
    return fmt::format("{}: {} is not allowed, expected {}", at, abbreviated(*value),
                       expectation(*rule));
  return fmt::format("{}: {}", at, error.description);
}

// Refuses a file of another kind as such: what it lacks or has in addition does not matter then.
void refuse_other_format(const nlohmann::json& schema, const nlohmann::json& document,
                         const std::string& where) {
  const nlohmann::json::json_pointer place("/properties/schema/const");
  if (!document.is_object() || !document.contains("schema") || !schema.contains(place)) return;
  if (document["schema"] == schema[place]) return;
  throw Error(ErrorCode::invalid,
              fmt::format("{}: /schema: {} is not allowed, expected exactly {}", where,
                          abbreviated(document["schema"]), schema[place].get<std::string>()));
}

// A copy with only the first items of each list.
nlohmann::json shortened(const nlohmann::json& document, std::size_t items) {
  if (!document.is_structured()) return document;
  nlohmann::json out = document.is_array() ? nlohmann::json::array() : nlohmann::json::object();
  if (document.is_array())
    for (std::size_t i = 0; i < std::min(items, document.size()); ++i)
      out.push_back(shortened(document[i], items));
  else
    for (const auto& [key, value] : document.items()) out[key] = shortened(value, items);
  return out;
}

std::size_t longest_list(const nlohmann::json& document) {
  std::size_t longest = document.is_array() ? document.size() : 0;
  if (document.is_structured())
    for (const auto& part : document) longest = std::max(longest, longest_list(part));
  return longest;
}

// JSON has no such numbers, but a document that a program made may hold them.
void check_finite(const Json& document, const Json::json_pointer& at, const std::string& where) {
  if (document.is_number_float() && !std::isfinite(document.get<double>()))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: {}: {}, expected a finite number", where,
                            at.empty() ? "/" : at.to_string(), document.get<double>()));
  if (document.is_array())
    for (std::size_t i = 0; i < document.size(); ++i) check_finite(document[i], at / i, where);
  if (document.is_object())
    for (const auto& [key, value] : document.items()) check_finite(value, at / key, where);
}

bool valid(const valijson::Schema& schema, const nlohmann::json& document,
           valijson::ValidationResults* results) {
  valijson::Validator validator(valijson::Validator::kStrongTypes);
  return validator.validate(schema, valijson::adapters::NlohmannJsonAdapter(document), results);
}

}  // namespace

struct Schema::Compiled {
  nlohmann::json text;
  valijson::Schema schema;
};

Schema::Schema(const Json& schema, const std::string& where) {
  const auto compiled = std::make_shared<Compiled>();
  compiled->text = nlohmann::json::parse(schema.dump());
  valijson::SchemaParser parser(valijson::SchemaParser::kDraft7);
  try {
    parser.populateSchema(valijson::adapters::NlohmannJsonAdapter(compiled->text),
                          compiled->schema);
  } catch (const std::exception& e) {
    throw Error(ErrorCode::invalid,
                fmt::format("{}: its JSON Schema cannot be used: {}", where, e.what()));
  }
  compiled_ = compiled;
}

void Schema::check(const Json& document, const std::string& where) const {
  check_finite(document, Json::json_pointer(), where);
  const nlohmann::json plain =
      nlohmann::json::parse(document.dump(-1, ' ', false, Json::error_handler_t::replace));
  if (valid(compiled_->schema, plain, nullptr)) return;
  refuse_other_format(compiled_->text, plain, where);
  // valijson collects all violations, each many times larger than the value concerned. To save
  // time, long lists are shortened to a beginning that contains the first violation.
  nlohmann::json part = plain;
  const std::size_t longest = longest_list(plain);
  for (std::size_t items = 1000; items < longest; items += items / 4) {
    nlohmann::json head = shortened(plain, items);
    if (valid(compiled_->schema, head, nullptr)) continue;
    part = std::move(head);
    break;
  }
  valijson::ValidationResults results;
  (void)valid(compiled_->schema, part, &results);
  // The deepest place is the most specific one; of several, the first in the document is reported.
  valijson::ValidationResults::Error error, deepest;
  bool first = true;
  while (results.popError(error)) {
    if (first || error.context.size() > deepest.context.size()) deepest = error;
    first = false;
  }
  throw Error(ErrorCode::invalid,
              fmt::format("{}: {}", where, violation(compiled_->text, part, deepest)));
}

void check_schema(const Json& document, const Json& schema, const std::string& where) {
  Schema(schema, where).check(document, where);
}

std::string_view schema_text(std::string_view name) {
  return embedded_schema(fmt::format("{}.schema.json", name));
}

Json shipped_schema(std::string_view name) {
  const auto text = schema_text(name);
  if (text.empty()) throw Error(ErrorCode::usage, fmt::format("no schema '{}' is shipped", name));
  return Json::parse(text);
}

void check_shipped_schema(const Json& document, std::string_view schema_name,
                          const std::string& where) {
  static std::mutex mutex;
  static std::map<std::string, Schema, std::less<>> cache;
  const auto schema = [&] {
    const std::lock_guard lock(mutex);
    auto at = cache.find(schema_name);
    if (at == cache.end())
      at = cache.emplace(schema_name, Schema(shipped_schema(schema_name), where)).first;
    return at->second;
  }();
  schema.check(document, where);
}

Json with_defaults(Json document, const Json& schema) {
  if (!document.is_object() || !schema.contains("properties")) return document;
  for (const auto& [key, rule] : schema["properties"].items()) {
    if (!document.contains(key) && rule.contains("default")) document[key] = rule["default"];
    if (document.contains(key) && document[key].is_object())
      document[key] = with_defaults(document[key], rule);
  }
  return document;
}

}  // namespace hamelin
