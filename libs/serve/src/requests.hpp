#pragma once
#include <filesystem>
#include <string>

#include "hamelin/control/controller.hpp"

namespace hamelin::serve {

/// Does what a message of a client asks for, and answers it as JSON: README.md.
/// @param folder that relative paths start from
[[nodiscard]] std::string answer_request(control::Controller& controller, const std::string& text,
                                         const std::filesystem::path& folder);

}  // namespace hamelin::serve
