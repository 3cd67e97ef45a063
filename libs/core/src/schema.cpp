#include <fmt/format.h>

#define VALIJSON_USE_EXCEPTIONS 1  // else it aborts on a bad schema
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validator.hpp>

#include "hamelin/core/error.hpp"
#include "hamelin/core/json.hpp"

namespace hamelin {

std::string_view embedded_schema(std::string_view name) noexcept;  // made at configure time from docs/schema

namespace {

// nlohmann's own message for a missing or mistyped value has no place in it; valijson's path is "<root>[a][0]".
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

// The part of the schema that speaks of the place, as far as properties and items lead to it.
const nlohmann::json* schema_at(const nlohmann::json& schema, nlohmann::json::json_pointer pointer) {
  std::vector<std::string> tokens;
  for (; !pointer.empty(); pointer.pop_back()) tokens.insert(tokens.begin(), pointer.back());
  const auto resolved = [&schema](const nlohmann::json* part) {
    while (part->contains("$ref")) {
      const auto ref = (*part)["$ref"].get<std::string>();
      part = &schema.at(nlohmann::json::json_pointer(ref.substr(1)));
    }
    return part;
  };
  const nlohmann::json* at = resolved(&schema);
  for (const auto& token : tokens) {
    if (at->contains("properties") && (*at)["properties"].contains(token)) {
      at = resolved(&(*at)["properties"][token]);
    } else if (at->contains("items") && (*at)["items"].is_object()) {
      at = resolved(&(*at)["items"]);
    } else {
      return nullptr;
    }
  }
  return at;
}

std::string shown(const nlohmann::json& value) {
  std::string text = value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

std::string expectation(const nlohmann::json& rule) {
  std::vector<std::string> parts;
  const auto add = [&](const char* key, const char* words) {
    if (rule.contains(key))
      parts.push_back(
          fmt::format("{} {}", words, rule[key].is_string() ? rule[key].get<std::string>() : rule[key].dump()));
  };
  add("type", "type");
  add("enum", "one of");
  add("const", "exactly");
  add("minimum", "at least");
  add("exclusiveMinimum", "above");
  add("maximum", "at most");
  add("exclusiveMaximum", "below");
  add("minItems", "items at least");
  add("maxItems", "items at most");
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
      const auto near = nearest_name(key, known);
      return fmt::format("{}: unknown key '{}', expected {}", at, key,
                         near.empty() ? fmt::format("one of {}", fmt::join(known, ", ")) : fmt::format("'{}'?", near));
    }
    for (const auto& key : rule->value("required", nlohmann::json::array()))
      if (!value->contains(key.get<std::string>()))
        return fmt::format("{}: key '{}' is missing", at, key.get<std::string>());
  }
  if (rule != nullptr && value != nullptr && !expectation(*rule).empty())
    return fmt::format("{}: {} is not allowed, expected {}", at, shown(*value), expectation(*rule));
  return fmt::format("{}: {}", at, error.description);
}

}  // namespace

void check_schema(const Json& document, const Json& schema, const std::string& where) {
  const nlohmann::json plain_schema = nlohmann::json::parse(schema.dump());
  const nlohmann::json plain = nlohmann::json::parse(document.dump());
  valijson::Schema compiled;
  valijson::SchemaParser parser(valijson::SchemaParser::kDraft7);
  const valijson::adapters::NlohmannJsonAdapter schema_adapter(plain_schema);
  try {
    parser.populateSchema(schema_adapter, compiled);
  } catch (const std::exception& e) {
    throw Error(ErrorCode::invalid, fmt::format("{}: its JSON Schema cannot be used: {}", where, e.what()));
  }
  valijson::Validator validator(valijson::Validator::kStrongTypes);
  valijson::ValidationResults results;
  const valijson::adapters::NlohmannJsonAdapter document_adapter(plain);
  if (validator.validate(compiled, document_adapter, &results)) return;
  // The deepest place says most; the first of those, as written.
  valijson::ValidationResults::Error error, deepest;
  bool first = true;
  while (results.popError(error)) {
    if (first || error.context.size() > deepest.context.size()) deepest = error;
    first = false;
  }
  throw Error(ErrorCode::invalid, fmt::format("{}: {}", where, violation(plain_schema, plain, deepest)));
}

std::string_view schema_text(std::string_view name) {
  return embedded_schema(fmt::format("{}.schema.json", name));
}

void check_shipped_schema(const Json& document, std::string_view schema_name, const std::string& where) {
  const auto text = schema_text(schema_name);
  if (text.empty()) throw Error(ErrorCode::usage, fmt::format("no schema '{}' is shipped", schema_name));
  check_schema(document, Json::parse(text), where);
}

Json with_defaults(Json document, const Json& schema) {
  if (!document.is_object() || !schema.contains("properties")) return document;
  for (const auto& [key, rule] : schema["properties"].items()) {
    if (!document.contains(key) && rule.contains("default")) document[key] = rule["default"];
    if (document.contains(key) && document[key].is_object()) document[key] = with_defaults(document[key], rule);
  }
  return document;
}

}  // namespace hamelin
