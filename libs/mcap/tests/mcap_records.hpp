#pragma once
#include <zlib.h>
#include <zstd.h>

#include <catch2/catch.hpp>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// Reads the records of an MCAP file, following https://mcap.dev/spec.
namespace hamelin::test {

/// Takes fields from the start of a record.
class Fields {
 public:
  explicit Fields(std::string_view bytes) : bytes_(bytes) {}

  template <class Integer>
  Integer number() {
    const std::string_view own = take(sizeof(Integer));
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < own.size(); ++i)
      value |= static_cast<std::uint64_t>(static_cast<unsigned char>(own[i])) << (8 * i);
    return static_cast<Integer>(value);
  }
  template <class Size = std::uint32_t>
  std::string sized() {
    return std::string(take(number<Size>()));
  }
  [[nodiscard]] std::string_view rest() const { return bytes_; }

 private:
  std::string_view take(std::size_t size) {
    REQUIRE(bytes_.size() >= size);
    const std::string_view out = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return out;
  }
  std::string_view bytes_;
};

struct Record {
  std::uint8_t op;
  std::size_t begin, end;  ///< offsets of the record
  std::string_view body;
};

/// The records of a text without magic. @param begin offset of the text
inline std::vector<Record> records_of(std::string_view text, std::size_t begin = 0) {
  std::vector<Record> records;
  for (std::size_t at = 0; at < text.size();) {
    Fields fields(text.substr(at));
    const auto op = fields.number<std::uint8_t>();
    const auto size = fields.number<std::uint64_t>();
    REQUIRE(fields.rest().size() >= size);
    records.push_back({op, begin + at, begin + at + 9 + size, fields.rest().substr(0, size)});
    at += 9 + size;
  }
  return records;
}

/// The records of a file, whose magic is checked.
inline std::vector<Record> records_of_file(std::string_view file) {
  const std::string_view magic("\x89MCAP0\r\n", 8);
  REQUIRE(file.size() > 16);
  REQUIRE(file.substr(0, 8) == magic);
  REQUIRE(file.substr(file.size() - 8) == magic);
  return records_of(file.substr(8, file.size() - 16), 8);
}

inline std::uint32_t crc_of(std::string_view bytes) {
  return static_cast<std::uint32_t>(
      ::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

inline std::string decompressed(const std::string& bytes, std::size_t size) {
  std::string out(size, '\0');
  REQUIRE(ZSTD_decompress(out.data(), size, bytes.data(), bytes.size()) == size);
  return out;
}

}  // namespace hamelin::test
