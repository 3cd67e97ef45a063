#include "hamelin/mcap/writer.hpp"

#include <catch2/catch.hpp>
#include <string>

#include "mcap_records.hpp"

using namespace hamelin;
using test::Fields;

namespace {

constexpr std::uint8_t header = 1, footer = 2, schema = 3, channel = 4, message = 5, chunk = 6,
                       message_index = 7, chunk_index = 8, statistics = 11, summary_offset = 14,
                       data_end = 15;

// Two channels with a message each per step; `padding` makes messages long.
std::string file_with(int steps, std::size_t padding = 0) {
  std::string bytes;
  mcap::Writer writer([&](std::string_view more) { bytes += more; }, "a program 1.0");
  const auto of_both = writer.add_schema("Number", "jsonschema", R"({"type": "object"})");
  const auto first = writer.add_channel(of_both, "/first", "json");
  const auto second = writer.add_channel(of_both, "/second", "json");
  for (int k = 0; k < steps; ++k) {
    const auto time = static_cast<std::uint64_t>(1000 * k);
    writer.write(first, time, "{}" + std::string(padding, ' '));
    writer.write(second, time + 1, "{\"k\": " + std::to_string(k) + "}");
  }
  writer.finish();
  CHECK(writer.messages() == 2 * static_cast<std::uint64_t>(steps));
  return bytes;
}

std::vector<test::Record> of_kind(const std::vector<test::Record>& records, std::uint8_t op) {
  std::vector<test::Record> out;
  for (const auto& record : records)
    if (record.op == op) out.push_back(record);
  return out;
}

std::vector<std::uint8_t> kinds(const std::vector<test::Record>& records) {
  std::vector<std::uint8_t> out;
  for (const auto& record : records) out.push_back(record.op);
  return out;
}

}  // namespace

TEST_CASE("a file has its records in the order of the specification", "[mcap][unit]") {
  const std::string bytes = file_with(3);
  const auto records = test::records_of_file(bytes);
  CHECK(kinds(records) == std::vector<std::uint8_t>{header, schema, channel, channel, chunk,
                                                    message_index, message_index, data_end, schema,
                                                    channel, channel, statistics, chunk_index,
                                                    summary_offset, summary_offset, summary_offset,
                                                    summary_offset, footer});
  Fields head(records[0].body);
  CHECK(head.sized().empty());
  CHECK(head.sized() == "a program 1.0");
  Fields topic(records[3].body);
  CHECK(topic.number<std::uint16_t>() == 2);
  CHECK(topic.number<std::uint16_t>() == 1);
  CHECK(topic.sized() == "/second");
  CHECK(topic.sized() == "json");
}

TEST_CASE("a chunk has the messages that its index names, and the CRC of its bytes",
          "[mcap][unit]") {
  const std::string bytes = file_with(3);
  const auto records = test::records_of_file(bytes);
  Fields fields(of_kind(records, chunk)[0].body);
  CHECK(fields.number<std::uint64_t>() == 0);
  CHECK(fields.number<std::uint64_t>() == 2001);
  const auto size = fields.number<std::uint64_t>();
  const auto crc = fields.number<std::uint32_t>();
  CHECK(fields.sized() == "zstd");
  const std::string content = test::decompressed(fields.sized<std::uint64_t>(), size);
  CHECK(test::crc_of(content) == crc);
  const auto messages = test::records_of(content);
  REQUIRE(messages.size() == 6);

  Fields index(of_kind(records, message_index)[1].body);
  CHECK(index.number<std::uint16_t>() == 2);
  const std::string entries = index.sized();
  Fields entry(entries);
  for (std::uint64_t k = 0; k < 3; ++k) {
    CHECK(entry.number<std::uint64_t>() == 1000 * k + 1);
    CHECK(entry.number<std::uint64_t>() == messages[2 * k + 1].begin);
    Fields own(messages[2 * k + 1].body);
    CHECK(own.number<std::uint16_t>() == 2);
    CHECK(own.number<std::uint32_t>() == k);
    CHECK(own.number<std::uint64_t>() == 1000 * k + 1);
    CHECK(own.number<std::uint64_t>() == 1000 * k + 1);
    CHECK(own.rest() == "{\"k\": " + std::to_string(k) + "}");
  }
  CHECK(entry.rest().empty());
}

