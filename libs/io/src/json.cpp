#include "hamelin/io/json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin {

namespace {

std::string position_of(std::string_view text, std::size_t byte) {
  byte = std::min(byte, text.size());
  const std::string_view before = text.substr(0, byte);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const auto last_newline = before.rfind('\n');
  const auto column = last_newline == std::string_view::npos ? byte : byte - last_newline - 1;
  return fmt::format("line {}, column {}", line, std::max<std::size_t>(column, 1));
}

// Limits the recursion depth of dump(), copies and schema checks.
constexpr std::size_t nesting_max = 100;

// Builds a document from parser events. nlohmann's own builder silently keeps the last of two equal
// keys, which would hide a typing error in a scene, and its time grows with the square of the size
// of a list or object.
class Builder final : public nlohmann::json_sax<Json> {
 public:
  Builder(std::string_view text, const std::string& where) : text_(text), where_(where) {}
  Json take() { return std::move(document_); }

  bool null() override { return put(nullptr); }
  bool boolean(bool value) override { return put(value); }
  bool number_integer(Json::number_integer_t value) override { return put(value); }
  bool number_unsigned(Json::number_unsigned_t value) override { return put(value); }
  bool number_float(Json::number_float_t value, const std::string&) override { return put(value); }
  bool string(std::string& value) override { return put(std::move(value)); }
  bool binary(Json::binary_t&) override { return false; }
  bool start_array(std::size_t) override { return open(Json::array()); }
  bool end_array() override { return close(); }
  bool start_object(std::size_t) override { return open(Json::object()); }
  bool key(std::string& value) override {
    members().emplace_back(std::move(value), nullptr);
    return true;
  }
  bool end_object() override {
    std::vector<const std::string*> keys;
    for (const auto& member : members()) keys.push_back(&member.first);
    std::sort(keys.begin(), keys.end(), [](const auto* a, const auto* b) { return *a < *b; });
    const auto duplicate = std::adjacent_find(
        keys.begin(), keys.end(), [](const auto* a, const auto* b) { return *a == *b; });
    if (duplicate != keys.end())
      throw Error(ErrorCode::parse,
                  fmt::format("{}: key '{}' is given twice", where_, **duplicate));
    return close();
  }
  bool parse_error(std::size_t byte, const std::string&, const Json::exception& e) override {
    std::string_view reason = e.what();  // begins with the exception's name in brackets
    constexpr int number_out_of_range = 406;
    if (e.id == number_out_of_range)
      throw Error(ErrorCode::parse,
                  fmt::format("{}: not JSON: {}", where_, reason.substr(reason.find("] ") + 2)));
    if (const auto at = reason.find("syntax error"); at != std::string_view::npos)
      reason.remove_prefix(at);
    throw Error(ErrorCode::parse,
                fmt::format("{}: {}: not JSON: {}", where_, position_of(text_, byte), reason));
  }

 private:
  // The members of the object that is being read.
  Json::object_t::Container& members() { return open_.back()->get_ref<Json::object_t&>(); }
  Json& place(Json&& value) {
    if (open_.empty()) return document_ = std::move(value);
    if (open_.back()->is_object()) return members().back().second = std::move(value);
    return open_.back()->get_ref<Json::array_t&>().emplace_back(std::move(value));
  }
  bool put(Json&& value) {
    place(std::move(value));
    return true;
  }
  bool open(Json&& value) {
    if (open_.size() == nesting_max)
      throw Error(ErrorCode::parse,
                  fmt::format("{}: lists and objects nest deeper than {}", where_, nesting_max));
    open_.push_back(&place(std::move(value)));
    return true;
  }
  bool close() {
    open_.pop_back();
    return true;
  }

  std::string_view text_;
  const std::string& where_;
  Json document_;
  // The open lists and objects; a parent does not grow while its child is open.
  std::vector<Json*> open_;
};

}  // namespace

Json parse_json(std::string_view text, const std::string& where) {
  Builder builder(text, where);
  (void)Json::sax_parse(text, &builder);
  return builder.take();
}

Json try_parse_json(std::string_view text) {
  return Json::parse(text, nullptr, false);
}

Json read_json(const std::filesystem::path& file) {
  return parse_json(read_file(file), file.string());
}

}  // namespace hamelin
