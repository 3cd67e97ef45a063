#pragma once
#include <string>

namespace hamelin::sweep {

/// A word, quoted for a POSIX shell if necessary.
[[nodiscard]] std::string shell_word(const std::string& word);

}  // namespace hamelin::sweep