TEST_CASE("the summary finds each chunk, and its offsets each group of records", "[mcap][unit]") {
  const std::string bytes = file_with(40, 100000);
  const auto records = test::records_of_file(bytes);
  const auto chunks = of_kind(records, chunk);
  const auto indexes = of_kind(records, chunk_index);
  REQUIRE(chunks.size() == 4);
  REQUIRE(indexes.size() == 4);
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    Fields own(chunks[i].body), fields(indexes[i].body);
    CHECK(fields.number<std::uint64_t>() == own.number<std::uint64_t>());
    CHECK(fields.number<std::uint64_t>() == own.number<std::uint64_t>());
    CHECK(fields.number<std::uint64_t>() == chunks[i].begin);
    CHECK(fields.number<std::uint64_t>() == chunks[i].end - chunks[i].begin);
    const std::string offsets = fields.sized();
    for (Fields offset(offsets); !offset.rest().empty();) {
      const auto id = offset.number<std::uint16_t>();
      Fields index(std::string_view(bytes).substr(offset.number<std::uint64_t>()));
      CHECK(index.number<std::uint8_t>() == message_index);
      (void)index.number<std::uint64_t>();
      CHECK(index.number<std::uint16_t>() == id);
    }
  }
  for (const auto& record : of_kind(records, summary_offset)) {
    Fields fields(record.body);
    const auto op = fields.number<std::uint8_t>();
    const auto begin = fields.number<std::uint64_t>(), length = fields.number<std::uint64_t>();
    for (const auto& one : test::records_of(std::string_view(bytes).substr(begin, length)))
      CHECK(one.op == op);
  }
}

TEST_CASE("the CRCs of data and summary are those of their bytes", "[mcap][unit]") {
  const std::string bytes = file_with(5);
  const auto records = test::records_of_file(bytes);
  const auto end = of_kind(records, data_end)[0];
  CHECK(Fields(end.body).number<std::uint32_t>() ==
        test::crc_of(std::string_view(bytes).substr(0, end.begin)));
  Fields last(records.back().body);
  const auto summary = last.number<std::uint64_t>();
  CHECK(summary == end.end);
  CHECK(last.number<std::uint64_t>() == of_kind(records, summary_offset)[0].begin);
  // Up to the CRC itself, which is followed by the magic.
  CHECK(last.number<std::uint32_t>() ==
        test::crc_of(std::string_view(bytes).substr(summary, bytes.size() - 8 - 4 - summary)));
}

TEST_CASE("the statistics count messages by channel, and a file may have none", "[mcap][unit]") {
  for (const int steps : {0, 7}) {
    CAPTURE(steps);
    const auto bytes = file_with(steps);
    Fields fields(of_kind(test::records_of_file(bytes), statistics)[0].body);
    CHECK(fields.number<std::uint64_t>() == 2 * static_cast<std::uint64_t>(steps));
    CHECK(fields.number<std::uint16_t>() == 1);
    CHECK(fields.number<std::uint32_t>() == 2);
    CHECK(fields.number<std::uint32_t>() == 0);
    CHECK(fields.number<std::uint32_t>() == 0);
    CHECK(fields.number<std::uint32_t>() == (steps > 0 ? 1U : 0U));
    CHECK(fields.number<std::uint64_t>() == 0);
    CHECK(fields.number<std::uint64_t>() == (steps > 0 ? 6001U : 0U));
    const std::string counts = fields.sized();
    Fields count(counts);
    for (const int id : {1, 2}) {
      CHECK(count.number<std::uint16_t>() == id);
      CHECK(count.number<std::uint64_t>() == static_cast<std::uint64_t>(steps));
    }
  }
}

TEST_CASE("equal calls give equal bytes", "[mcap][unit]") {
  CHECK(file_with(40, 100000) == file_with(40, 100000));
}
