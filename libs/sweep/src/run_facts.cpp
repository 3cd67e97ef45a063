#include "hamelin/sweep/run_facts.hpp"

#include <fmt/format.h>

#include <set>
#include <string_view>

#include "hamelin/sweep/failure_class.hpp"

namespace hamelin::sweep {

namespace {

std::optional<double> figure_at(const Json& object, const char* key) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_number()) return std::nullopt;
  return object[key].get<double>();
}

const Json& member(const Json& object, const char* key) {
  static const Json none;
  if (!object.is_object()) return none;
  const auto found = object.find(key);
  return found == object.end() ? none : *found;
}

std::string csv_field(const std::string& field) {
  if (field.find_first_of(",\"\r\n") == std::string::npos) return field;
  std::string out(1, '"');
  for (const char c : field) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + '"';
}

std::string shown(const std::optional<double>& value) {
  return value ? fmt::format("{}", *value) : "";
}

/// The names of all columns that depend on the sweep.
struct ColumnNames {
  std::set<std::string> labels, varied, gains;
};

ColumnNames columns_of(const std::vector<MergedRun>& runs) {
  ColumnNames columns;
  for (const auto& r : runs) {
    for (const auto& [name, value] : r.run.labels) columns.labels.insert(name);
    for (const auto& [pointer, value] : varied_values(r.run)) columns.varied.insert(pointer);
    for (const auto& [name, value] : r.run.gains) columns.gains.insert(name);
  }
  return columns;
}

class CsvWriter {
 public:
  void add(const std::string& field) {
    if (!first_) text_ += ',';
    text_ += csv_field(field);
    first_ = false;
  }
  void end_line() {
    text_ += '\n';
    first_ = true;
  }
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string text_;
  bool first_ = true;
};

void write_run(CsvWriter& csv, const MergedRun& r, const ColumnNames& columns) {
  const auto found = [](const auto& map, const std::string& key) {
    const auto at = map.find(key);
    return at == map.end() ? std::nullopt : std::optional(at->second);
  };
  csv.add(r.run.id);
  csv.add(r.directory.string());
  for (const auto& name : columns.labels) csv.add(found(r.run.labels, name).value_or(""));
  const auto varied = varied_values(r.run);
  const std::map<std::string, std::string> by_pointer(varied.begin(), varied.end());
  for (const auto& pointer : columns.varied) csv.add(found(by_pointer, pointer).value_or(""));
  for (const auto& name : columns.gains) csv.add(shown(found(r.run.gains, name)));
  const RunFacts facts = facts_of(r.record);
  csv.add(r.feasible ? "true" : "false");
  for (const auto& field : {r.reason, facts.outcome, facts.failure, facts.cause}) csv.add(field);
  for (const auto& value : {facts.time_s, facts.clearance_m, facts.self_clearance_m,
                            facts.certified_share, facts.tick_us_p50, facts.tick_us_p99})
    csv.add(shown(value));
  csv.add(facts.contact);
  csv.end_line();
}

}  // namespace

RunFacts facts_of(const Json& record) {
  RunFacts facts;
  if (record.is_null()) return facts;
  facts.recorded = true;
  facts.outcome = record["outcome"];
  if (record["cause"].is_string()) facts.cause = record["cause"];
  facts.failure = failure_class(record);
  facts.contact = judged_contact(record);
  const Json &result = record["result"], &judge = record["judge"];
  facts.time_s = figure_at(result, "time_s");
  facts.certified_share = figure_at(result, "certified_share");
  facts.clearance_m = figure_at(member(judge, "obstacles"), "clearance_m");
  facts.self_clearance_m = figure_at(member(judge, "self"), "clearance_m");
  const Json& tick = member(member(result, "timing"), "tick_us");
  facts.tick_us_p50 = figure_at(tick, "p50");
  facts.tick_us_p99 = figure_at(tick, "p99");
  return facts;
}

std::vector<std::pair<std::string, std::string>> varied_values(const PlannedRun& run) {
  std::vector<std::pair<std::string, std::string>> values;
  const auto label = run.labels.find("values");
  if (label == run.labels.end()) return values;
  // The varied values are the last of `set`, joined by blanks in the label.
  std::string joined;
  for (auto at = run.set.rbegin(); at != run.set.rend() && joined != label->second; ++at) {
    joined = joined.empty() ? *at : fmt::format("{} {}", *at, joined);
    const auto equal = at->find('=');
    values.insert(values.begin(),
                  {at->substr(0, equal), equal == std::string::npos ? "" : at->substr(equal + 1)});
  }
  if (joined != label->second) values.clear();
  return values;
}

std::string to_csv(const Merged& merged) {
  const ColumnNames columns = columns_of(merged.sweeps.runs);
  CsvWriter csv;
  for (const char* name : {"id", "directory"}) csv.add(name);
  for (const auto* names : {&columns.labels, &columns.varied, &columns.gains})
    for (const auto& name : *names) csv.add(name);
  for (const char* name :
       {"feasible", "reason", "outcome", "failure", "cause", "time_s", "clearance_m",
        "self_clearance_m", "certified_share", "tick_us_p50", "tick_us_p99", "judge"})
    csv.add(name);
  csv.end_line();
  for (const auto& r : merged.sweeps.runs) write_run(csv, r, columns);
  return csv.take();
}

}  // namespace hamelin::sweep
