#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <new>

#include "hamelin/core/error.hpp"
#include "hamelin/report/report.hpp"

namespace hamelin::report {

namespace {

// RFC 1952. zlib leaves the header's time at zero, so the bytes depend on the content alone.
std::string gzip(std::string_view bytes) {
  constexpr int with_gzip_header = 15 + 16, memory_level_max = 9;
  z_stream stream{};
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, with_gzip_header, memory_level_max,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::bad_alloc();
  constexpr std::size_t chunk = std::size_t{1} << 20;
  std::string out, piece(chunk, '\0');
  std::size_t at = 0;
  int state = Z_OK;
  while (state != Z_STREAM_END) {
    const std::size_t input_size = std::min(chunk, bytes.size() - at);
    // zlib does not write to its input; its C interface only lacks the const.
    stream.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(bytes.data() + at));
    stream.avail_in = static_cast<uInt>(input_size);
    stream.next_out = reinterpret_cast<Bytef*>(piece.data());
    stream.avail_out = static_cast<uInt>(piece.size());
    state = deflate(&stream, at + input_size == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    at += input_size - stream.avail_in;
    out.append(piece, 0, piece.size() - stream.avail_out);
  }
  deflateEnd(&stream);
  return out;
}

// RFC 4648, padded.
std::string base64(std::string_view bytes) {
  constexpr std::string_view digits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group =
          group << 8U | (k < count ? static_cast<std::uint8_t>(bytes[i + k]) : std::uint32_t{0});
    for (std::size_t k = 0; k < 4; ++k)
      out += k <= count ? digits[group >> (18 - 6 * k) & 63U] : '=';
  }
  return out;
}

}  // namespace

std::string make_page(std::string_view page_template, std::string_view data,
                      const std::string& where) {
  const std::size_t at = page_template.find(token);
  if (at == std::string_view::npos)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: the token {} is missing, expected it once", where, token));
  if (page_template.find(token, at + 1) != std::string_view::npos)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: the token {} occurs twice, expected it once", where, token));
  std::string page(page_template.substr(0, at));
  page += base64(gzip(data));
  page += page_template.substr(at + token.size());
  return page;
}

}  // namespace hamelin::report
