#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::app {

/// A result (schema hamelin.result/1) as a few lines of text.
/// @param written the files that were written: log and result
[[nodiscard]] std::string summary(const Json& result,
                                  const std::vector<std::filesystem::path>& written);

}  // namespace hamelin::app
