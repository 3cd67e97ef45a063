#include "hamelin/core/error.hpp"

#include <catch2/catch.hpp>

using namespace hamelin;

TEST_CASE("an error's message is one line of UTF-8 for any input", "[core][unit]") {
  const auto text = [](std::string_view message) {
    return std::string(Error(ErrorCode::parse, message).what());
  };
  CHECK(text("a.json: key 'x' is given twice") == "a.json: key 'x' is given twice");
  CHECK(text("a\nb\r\tc\x1b\x7f.") == "a b  c  .");
  CHECK(text("±é€😀") == "±é€😀");
  CHECK(text("a\xff"
             "b\xc3") == "a?b?");
  CHECK(text(std::string_view("a\0b", 3)) == "a b");
  CHECK(text(std::string(5000, 'x')) == std::string(2000, 'x') + "...");
  CHECK(text(std::string(1999, 'x') + "é") == std::string(1999, 'x') + "...");
}
