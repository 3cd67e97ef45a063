#include "shell.hpp"

#include <algorithm>
#include <string_view>

namespace hamelin::sweep {

std::string shell_word(const std::string& word) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("/._-=+:,@%").find(c) != std::string_view::npos;
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), plain)) return word;
  std::string out(1, '\'');
  for (const char c : word) {
    if (c == '\'') out += "'\\'";  // gives '\'', which closes the quotes, adds one and reopens them
    out += c;
  }
  return out + '\'';
}

}  // namespace hamelin::sweep
