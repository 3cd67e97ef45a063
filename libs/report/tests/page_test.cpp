#include <zlib.h>

#include <catch2/catch.hpp>
#include <cstdint>
#include <cstring>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/report/report.hpp"

using namespace hamelin;

namespace {

std::string from_base64(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0, group = 0;
  REQUIRE(text.size() % 4 == 0);
  for (const char c : text) {
    if (c == '=') break;
    const auto digit = digits.find(c);
    REQUIRE(digit != std::string::npos);
    group = (group << 6U | static_cast<unsigned>(digit)) & 0xffffffU;
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      bytes += static_cast<char>(group >> bits & 0xffU);
    }
  }
  return bytes;
}

std::string gunzipped(std::string packed, std::size_t size) {
  std::string out(size + 1, '\0');
  z_stream stream{};
  REQUIRE(inflateInit2(&stream, 15 + 16) == Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  CHECK(inflate(&stream, Z_FINISH) == Z_STREAM_END);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

}  // namespace

TEST_CASE("a page is its template with the token replaced by the data", "[report]") {
  for (const std::size_t size : {0UL, 1UL, 2UL, 3UL, 1000UL, 3000000UL}) {
    std::string data;
    for (std::size_t i = 0; data.size() < size; ++i) data += std::to_string(i * i % 7919);
    data.resize(size);
    const std::string page =
        report::make_page("<head>" + std::string(report::token) + "</head>", data, "page.html");
    REQUIRE(page.starts_with("<head>"));
    REQUIRE(page.ends_with("</head>"));
    const std::string packed = from_base64(page.substr(6, page.size() - 13));
    CHECK(gunzipped(packed, size) == data);
    CHECK(packed.substr(4, 4) == std::string(4, '\0'));  // RFC 1952: time unknown
  }
}

TEST_CASE("a template without the token, or with two tokens, is refused with the name of the file",
          "[report]") {
  const std::string token(report::token);
  CHECK_THROWS_WITH(
      report::make_page("<html></html>", "data", "share/page.html"),
      "share/page.html: the token __HAMELIN_REPORT_DATA__ is missing, expected it once");
  CHECK_THROWS_WITH(
      report::make_page(token + " " + token, "data", "share/page.html"),
      "share/page.html: the token __HAMELIN_REPORT_DATA__ occurs twice, expected it once");
}

TEST_CASE("JSON alone is packed as a container without arrays", "[report]") {
  const Json data{{"format", "hamelin.sweep-page/1"}, {"text", "<µ> & '"}};
  const std::string bytes = report::pack(data);
  std::uint32_t size = 0;
  REQUIRE(bytes.size() > sizeof size);
  std::memcpy(&size, bytes.data(), sizeof size);
  CHECK(parse_json(bytes.substr(sizeof size, size), "page") == data);
  CHECK(bytes.size() == (sizeof size + size + 7) / 8 * 8);
}
