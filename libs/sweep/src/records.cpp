#include "hamelin/sweep/records.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <numeric>

#include "hamelin/core/error.hpp"

namespace hamelin::sweep {

namespace fs = std::filesystem;

namespace {

// Whether a file name is records.jsonl or records-I-of-N.jsonl.
bool is_records_name(std::string_view name) {
  constexpr std::string_view prefix = "records", suffix = ".jsonl", between = "-of-";
  if (!name.starts_with(prefix) || !name.ends_with(suffix)) return false;
  name.remove_prefix(prefix.size());
  name.remove_suffix(suffix.size());
  if (name.empty()) return true;
  const auto middle = name.find(between);
  const auto is_number = [](std::string_view text) {
    return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
  };
  return name.front() == '-' && middle != std::string_view::npos && middle >= 1 &&
         is_number(name.substr(1, middle - 1)) && is_number(name.substr(middle + between.size()));
}

// Whether a line has the members that the code in this library reads; `hamelin validate` checks the
// whole schema.
bool is_record(const Json& line) {
  const auto has = [&](const char* key) { return line.contains(key); };
  const auto text = [&](const char* key) { return has(key) && line[key].is_string(); };
  const auto object_or_null = [&](const char* key) {
    return has(key) && (line[key].is_object() || line[key].is_null());
  };
  return line.is_object() && line.value("schema", Json()) == "hamelin.record/1" && text("plan") &&
         text("id") && text("outcome") && has("cause") && object_or_null("result") &&
         object_or_null("judge") &&
         (line["judge"].is_null() ||
          (line["judge"].contains("obstacles") && line["judge"].contains("self")));
}

}  // namespace

fs::path records_file(const fs::path& directory) {
  return directory / "records.jsonl";
}

fs::path records_file(const fs::path& directory, const Shard& shard) {
  return directory / fmt::format("records-{}-of-{}.jsonl", shard.index, shard.count);
}

std::vector<fs::path> record_files(const fs::path& directory) {
  std::vector<fs::path> files;
  std::error_code ec;
  for (fs::directory_iterator at(directory, ec), end; !ec && at != end; at.increment(ec)) {
    if (is_records_name(at->path().filename().string()) && at->is_regular_file(ec))
      files.push_back(at->path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

RunIndex::RunIndex(const Plan& plan) : plan_(&plan), by_id_(plan.runs.size()) {
  std::iota(by_id_.begin(), by_id_.end(), std::size_t{0});
  std::sort(by_id_.begin(), by_id_.end(),
            [&](std::size_t a, std::size_t b) { return plan.runs[a].id < plan.runs[b].id; });
}

std::size_t RunIndex::find(std::string_view id) const {
  const auto found = std::lower_bound(
      by_id_.begin(), by_id_.end(), id,
      [&](std::size_t run, std::string_view text) { return plan_->runs[run].id < text; });
  return found != by_id_.end() && plan_->runs[*found].id == id ? *found : plan_->runs.size();
}

namespace {

// Passes on each complete line of a file with its number. A file that does not exist has no lines.
RecordsEnd for_each_line(
    const fs::path& file,
    const std::function<void(const std::string& line, std::size_t number)>& visit) {
  RecordsEnd end;
  std::error_code ec;
  if (!fs::exists(file, ec)) return end;
  std::ifstream in(file, std::ios::binary);
  if (!in)
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be opened: {}", file.string(), std::strerror(errno)));
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    end.truncated = in.eof();  // the line has no end: it is still being written, or was cut
    if (end.truncated) break;
    visit(line, number);
    end.complete_bytes += line.size() + 1;
  }
  if (in.bad())
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be read: {}", file.string(), std::strerror(errno)));
  return end;
}

std::string place(const fs::path& file, std::size_t number) {
  return fmt::format("{}: line {}", file.string(), number);
}

// The run of an id that the plan must have.
std::size_t planned_run(const RunIndex& runs, std::string_view id, const fs::path& file,
                        std::size_t number) {
  const std::size_t run = runs.find(id);
  if (run == runs.plan().runs.size())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: run '{}' is not in the plan, expected a planned run",
                            place(file, number), id));
  return run;
}

std::size_t checked_run(const Json& record, const RunIndex& runs, const fs::path& file,
                        std::size_t number) {
  if (!is_record(record))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is not a record, expected hamelin.record/1", place(file, number)));
  if (record["plan"] != runs.plan().sha256)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: belongs to another plan, expected records of the current {}",
                            place(file, number), plan_file(file.parent_path()).string()));
  return planned_run(runs, record["id"].get_ref<const std::string&>(), file, number);
}

}  // namespace

RecordsEnd read_records(const fs::path& file, const RunIndex& runs,
                        const std::function<void(PlacedRecord&&)>& visit) {
  std::vector<bool> seen(runs.plan().runs.size(), false);
  std::uint64_t offset = 0;
  return for_each_line(file, [&](const std::string& line, std::size_t number) {
    PlacedRecord placed{parse_json(line, place(file, number)), 0, offset, line.size()};
    placed.run = checked_run(placed.record, runs, file, number);
    if (seen[placed.run])
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: run '{}' is recorded twice, expected once", place(file, number),
                              runs.plan().runs[placed.run].id));
    seen[placed.run] = true;
    offset += line.size() + 1;
    visit(std::move(placed));
  });
}

void read_recorded_runs(const fs::path& file, const RunIndex& runs,
                        const std::function<void(std::size_t run)>& visit) {
  const std::string begin =
      fmt::format(R"({{"schema":"hamelin.record/1","plan":"{}","id":)", runs.plan().sha256);
  (void)for_each_line(file, [&](const std::string& line, std::size_t number) {
    const auto end = line.find(R"(","labels":)", begin.size());
    if (!line.starts_with(begin) || end == std::string::npos || line.back() != '}')
      return visit(checked_run(parse_json(line, place(file, number)), runs, file, number));
    const Json id = parse_json(std::string_view(line).substr(begin.size(), end + 1 - begin.size()),
                               place(file, number));
    visit(planned_run(runs, id.get<std::string>(), file, number));
  });
}

std::string repeatable_text(Json record, const PlannedRun& run) {
  if (Json& result = record["result"]; result.is_object()) {
    for (const char* key : {"timing", "provenance"})
      if (result.contains(key)) result[key] = nullptr;
    if (result.contains("scene")) result["scene"] = run.scene;
  }
  return record.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace hamelin::sweep
