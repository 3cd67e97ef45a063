#include "log_fields.hpp"

#include <fmt/format.h>

#include <limits>

namespace hamelin::report {

using Eigen::VectorXd;

Error line_error(const log::LogReader& reader, const std::string& problem) {
  return Error(ErrorCode::invalid, fmt::format("{}: {}", reader.where(), problem));
}

const Json* find(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at == object.end() || at->is_null() ? nullptr : &*at;
}

const Json& object_member(const Json& line, const char* key, const log::LogReader& reader) {
  static const Json empty = Json::object();
  const Json* at = find(line, key);
  if (at == nullptr) return empty;
  if (!at->is_object()) throw line_error(reader, fmt::format("/{}: expected an object", key));
  return *at;
}

double number(const Json& object, const char* key, const log::LogReader& reader) {
  const Json* at = find(object, key);
  if (at == nullptr) return unknown;
  if (!at->is_number()) throw line_error(reader, fmt::format("{}: expected a number", key));
  return at->get<double>();
}

VectorXd numbers(const Json& object, const char* key, int count, const char* of_each,
                 const log::LogReader& reader) {
  const Json* at = find(object, key);
  if (at == nullptr) return {};
  if (!at->is_array() || at->size() != static_cast<std::size_t>(count))
    throw line_error(reader,
                     fmt::format("{}: expected {} numbers, one per {}", key, count, of_each));
  VectorXd x(count);
  for (int i = 0; i < count; ++i) {
    const Json& value = (*at)[static_cast<std::size_t>(i)];
    if (!value.is_number() && !value.is_null())
      throw line_error(reader, fmt::format("{}/{}: expected a number", key, i));
    x[i] = value.is_null() ? unknown : value.get<double>();
  }
  return x;
}

VectorXd joint_vector(const Json& object, const char* key, int dof, const log::LogReader& reader) {
  return numbers(object, key, dof, "joint", reader);
}

}  // namespace hamelin::report
