#pragma once
#include <catch2/catch.hpp>
#include <filesystem>
#include <string>

#include "hamelin/io/file.hpp"

namespace hamelin::test {

/// Checks that folder/tests/readme_test.cpp contains the first C++ example of folder/README.md
/// verbatim, between two lines "  // [example]" and with clang-format off.
/// @param folder relative to the root of the checkout, e.g. "libs/scene"
inline void check_readme_example(const std::string& folder) {
  const auto root = std::filesystem::path(HAMELIN_SOURCE_DIR) / folder;
  const auto between = [](const std::string& text, const std::string& open,
                          const std::string& close) {
    const auto found = text.find(open);
    REQUIRE(found != std::string::npos);
    const auto begin = found + open.size(), end = text.find(close, begin);
    REQUIRE(end != std::string::npos);
    return text.substr(begin, end - begin);
  };
  CHECK(between(read_file(root / "README.md"), "```cpp\n", "```") ==
        between(read_file(root / "tests" / "readme_test.cpp"), "// [example]\n", "  // [example]"));
}

}  // namespace hamelin::test
