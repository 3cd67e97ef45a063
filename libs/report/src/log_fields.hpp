#pragma once
#include <Eigen/Core>
#include <limits>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/log/read_log.hpp"

/// Members of a log's lines. The reader knows the position of the line, for messages.
namespace hamelin::report {

/// A number that a line does not have.
inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

[[nodiscard]] Error line_error(const log::LogReader& reader, const std::string& problem);
/// @return null if the member is null or missing
[[nodiscard]] const Json* find(const Json& object, const char* key);
/// A member that must be an object if it exists; an empty object otherwise.
[[nodiscard]] const Json& object_member(const Json& line, const char* key,
                                        const log::LogReader& reader);
/// A number, or `unknown` if it is null or missing.
[[nodiscard]] double number(const Json& object, const char* key, const log::LogReader& reader);
/// `count` numbers; null becomes `unknown`. Empty if the member is missing.
[[nodiscard]] Eigen::VectorXd numbers(const Json& object, const char* key, int count,
                                      const char* of_each, const log::LogReader& reader);
[[nodiscard]] Eigen::VectorXd joint_vector(const Json& object, const char* key, int dof,
                                           const log::LogReader& reader);

}  // namespace hamelin::report
