#include "moving_results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <tuple>

#include "hamelin/bench/moving_scene.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::bench {

namespace fs = std::filesystem;

namespace {

using Row = std::vector<std::string>;

constexpr double resting_speed_m_s = 2e-3;

void add_verdict(const fs::path& file, ContactCounts& counts) {
  if (!fs::exists(file)) return;
  const Json document = read_json(file);
  check_shipped_schema(document, "explanation", file.string());
  if (document["verdict"].is_string()) ++counts.verdicts[document["verdict"].get<std::string>()];
}

// Families in their order, then by the number of obstacles and their speed.
auto rank(const Row& key) {
  const auto& families = moving_families();
  return std::tuple(std::find(families.begin(), families.end(), key[0]) - families.begin(),
                    std::stod(key[1]), std::stod(key[2]));
}

std::size_t verdicts_of(const ContactCounts& counts, const char* verdict) {
  const auto found = counts.verdicts.find(verdict);
  return found == counts.verdicts.end() ? 0 : found->second;
}

}  // namespace

fs::path explanation_file(const fs::path& directory, const std::string& run_id) {
  std::string name;
  for (const char c : run_id)
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' ? c : '-';
  constexpr std::size_t digits = 8;  // of a hash, as different ids may have the same name
  return directory / "contacts" /
         fmt::format("{}-{}.json", name, sha256_hex(run_id).substr(0, digits));
}

void name_predictions(sweep::Sweeps& sweeps) {
  for (auto& run : sweeps.runs) {
    auto& labels = run.run.labels;
    if (const auto& prediction = labels[prediction_label];
        prediction != describe(PredictionChoice{}))
      labels["planner"] += ", " + prediction;
  }
}

std::map<std::string, ContactCounts> count_contacts(const sweep::Sweeps& sweeps,
                                                    const fs::path& directory) {
  std::map<std::string, ContactCounts> by_planner;
  for (const auto& run : sweeps.runs) {
    ContactCounts& counts = by_planner[run.run.labels.at("planner")];
    if (run.facts.outcome != "collision") continue;
    const auto& speed = run.facts.contact_arm_speed_m_s;
    ++(!speed ? counts.other : *speed < resting_speed_m_s ? counts.resting : counts.moving);
    add_verdict(explanation_file(directory, run.run.id), counts);
  }
  return by_planner;
}

TextTable cell_table(const Results& results) {
  TextTable table{{"family", "obstacles", "m/s"}, {}, 1};
  table.head.insert(table.head.end(), results.planners.begin(), results.planners.end());
  std::set<Row> cells;
  std::map<Row, const sweep::Group*> groups;
  for (const auto& group : results.by_family.groups) {
    cells.insert({group.key[0], group.key[1], group.key[2]});
    groups[group.key] = &group;
  }
  std::vector<Row> ordered(cells.begin(), cells.end());
  std::sort(ordered.begin(), ordered.end(),
            [](const Row& a, const Row& b) { return rank(a) < rank(b); });
  for (const auto& cell : ordered) {
    Row row = cell;
    for (const auto& planner : results.planners) {
      const auto found = groups.find({cell[0], cell[1], cell[2], planner});
      const bool any = found != groups.end() && found->second->runs > 0;
      row.push_back(any ? fmt::format("{}/{}", found->second->reached, found->second->feasible)
                        : "-");
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

TextTable contact_table(const Results& results) {
  TextTable table{{"contacts of", "arm moves", "arm at rest", "other", "avoidable", "in hindsight",
                   "unavoidable"},
                  {}};
  for (const auto& planner : results.planners) {
    const ContactCounts& c = results.contacts.at(planner);
    Row row{planner, fmt::format("{}", c.moving), fmt::format("{}", c.resting),
            fmt::format("{}", c.other)};
    for (const char* verdict : {"avoidable", "avoidable_in_hindsight", "unavoidable"})
      row.push_back(c.verdicts.empty() ? "-" : fmt::format("{}", verdicts_of(c, verdict)));
    table.rows.push_back(std::move(row));
  }
  return table;
}

Json contacts_json(const Results& results) {
  Json all = Json::array();
  for (const auto& planner : results.planners) {
    const ContactCounts& c = results.contacts.at(planner);
    all.push_back({{"planner", planner},
                   {"arm_moves", c.moving},
                   {"arm_at_rest", c.resting},
                   {"other", c.other},
                   {"avoidable", verdicts_of(c, "avoidable")},
                   {"avoidable_in_hindsight", verdicts_of(c, "avoidable_in_hindsight")},
                   {"unavoidable", verdicts_of(c, "unavoidable")}});
  }
  return all;
}

}  // namespace hamelin::bench
