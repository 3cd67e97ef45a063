#pragma once
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace hamelin {

/// JSON that keeps the order in which keys were written.
using Json = nlohmann::ordered_json;

/// Parses text; `where` (a file name) opens the error message.
/// @throws Error parse: "where: line L, column C: what is wrong"; doubled keys are errors too, and lists and objects
/// that nest deeper than 100
[[nodiscard]] Json parse_json(std::string_view text, const std::string& where);

/// Reads and parses a file. @throws Error io or parse
[[nodiscard]] Json read_json(const std::filesystem::path& file);

/// The text of a shipped JSON Schema (draft-07), e.g. schema_text("robot"); empty if there is none of that name.
[[nodiscard]] std::string_view schema_text(std::string_view name);

/// A JSON Schema made ready once, for many documents. May be used by many threads at once.
class Schema {
 public:
  /// @param where opens the message if it is none @throws Error invalid
  Schema(const Json& schema, const std::string& where);
  /// @throws Error invalid with the first violation: "where: /json/pointer: what is wrong, what was expected"
  void check(const Json& document, const std::string& where) const;

 private:
  struct Compiled;
  std::shared_ptr<const Compiled> compiled_;
};

/// Checks one document against a schema. @throws Error invalid, as Schema::check does
void check_schema(const Json& document, const Json& schema, const std::string& where);

/// A schema's name is no schema: see check_shipped_schema.
void check_schema(const Json& document, std::string_view schema_name, const std::string& where) = delete;

/// Checks against the shipped schema of that name. @throws Error invalid
void check_shipped_schema(const Json& document, std::string_view schema_name, const std::string& where);

/// A copy of `document` (an object) with the `default` of every property that the schema names and it lacks,
/// nested objects included.
[[nodiscard]] Json with_defaults(Json document, const Json& schema);

}  // namespace hamelin
