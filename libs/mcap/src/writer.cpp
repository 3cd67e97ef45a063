#include "hamelin/mcap/writer.hpp"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <new>

// The layout of all records is that of https://mcap.dev/spec, and so are the names of their fields.
namespace hamelin::mcap {

namespace {

constexpr std::string_view magic{"\x89MCAP0\r\n", 8};
constexpr int compression_level = 3;

enum class Op : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0b,
  summary_offset = 0x0e,
  data_end = 0x0f
};

// Little endian, on every machine.
template <class Integer>
void put(std::string& out, Integer value) {
  for (std::size_t i = 0; i < sizeof(Integer); ++i)
    out += static_cast<char>((static_cast<std::uint64_t>(value) >> (8 * i)) & 0xffU);
}

// Strings, byte arrays and maps begin with their size in bytes.
template <class Size = std::uint32_t>
void put_sized(std::string& out, std::string_view bytes) {
  put(out, static_cast<Size>(bytes.size()));
  out += bytes;
}

void put_record(std::string& out, Op op, std::string_view body) {
  put(out, static_cast<std::uint8_t>(op));
  put_sized<std::uint64_t>(out, body);
}

std::string record(Op op, std::string_view body) {
  std::string out;
  put_record(out, op, body);
  return out;
}

std::uint32_t extended_crc(std::uint32_t crc, std::string_view bytes) {
  return static_cast<std::uint32_t>(
      ::crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::string compressed(std::string_view bytes) {
  std::string out(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size =
      ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), compression_level);
  // The buffer is large enough, so only memory can be missing.
  if (ZSTD_isError(size) != 0) throw std::bad_alloc();
  out.resize(size);
  return out;
}

}  // namespace

void Writer::Span::add(std::uint64_t time_ns) noexcept {
  first = empty ? time_ns : std::min(first, time_ns);
  last = empty ? time_ns : std::max(last, time_ns);
  empty = false;
}

Writer::Writer(Sink sink, std::string_view library) : sink_(std::move(sink)) {
  std::string header;
  put_sized(header, "");  // profile
  put_sized(header, library);
  emit(magic);
  emit(record(Op::header, header));
}

void Writer::emit(std::string_view bytes) {
  position_ += bytes.size();
  crc_ = extended_crc(crc_, bytes);
  sink_(bytes);
}

std::uint16_t Writer::add_schema(std::string_view name, std::string_view encoding,
                                 std::string_view text) {
  std::string body;
  put(body, ++schema_count_);
  put_sized(body, name);
  put_sized(body, encoding);
  put_sized(body, text);
  const std::string schema = record(Op::schema, body);
  schemas_ += schema;
  emit(schema);
  return schema_count_;
}

std::uint16_t Writer::add_channel(std::uint16_t schema, std::string_view topic,
                                  std::string_view encoding) {
  counts_.push_back(0);
  const auto id = static_cast<std::uint16_t>(counts_.size());
  std::string body;
  put(body, id);
  put(body, schema);
  put_sized(body, topic);
  put_sized(body, encoding);
  put_sized(body, "");  // metadata
  const std::string channel = record(Op::channel, body);
  channels_ += channel;
  emit(channel);
  return id;
}

void Writer::write(std::uint16_t channel, std::uint64_t time_ns, std::string_view message) {
  index_[channel].emplace_back(time_ns, chunk_.size());
  std::string body;
  put(body, channel);
  put(body, static_cast<std::uint32_t>(counts_[channel - 1U]++));  // sequence
  put(body, time_ns);                                              // log_time
  put(body, time_ns);                                              // publish_time
  body += message;
  put_record(chunk_, Op::message, body);
  ++messages_;
  chunk_span_.add(time_ns);
  span_.add(time_ns);
  if (chunk_.size() >= chunk_bytes) finish_chunk();
}

void Writer::finish_chunk() {
  if (index_.empty()) return;
  const std::string records = compressed(chunk_);
  std::string body;
  put(body, chunk_span_.first);
  put(body, chunk_span_.last);
  put<std::uint64_t>(body, chunk_.size());
  put(body, extended_crc(0, chunk_));
  put_sized(body, "zstd");
  put_sized<std::uint64_t>(body, records);
  const std::uint64_t begin = position_;
  emit(record(Op::chunk, body));
  const std::uint64_t end = position_;
  std::string offsets;
  for (const auto& [channel, offset] : emit_message_indexes()) {
    put(offsets, channel);
    put(offsets, offset);
  }

  std::string index;
  put(index, chunk_span_.first);
  put(index, chunk_span_.last);
  put(index, begin);
  put(index, end - begin);
  put_sized(index, offsets);
  put(index, position_ - end);
  put_sized(index, "zstd");
  put<std::uint64_t>(index, records.size());
  put<std::uint64_t>(index, chunk_.size());
  put_record(chunk_indexes_, Op::chunk_index, index);
  ++chunk_count_;
  chunk_.clear();
  index_.clear();
  chunk_span_ = {};
}

std::vector<std::pair<std::uint16_t, std::uint64_t>> Writer::emit_message_indexes() {
  std::vector<std::pair<std::uint16_t, std::uint64_t>> offsets;
  for (const auto& [channel, entries] : index_) {
    std::string times, body;
    for (const auto& [time_ns, offset] : entries) {
      put(times, time_ns);
      put(times, offset);
    }
    put(body, channel);
    put_sized(body, times);
    offsets.emplace_back(channel, position_);
    emit(record(Op::message_index, body));
  }
  return offsets;
}

std::string Writer::statistics() const {
  std::string counts, body;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    put(counts, static_cast<std::uint16_t>(i + 1));
    put(counts, counts_[i]);
  }
  put(body, messages_);
  put(body, schema_count_);
  put(body, static_cast<std::uint32_t>(counts_.size()));
  put<std::uint32_t>(body, 0);  // attachment_count
  put<std::uint32_t>(body, 0);  // metadata_count
  put(body, chunk_count_);
  put(body, span_.first);
  put(body, span_.last);
  put_sized(body, counts);
  return record(Op::statistics, body);
}

void Writer::finish() {
  finish_chunk();
  std::string data_end;
  put(data_end, crc_);
  emit(record(Op::data_end, data_end));

  const std::uint64_t summary_start = position_;
  std::string summary, offsets;
  for (const auto& [op, group] :
       {std::pair(Op::schema, schemas_), std::pair(Op::channel, channels_),
        std::pair(Op::statistics, statistics()), std::pair(Op::chunk_index, chunk_indexes_)}) {
    if (group.empty()) continue;
    std::string body;
    put(body, static_cast<std::uint8_t>(op));
    put(body, summary_start + summary.size());
    put<std::uint64_t>(body, group.size());
    put_record(offsets, Op::summary_offset, body);
    summary += group;
  }
  std::string footer;
  put(footer, summary_start);
  put(footer, summary_start + summary.size());
  summary += offsets;
  // The CRC covers the footer up to itself, with the length that the whole footer will have.
  put(summary, static_cast<std::uint8_t>(Op::footer));
  put<std::uint64_t>(summary, footer.size() + sizeof(std::uint32_t));
  summary += footer;
  put(summary, extended_crc(0, summary));
  emit(summary);
  emit(magic);
}

}  // namespace hamelin::mcap
