#include "hamelin/log/run_log.hpp"
#include "hamelin/test/skip.hpp"
#include "hamelin/test/temporary.hpp"

#include <catch2/catch.hpp>
#include <fstream>
#include <limits>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/log/result.hpp"
#include "ticks.hpp"

using namespace hamelin;
using test::tick;
namespace fs = std::filesystem;
using Catch::Matchers::Contains;

namespace {

// A directory of its own for each test, empty at first.
fs::path fresh_directory(const std::string& name) {
  const fs::path directory = test::temporary("log_" + name);
  fs::remove_all(directory);
  fs::create_directories(directory);
  return directory;
}

void put(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

const Json header = {
    {"program", "integrate"},   {"scene", "a.json"},       {"every", 1},
    {"config", Json::object()}, {"joints", Json::array()}, {"provenance", Json::object()}};

log::Result result() {
  log::Result r;
  r.scene = "a.json";
  r.integrator = "rk4";
  return r;
}

std::string check_error(const fs::path& file) {
  try {
    log::check_log(file);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a log is read back line by line and fits its schema", "[log][unit]") {
  const auto file = fresh_directory("whole") / "run.jsonl";
  {
    log::RunLog record(file);
    record.write("header", header);
    record.write("tick", tick(0));
    record.write("event", {{"time_s", 0.0}, {"text", "hello"}});
    record.write("tick", tick(1));
    record.write("result", log::to_json(result()));
  }
  const auto log = log::read_log(file);
  REQUIRE(log.lines.size() == 5);
  CHECK_FALSE(log.cut);
  CHECK(log.lines[0]["schema"] == "hamelin.run/1");
  CHECK(log.lines[1]["q"] == Json({0.1}));
  CHECK(log.lines[4]["outcome"] == "completed");
  for (const auto& line : log.lines) CHECK_NOTHROW(check_shipped_schema(line, "run", "line"));
  const auto summary = log::check_log(file);
  CHECK(summary.ticks == 2);
  CHECK(summary.events == 1);
  CHECK(summary.has_result);
  CHECK_FALSE(summary.cut);
}

TEST_CASE("every line is in the file as soon as it is written", "[log][unit]") {
  const auto file = fresh_directory("flushed") / "run.jsonl";
  log::RunLog record(file);
  record.write("header", header);
  CHECK(log::read_log(file).lines.size() == 1);
  record.write("tick", tick(0));
  CHECK(log::read_log(file).lines.size() == 2);
}

TEST_CASE("doubles come back bit for bit", "[log][unit]") {
  const auto file = fresh_directory("bits") / "run.jsonl";
  const std::vector<double> numbers = {0.1, 1.0 / 3.0, 5e-324, -1.7976931348623157e308,
                                       6.02214076e23};
  log::RunLog record(file);
  Json fields = tick(0);
  fields["q"] = numbers;
  record.write("tick", fields);
  CHECK(log::read_log(file).lines.at(0)["q"].get<std::vector<double>>() == numbers);
}

TEST_CASE("non-finite numbers are written as null and named in an event", "[log][unit]") {
  const auto file = fresh_directory("nan") / "run.jsonl";
  {
    log::RunLog record(file);
    record.write("header", header);
    Json fields = tick(0);
    fields["q"][0] = std::numeric_limits<double>::quiet_NaN();
    fields["energy"]["kinetic_J"] = -std::numeric_limits<double>::infinity();
    record.write("tick", fields);
  }
  const auto log = log::read_log(file);
  REQUIRE(log.lines.size() == 3);
  CHECK(log.lines[1]["q"][0].is_null());
  CHECK(log.lines[1]["energy"]["kinetic_J"].is_null());
  CHECK(log.lines[2]["type"] == "event");
  CHECK_THAT(log.lines[2]["text"].get<std::string>(),
             Contains("/q/0 is nan") && Contains("/energy/kinetic_J is -inf"));
  CHECK_NOTHROW(log::check_log(file));
}

TEST_CASE("an incomplete line at the end is skipped, the lines before it are read", "[log][unit]") {
  const auto file = fresh_directory("cut") / "run.jsonl";
  {
    log::RunLog record(file);
    record.write("header", header);
    record.write("tick", tick(0));
    record.write("tick", tick(1));
  }
  fs::resize_file(file, fs::file_size(file) - 20);
  const auto log = log::read_log(file);
  CHECK(log.cut);
  CHECK(log.lines.size() == 2);
  const auto summary = log::check_log(file);
  CHECK(summary.cut);
  CHECK(summary.ticks == 1);
  CHECK_FALSE(summary.has_result);
}

TEST_CASE("a broken line before the end is an error that names it", "[log][unit]") {
  const auto file = fresh_directory("broken") / "run.jsonl";
  put(file, "{\"type\":\"header\"}\n{\"type\":\n{}\n");
  CHECK_THROWS_WITH(log::read_log(file), Contains("run.jsonl: line 2"));
}

TEST_CASE("check_log names the line that breaks the rules", "[log][unit]") {
  const auto directory = fresh_directory("rules");
  const auto file = directory / "run.jsonl";
  const auto with = [&](const std::vector<std::pair<const char*, Json>>& lines) {
    fs::remove(file);
    log::RunLog record(file);
    for (const auto& [type, fields] : lines) record.write(type, fields);
    return check_error(file);
  };
  CHECK(with({{"header", header}, {"tick", tick(0)}}).empty());
  CHECK_THAT(with({{"tick", tick(0)}}), Contains("line 1") && Contains("a header on line 1"));
  CHECK_THAT(with({{"header", header}, {"header", header}}), Contains("line 2"));
  CHECK_THAT(with({{"header", header}, {"tick", tick(1)}, {"tick", tick(1)}}),
             Contains("line 3: /k") && Contains("increasing"));
  CHECK_THAT(with({{"header", header}, {"result", log::to_json(result())}, {"tick", tick(0)}}),
             Contains("line 3"));
  CHECK_THAT(with({{"header", header}, {"note", header}}), Contains("line 2") && Contains("note"));
  Json extra = tick(1);
  extra["speed"] = 1;
  CHECK_THAT(with({{"header", header}, {"tick", tick(0)}, {"tick", extra}}),
             Contains("line 3") && Contains("speed"));
  Json short_tick = tick(0);
  short_tick.erase("q");
  CHECK_THAT(with({{"header", header}, {"tick", short_tick}}),
             Contains("line 2") && Contains("'q' is missing"));
  put(file, "");
  CHECK_THAT(check_error(file), Contains("no complete line"));
}

TEST_CASE("a log named .zst is compressed, and read back as the same lines", "[log][zstd]") {
  const auto directory = fresh_directory("zstd");
  for (const char* name : {"run.jsonl", "run.jsonl.zst"}) {
    log::RunLog record(directory / name);
    record.write("header", header);
    for (long k = 0; k < 1000; ++k) record.write("tick", tick(k));
    record.write("result", log::to_json(result()));
  }
  CHECK(log::read_log(directory / "run.jsonl.zst").lines ==
        log::read_log(directory / "run.jsonl").lines);
  CHECK(log::check_log(directory / "run.jsonl.zst").ticks == 1000);
  CHECK(fs::file_size(directory / "run.jsonl.zst") * 3 < fs::file_size(directory / "run.jsonl"));
}

TEST_CASE("a compressed log has its header at once, and a crash loses at most a frame of lines",
          "[log][zstd]") {
  const auto file = fresh_directory("frames") / "run.jsonl.zst";
  log::RunLog record(file);
  record.write("header", header);
  CHECK(log::read_log(file).lines.size() == 1);
  const long ticks = static_cast<long>(log::RunLog::lines_per_frame) + 10;
  for (long k = 0; k < ticks; ++k) record.write("tick", tick(k));
  CHECK(log::read_log(file).lines.size() == 1 + log::RunLog::lines_per_frame);
  record.flush();
  CHECK(log::read_log(file).lines.size() == 1 + static_cast<std::size_t>(ticks));
}

TEST_CASE("a log cut anywhere is read up to its last complete line or frame", "[log][zstd]") {
  const auto directory = fresh_directory("cuts");
  for (const char* name : {"run.jsonl", "run.jsonl.zst"}) {
    CAPTURE(name);
    std::vector<std::uintmax_t> ends = {0};  // of complete lines or frames [bytes]
    std::vector<std::size_t> lines = {0};
    {
      log::RunLog record(directory / name);
      const auto write = [&](const char* type, const Json& fields) {
        record.write(type, fields);
        const auto size = fs::file_size(directory / name);
        lines.push_back(lines.back());
        if (size != ends.back()) lines.back() = ends.size();
        ends.push_back(size);
      };
      write("header", header);
      for (long k = 0; k < 700; ++k) write("tick", tick(k));
      write("result", log::to_json(result()));
    }
    const std::string content = read_file(directory / name);
    const auto all = log::read_log(directory / name).lines;
    Rng random(7);
    for (int i = 0; i < 200; ++i) {
      const auto at =
          static_cast<std::uintmax_t>(random.uniform(0.0, static_cast<double>(content.size())));
      CAPTURE(at);
      put(directory / "cut", content.substr(0, at));
      // the last write that ended before the cut
      std::size_t expected = 0;
      bool clean = at == 0;
      for (std::size_t n = 1; n < ends.size(); ++n) {
        if (ends[n] <= at) expected = lines[n];
        clean = clean || ends[n] == at;
      }
      const auto read = log::read_log(directory / "cut");
      REQUIRE(read.lines.size() == expected);
      CHECK(read.cut != clean);
      CHECK(std::equal(read.lines.begin(), read.lines.end(), all.begin()));
    }
  }
}

TEST_CASE("a damaged frame is named", "[log][zstd]") {
  const auto directory = fresh_directory("damaged");
  const auto file = directory / "run.jsonl.zst";
  {
    log::RunLog record(file);
    record.write("header", header);
    for (long k = 0; k < 600; ++k) record.write("tick", tick(k));
  }
  std::string bytes = read_file(file);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 0x10);
  put(file, bytes);
  CHECK_THROWS_WITH(log::read_log(file),
                    Contains("run.jsonl.zst: frame ") && Contains("is damaged"));
}

TEST_CASE("a small file that expands to a huge one is refused", "[log][zstd]") {
  const auto file = fresh_directory("bomb") / "run.jsonl.zst";
  const auto record = [&](std::size_t lines, std::size_t bytes) {
    log::RunLog log(file);
    log.write("header", header);
    for (std::size_t i = 0; i < lines; ++i)
      log.write("event", {{"time_s", 0.0}, {"text", std::string(bytes, 'x')}});
  };
  record(1, 4U << 20);
  CHECK_THROWS_WITH(log::read_log(file), Contains("run.jsonl.zst: line 2: has more than "));
  record(40, 900U << 10);
  REQUIRE(fs::file_size(file) < 100000);
  CHECK_THROWS_WITH(log::read_log(file), Contains("decompresses to more than 200 times its size"));
  CHECK_THROWS_WITH(log::LogReader("/dev/zero"), "/dev/zero: is a device, expected a file");
}

TEST_CASE("the estimated size is correct to a factor of two", "[log][unit]") {
  const auto directory = fresh_directory("size");
  for (const int dof : {3, 7, 20})
    for (const char* name : {"run.jsonl", "run.jsonl.zst"}) {
      CAPTURE(dof, name);
      Rng random(3);
      {
        log::RunLog record(directory / name);
        for (long k = 0; k < 2000; ++k) {
          Json fields = tick(k);
          const auto numbers = [&] {
            std::vector<double> some(static_cast<std::size_t>(dof));
            for (auto& number : some) number = random.uniform(-1.0, 1.0);
            return some;
          };
          for (const char* key : {"q", "v", "tau"}) fields[key] = numbers();
          for (const char* key : {"held", "node"}) fields["channels"][key] = numbers();
          for (auto& [key, value] : fields["energy"].items()) value = random.uniform(0.0, 1.0);
          record.write("tick", fields);
        }
      }
      const double size = static_cast<double>(fs::file_size(directory / name));
      const double estimated =
          log::estimated_bytes(dof, 2000.0, std::string(name).ends_with(".zst"));
      CHECK(estimated < 2.0 * size);
      CHECK(estimated > 0.5 * size);
    }
}

TEST_CASE("an unwritable path is refused before anything is written", "[log][unit]") {
  const auto directory = fresh_directory("unwritable");
  CHECK_THROWS_WITH(log::RunLog(directory / "absent" / "run.jsonl"),
                    Contains("run.jsonl: cannot be written: No such file"));
  CHECK_THROWS_WITH(log::RunLog(directory), Contains("Is a directory"));
  CHECK_THROWS_AS(log::check_writable(directory / "absent" / "x"), Error);
}

TEST_CASE("a full disk is an error that names the file", "[log][unit]") {
  test::skip_unless(fs::exists("/dev/full"), "this system has no /dev/full");
  log::RunLog record("/dev/full");
  CHECK_THROWS_WITH(record.write("header", header), Contains("/dev/full: cannot be written"));
}

TEST_CASE("a log without lines creates no file and leaves an old one unchanged", "[log][unit]") {
  const auto directory = fresh_directory("untouched");
  { const log::RunLog record(directory / "new.jsonl"); }
  CHECK_FALSE(fs::exists(directory / "new.jsonl"));
  put(directory / "old.jsonl", "kept\n");
  { const log::RunLog record(directory / "old.jsonl"); }
  CHECK(read_file(directory / "old.jsonl") == "kept\n");
}

TEST_CASE("provenance names machine, build and inputs with their hashes", "[log][unit]") {
  const auto file = fresh_directory("provenance") / "input.txt";
  put(file, "abc");
  const Json p = log::provenance({{"robot", file}}, {"hamelin", "run"});
  // FIPS 180-2, appendix B.1
  CHECK(p["inputs"][0]["sha256"] ==
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(p["inputs"][0]["path"] == file.string());
  CHECK(p["inputs"][0]["role"] == "robot");
  CHECK(p["build"]["id"].get<std::string>().size() == 40);
  CHECK(p["host"]["cores"].get<long>() >= 1);
  CHECK_FALSE(p["isa"].get<std::string>().empty());
  CHECK_FALSE(p["build"]["compiler"].get<std::string>().empty());
  CHECK(p["versions"]["hamelin"] == std::string(version()));
  CHECK(p["argv"] == Json({"hamelin", "run"}));
  CHECK_THROWS_AS(log::provenance({{"map", file.parent_path() / "absent"}}), Error);
}

TEST_CASE("the tick in docs/logs.md fits its schema", "[log][docs]") {
  const std::string page = read_file(fs::path(HAMELIN_SOURCE_DIR) / "docs/logs.md");
  const auto begin = page.find("```json\n") + 8;
  const Json tick = parse_json(page.substr(begin, page.find("```", begin) - begin), "docs/logs.md");
  CHECK(tick["type"] == "tick");
  CHECK_NOTHROW(log::check_line(tick, "docs/logs.md"));
  // tau is the sum of its channels
  for (std::size_t i = 0; i < tick["tau"].size(); ++i) {
    double sum = 0.0;
    for (const auto& [channel, torque] : tick["channels"].items()) sum += torque[i].get<double>();
    CHECK(sum == Approx(tick["tau"][i].get<double>()).epsilon(1e-14));
  }
}
