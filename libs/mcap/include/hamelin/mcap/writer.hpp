#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace hamelin::mcap {

/// Writes the container of an MCAP file (https://mcap.dev/spec) piece by piece: messages in chunks,
/// each compressed with zstd, then an index and statistics, with CRCs of all parts. It holds one
/// chunk and the index of all chunks in memory. Equal calls give equal bytes.
class Writer {
 public:
  using Sink = std::function<void(std::string_view)>;
  /// A chunk ends with the message with which it has so many bytes, before compression.
  static constexpr std::size_t chunk_bytes = std::size_t{1} << 20;

  /// @param sink receives the bytes of the file in their order
  /// @param library name and version of the program, for the header
  Writer(Sink sink, std::string_view library);

  /// @param encoding of `text`, such as "jsonschema"
  /// @return the schema's number, for add_channel()
  std::uint16_t add_schema(std::string_view name, std::string_view encoding, std::string_view text);
  /// @param encoding of messages, such as "json"
  /// @return the channel's number, for write()
  std::uint16_t add_channel(std::uint16_t schema, std::string_view topic,
                            std::string_view encoding);
  void write(std::uint16_t channel, std::uint64_t time_ns, std::string_view message);
  /// Writes the last chunk and the summary. To be called once, as the last call.
  void finish();

  [[nodiscard]] std::uint64_t messages() const noexcept { return messages_; }

 private:
  /// The times of the first and the last message; both 0 if there is none.
  struct Span {
    std::uint64_t first = 0, last = 0;
    bool empty = true;
    void add(std::uint64_t time_ns) noexcept;
  };

  void emit(std::string_view bytes);
  void finish_chunk();
  /// @return the offsets of the index records by channel
  std::vector<std::pair<std::uint16_t, std::uint64_t>> emit_message_indexes();
  [[nodiscard]] std::string statistics() const;

  Sink sink_;
  std::uint64_t position_ = 0;                      ///< number of bytes passed to the sink
  std::uint32_t crc_ = 0;                           ///< of these bytes
  std::string schemas_, channels_, chunk_indexes_;  ///< records that the summary has
  std::uint16_t schema_count_ = 0;
  std::uint32_t chunk_count_ = 0;
  std::vector<std::uint64_t> counts_;  ///< messages per channel; the first channel has number 1
  std::uint64_t messages_ = 0;
  Span span_, chunk_span_;
  std::string chunk_;  ///< message records, not compressed yet
  /// Time and offset of the messages of the chunk, by channel.
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> index_;
};

}  // namespace hamelin::mcap
