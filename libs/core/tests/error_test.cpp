#include "hamelin/core/error.hpp"

#include <catch2/catch.hpp>

using namespace hamelin;

TEST_CASE("an error's text is one line of UTF-8, whatever it speaks of", "[core][unit]") {
  const auto text = [](std::string_view what) { return std::string(Error(ErrorCode::parse, what).what()); };
  CHECK(text("a.json: key 'x' is given twice") == "a.json: key 'x' is given twice");
  CHECK(text("a\nb\r\tc\x1b\x7f.") == "a b  c  .");
  CHECK(text("±é€😀") == "±é€😀");
  CHECK(text("a\xff"
             "b\xc3") == "a?b?");
  CHECK(text(std::string_view("a\0b", 3)) == "a b");
  CHECK(text(std::string(5000, 'x')) == std::string(2000, 'x') + "...");
  CHECK(text(std::string(1999, 'x') + "é") == std::string(1999, 'x') + "...");
}

TEST_CASE("what is not UTF-8 is found where it stands", "[core][unit]") {
  CHECK(utf8_prefix("") == 0);
  CHECK(utf8_prefix("plain") == 5);
  CHECK(utf8_prefix("é€😀") == 9);
  CHECK(utf8_prefix("ab\xe9 cd") == 2);          // Latin-1
  CHECK(utf8_prefix("\xc0\xaf") == 0);           // overlong
  CHECK(utf8_prefix("\xe0\x80\xaf") == 0);       // overlong
  CHECK(utf8_prefix("\xed\xa0\x80") == 0);       // half of a surrogate pair
  CHECK(utf8_prefix("a\xf4\x90\x80\x80") == 1);  // beyond U+10FFFF
  CHECK(utf8_prefix("a\xf0\x9f\x98") == 1);      // cut
}
