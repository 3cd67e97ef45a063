#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::app {

/// A result (schema hamelin.result/1) for people: a few lines of text.
/// @param written the files it and its log were written to
[[nodiscard]] std::string summary(const Json& result, const std::vector<std::filesystem::path>& written);

}  // namespace hamelin::app
