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

/// Parses text.
/// @param where name of the text's source (a file), prefix of error messages
/// @throws Error parse: "where: line L, column C: what is wrong"; also for a key given twice in one
/// object and for lists and objects nested deeper than 100
[[nodiscard]] Json parse_json(std::string_view text, const std::string& where);

/// Parses text that need not be JSON, such as what another process wrote. If it is none, the value
/// `is_discarded()`.
[[nodiscard]] Json try_parse_json(std::string_view text);

/// Reads and parses a file. @throws Error io or parse
[[nodiscard]] Json read_json(const std::filesystem::path& file);

/// The text of a shipped JSON Schema (draft-07), e.g. schema_text("robot"); empty if no schema has
/// that name.
[[nodiscard]] std::string_view schema_text(std::string_view name);

/// The shipped schema of that name, parsed. @throws Error usage if no schema has that name
[[nodiscard]] Json shipped_schema(std::string_view name);

/// A JSON Schema compiled once for checking many documents. Threads may share it.
class Schema {
 public:
  /// @param where prefix of the message if the schema is invalid
  /// @throws Error invalid
  Schema(const Json& schema, const std::string& where);
  /// @throws Error invalid with the first violation: "where: /json/pointer: what is wrong, what was
  /// expected"
  void check(const Json& document, const std::string& where) const;

 private:
  struct Compiled;
  std::shared_ptr<const Compiled> compiled_;
};

/// Checks one document against a schema. @throws Error invalid, as Schema::check does
void check_schema(const Json& document, const Json& schema, const std::string& where);

/// A schema's name is not accepted here; use check_shipped_schema.
void check_schema(const Json& document, std::string_view schema_name,
                  const std::string& where) = delete;

/// Checks against the shipped schema of that name. @throws Error invalid, as Schema::check does
void check_shipped_schema(const Json& document, std::string_view schema_name,
                          const std::string& where);

/// A part of a schema, or the definition that it refers to by "$ref".
/// @param schema the whole, of type Json or nlohmann::json as its part
template <class AnyJson>
[[nodiscard]] const AnyJson& resolve_reference(const AnyJson& schema, const AnyJson& part) {
  const AnyJson* at = &part;
  while (at->contains("$ref")) {
    const auto reference = (*at)["$ref"].template get<std::string>();
    at = &schema.at(typename AnyJson::json_pointer(reference.substr(1)));
  }
  return *at;
}

/// A copy of `document` (an object) in which missing properties have the `default` of the schema,
/// also in nested objects that the document contains.
[[nodiscard]] Json with_defaults(Json document, const Json& schema);

}  // namespace hamelin
