#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "hamelin/study/merge.hpp"
#include "html.hpp"

namespace hamelin::study {

namespace {

// Colours after Okabe and Ito, told apart by the colour-blind too; shapes differ as well.
constexpr std::string_view sweep_page_style = R"css(
:root { --reached: #00845f; --contact: #c8480a; --stalled: #c98600; --timeout: #3b8fd0; --other: #8a8a8a; }
@media (prefers-color-scheme: dark) { :root { --reached: #2fc79a; --contact: #ff7a45; --stalled: #f0b429;
  --timeout: #6cb8f2; --other: #8f979f; } }
td.cause { white-space: normal; min-width: 16rem; text-align: left; }
tr.bad td.contacts { color: var(--contact); font-weight: 700; }
td code { display: block; max-width: 46rem; white-space: pre-wrap; overflow-wrap: anywhere; text-align: left; }
.reached { fill: var(--reached); } .contact { stroke: var(--contact); stroke-width: 2; fill: none; }
.stalled { stroke: var(--stalled); stroke-width: 1.7; fill: none; } .timeout { fill: var(--timeout); }
.other { fill: var(--other); } .bar { fill: var(--reached); opacity: .8; } .track { fill: var(--line); opacity: .6; }
.whisker { stroke: var(--ink); stroke-width: 1.4; fill: none; }
)css";

std::string shown(const std::optional<double>& value, double scale, int digits) {
  return value ? fmt::format("{:.{}f}", scale * *value, digits) : "–";
}

double percent(std::size_t part, std::size_t all) {
  return all > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(all) : 0.0;
}

/// A share as a bar with its interval as a whisker.
std::string bar(double share, const Interval& interval) {
  constexpr double width = 130.0;
  const double at = width * share, low = width * interval.low, high = width * interval.high;
  return fmt::format(
      "<svg width=\"{0:.0f}\" height=\"16\" role=\"img\" aria-label=\"{1:.1f} %, 95 % interval {2:.1f} to {3:.1f} %\">"
      "<rect class=\"track\" y=\"3\" width=\"{0:.0f}\" height=\"10\" rx=\"2\"/>"
      "<rect class=\"bar\" y=\"3\" width=\"{4:.1f}\" height=\"10\" rx=\"2\"/>"
      "<path class=\"whisker\" d=\"M{5:.1f} 8H{6:.1f}M{5:.1f} 4v8M{6:.1f} 4v8\"/></svg>",
      width, 100.0 * share, 100.0 * interval.low, 100.0 * interval.high, at, low + 0.7, high - 0.7);
}

std::string success_table(const Merged& merged) {
  std::string html =
      "<h2>Success</h2>\n<p>Reached: share of the feasible runs that arrived without contact, with Wilson’s 95 % "
      "interval. Feasible: start and goal free of the map by a checker of its own. Contacts and clearance: by the "
      "judge, "
      "on the exact primitives where the scene has them. Times are medians; tick: median over runs of each run’s p50 "
      "and "
      "p99.</p>\n<div class=\"wide\"><table>\n<thead><tr>";
  for (const auto& label : merged.by) html += head_cell(escaped(label), true);
  for (const char* head : {"runs", "feasible", "reached", "%"}) html += head_cell(head);
  html += head_cell("0 % … 100 %", true);
  for (const char* head : {"stalled", "timeout", "collision", "other", "contacts<br>judged", "least clearance<br>[mm]",
                           "of itself<br>[mm]", "certified [%]<br>mean / least", "arrival<br>[s]",
                           "tick [µs]<br>p50 / p99", "recovery<br>work [J]"})
    html += head_cell(head);
  html += "</tr></thead>\n<tbody>\n";
  for (const auto& g : merged.groups) {
    const auto count = [&](const char* name) {
      const auto found = g.outcomes.find(name);
      return found == g.outcomes.end() ? std::size_t{0} : found->second;
    };
    const std::size_t stalled = count("stalled"), timeout = count("timeout"), collided = count("collision");
    html += g.contacts > 0 ? "<tr class=\"bad\">" : "<tr>";
    for (const auto& value : g.key) html += cell(escaped(value), "text");
    html += cell(g.runs == g.planned ? fmt::format("{}", g.runs) : fmt::format("{} of {}", g.runs, g.planned));
    html += cell(fmt::format("{}", g.feasible)) + cell(fmt::format("{}", g.reached));
    html += cell(g.feasible > 0 ? fmt::format("{:.1f}", percent(g.reached, g.feasible)) : "–");
    html += cell(g.feasible > 0 ? bar(0.01 * percent(g.reached, g.feasible), g.reached_interval) : "", "text");
    for (const std::size_t n : {stalled, timeout, collided, g.runs - g.reached_all - stalled - timeout - collided})
      html += cell(fmt::format("{}", n));
    html += cell(g.judged > 0 ? fmt::format("{}", g.contacts) : "–", "contacts");
    html += cell(shown(g.min_clearance_m, 1e3, 2)) + cell(shown(g.min_self_clearance_m, 1e3, 2)) +
            cell(shown(g.certified_share_mean, 100.0, 3) + " / " + shown(g.certified_share_min, 100.0, 2)) +
            cell(shown(g.reached_time_s_median, 1.0, 2)) +
            cell(shown(g.tick_us_p50_median, 1.0, 1) + " / " + shown(g.tick_us_p99_median, 1.0, 1)) +
            cell(shown(g.recovery_work_J_median, 1.0, 4)) + "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string causes_table(const Merged& merged) {
  std::string rows;
  for (const auto& g : merged.groups) {
    std::vector<std::pair<std::string, std::size_t>> causes(g.causes.begin(), g.causes.end());
    std::stable_sort(causes.begin(), causes.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
    for (const auto& [cause, count] : causes)
      rows += std::string("<tr>") + cell(escaped(fmt::format("{}", fmt::join(g.key, ", "))), "text") +
              cell(fmt::format("{}", count)) + cell(escaped(cause), "cause") + "</tr>\n";
  }
  if (rows.empty()) return "";
  return "<h2>Why runs did not reach</h2>\n<div class=\"wide\"><table>\n<thead><tr>" +
         head_cell(escaped(fmt::format("{}", fmt::join(merged.by, ", "))), true) + head_cell("runs") +
         head_cell("outcome: cause", true) + "</tr></thead>\n<tbody>\n" + rows + "</tbody></table></div>\n";
}

/// How a run is drawn in a gain map.
enum class Spot : std::size_t { reached, contact, stalled, timeout, other };
constexpr std::array<const char*, 5> spot_names{"reached", "contact", "stalled", "timeout", "other"};

Spot spot_of(const Json& record) {
  const std::string outcome = record["outcome"];
  for (std::size_t i = 0; i < spot_names.size(); ++i)
    if (outcome == spot_names[i]) return static_cast<Spot>(i);
  return outcome == "collision" || outcome == "refused" ? Spot::contact : Spot::other;
}

std::string mark(Spot spot, double x, double y) {
  switch (spot) {
    case Spot::reached:
      return fmt::format("<circle class=\"reached\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\"/>", x, y);
    case Spot::contact:
      return fmt::format("<path class=\"contact\" d=\"M{:.1f} {:.1f}l7 7m0 -7l-7 7\"/>", x - 3.5, y - 3.5);
    case Spot::stalled:
      return fmt::format("<rect class=\"stalled\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"6\" height=\"6\"/>", x - 3.0,
                         y - 3.0);
    case Spot::timeout:
      return fmt::format("<path class=\"timeout\" d=\"M{:.1f} {:.1f}l4 7h-8z\"/>", x, y - 4.5);
    case Spot::other:
      break;
  }
  return fmt::format("<circle class=\"other\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\"/>", x, y);
}

std::string gain_panel(const std::string& planner, const std::vector<const MergedRun*>& runs) {
  constexpr double left = 58.0, right = 404.0, top = 12.0, bottom = 296.0;
  const bool apf = planner.starts_with("apf");
  const char* across = apf ? "eta" : "k_obs";
  std::vector<double> xs, ys;
  std::array<std::size_t, spot_names.size()> counts{};
  for (const auto* r : runs) {
    xs.push_back(r->run.gains.at(across));
    ys.push_back(r->run.gains.at("k_p"));
    ++counts[static_cast<std::size_t>(spot_of(r->record))];
  }
  const LogAxis x(xs, left + 8.0, right - 8.0), y(ys, bottom - 8.0, top + 8.0);
  std::string counted;
  for (std::size_t i = 0; i < counts.size(); ++i)
    if (counts[i] > 0) counted += fmt::format("{}{} {}", counted.empty() ? "" : ", ", counts[i], spot_names[i]);
  std::string svg = fmt::format(
      "<figure><figcaption>{} <span>{} of {} reached</span></figcaption>\n<svg width=\"420\" height=\"340\" "
      "role=\"img\" "
      "aria-label=\"Gain map of {}: {}\">\n<path class=\"axis\" d=\"M{} {}H{}V{}H{}Z\"/>\n",
      escaped(planner), counts[0], runs.size(), escaped(planner), escaped(counted), left, top, right, bottom, left);
  for (const double tick : x.ticks())
    svg += fmt::format(
        "<path class=\"axis\" d=\"M{0:.1f} {1}V{2}\"/><text x=\"{0:.1f}\" y=\"{3}\" "
        "text-anchor=\"middle\">{4:g}</text>\n",
        x(tick), top, bottom, bottom + 17.0, tick);
  for (const double tick : y.ticks())
    svg += fmt::format(
        "<path class=\"axis\" d=\"M{1} {0:.1f}H{2}\"/><text x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:g}</text>\n",
        y(tick), left, right, left - 7.0, y(tick) + 4.0, tick);
  svg += fmt::format("<text x=\"{:.0f}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", 0.5 * (left + right),
                     bottom + 36.0, apf ? "η [m⁴/s²]" : "k_obs [m/s]");
  svg += fmt::format("<text transform=\"translate(15 {:.0f}) rotate(-90)\" text-anchor=\"middle\">k_p [1/s²]</text>\n",
                     0.5 * (top + bottom));
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Json& cause = runs[i]->record["cause"];
    svg += fmt::format("<g><title>{}: {}{}</title>{}</g>\n", escaped(runs[i]->run.id),
                       escaped(runs[i]->record["outcome"].get<std::string>()),
                       cause.is_string() ? escaped(fmt::format(": {}", cause.get<std::string>())) : "",
                       mark(spot_of(runs[i]->record), x(xs[i]), y(ys[i])));
  }
  return svg + "</svg></figure>\n";
}

std::string gain_map(const Merged& merged) {
  std::map<std::string, std::vector<const MergedRun*>> panels;
  for (const auto& r : merged.runs)
    if (!r.run.gains.empty() && !r.record.is_null() && r.run.labels.at("problem") != no_obstacle)
      panels[r.run.labels.at("planner")].push_back(&r);
  if (panels.empty()) return "";
  std::string html =
      "<h2>Gain map of example 5.2</h2>\n<p>Each mark is a random gain set: k_p against η (apf) or k_obs "
      "(gyro, hybrid), both axes logarithmic. Links as segments, semi-implicit Euler at 4 ms, 40 s, no gravity. A "
      "point "
      "under the pointer names its run.</p>\n<div class=\"legend\">";
  for (std::size_t i = 0; i < spot_names.size(); ++i)
    html += fmt::format("<span><svg width=\"16\" height=\"14\">{}</svg> {}</span>",
                        mark(static_cast<Spot>(i), 8.0, 8.0), spot_names[i]);
  html += "</div>\n<div class=\"panels\">\n";
  for (const auto& [planner, runs] : panels) html += gain_panel(planner, runs);
  html +=
      "</div>\n<p>Against the sets that reach without the obstacle in the same time, and those with which apf "
      "stalls:</p>\n"
      "<div class=\"wide\"><table>\n<thead><tr>" +
      head_cell("planner", true);
  for (const char* head : {"sets", "reached", "contacts", "reach without<br>the obstacle", "reached<br>of these", "%"})
    html += head_cell(head);
  html += head_cell("0 % … 100 %", true) + head_cell("apf stalls") + head_cell("reached<br>of these") +
          "</tr></thead>\n<tbody>\n";
  for (const auto& g : merged.gains) {
    html += g.contacts > 0 ? "<tr class=\"bad\">" : "<tr>";
    html += cell(escaped(g.planner), "text") + cell(fmt::format("{}", g.sets)) + cell(fmt::format("{}", g.reached)) +
            cell(fmt::format("{}", g.contacts), "contacts") + cell(fmt::format("{}", g.reference)) +
            cell(fmt::format("{}", g.reached_of_reference)) +
            cell(g.reference > 0 ? fmt::format("{:.1f}", percent(g.reached_of_reference, g.reference)) : "–") +
            cell(g.reference > 0 ? bar(0.01 * percent(g.reached_of_reference, g.reference), g.interval) : "", "text") +
            cell(fmt::format("{}", g.apf_stalled)) + cell(fmt::format("{}", g.reached_of_apf_stalled)) + "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

/// A word as a shell takes it.
std::string quoted(const std::string& word) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("/._-=+:,@%").find(c) != std::string_view::npos;
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), plain)) return word;
  std::string out(1, '\'');
  for (const char c : word) {
    if (c == '\'') out += "'\\'";  // closes, writes one, and opens again with the one below
    out += c;
  }
  return out + '\'';
}

std::string failures(const Merged& merged) {
  std::string rows;
  std::size_t count = 0;
  for (const auto& r : merged.runs) {
    if (r.record.is_null() || r.record["outcome"] == "reached") continue;
    ++count;
    std::string command = "hamelin run";
    for (const auto& word : run_arguments(r.run, r.directory)) command += fmt::format(" {}", quoted(word));
    const Json& cause = r.record["cause"];
    std::string why = cause.is_string() ? cause.get<std::string>() : "";
    for (const char* kind : {"obstacles", "self"}) {
      const Json* closest = r.record["judge"].is_object() ? &r.record["judge"].at(kind) : nullptr;
      if (closest == nullptr || !closest->is_object() || closest->value("clearance_m", 1.0) > 0.0) continue;
      why += fmt::format("{}the judge saw {} touch {} at {:.3f} s", why.empty() ? "" : "; ",
                         closest->value("sphere", "?"), closest->value("other", "?"), closest->value("time_s", 0.0));
    }
    if (!r.feasible) why += fmt::format("{}not feasible ({})", why.empty() ? "" : "; ", r.reason);
    rows += std::string("<tr>") + cell(escaped(r.run.id), "text") +
            cell(escaped(r.record["outcome"].get<std::string>()), "text") + cell(escaped(why), "cause") +
            cell(fmt::format("<code>{}</code>", escaped(command)), "text") + "</tr>\n";
  }
  if (count == 0) return "";
  return fmt::format(
             "<h2>Runs that did not reach</h2>\n<details{}><summary>{} runs, each with the command that repeats "
             "it</summary>\n<div class=\"wide\"><table>\n<thead><tr>",
             count <= 100 ? " open" : "", count) +
         head_cell("run", true) + head_cell("outcome", true) + head_cell("cause", true) + head_cell("again", true) +
         "</tr></thead>\n<tbody>\n" + rows + "</tbody></table></div></details>\n";
}

}  // namespace

std::string to_page(const Merged& merged) {
  std::set<std::string> directories;
  std::size_t recorded = 0;
  for (const auto& r : merged.runs) {
    directories.insert(r.directory.string());
    recorded += r.record.is_null() ? 0U : 1U;
  }
  std::string html = fmt::format("<h1>hamelin sweep</h1>\n<p>{} of {} planned runs in {}</p>\n", recorded,
                                 merged.runs.size(), escaped(fmt::format("{}", fmt::join(directories, ", "))));
  for (const auto& note : merged.notes) html += fmt::format("<p>Note: {}.</p>\n", escaped(note));
  html += success_table(merged) + gain_map(merged) + causes_table(merged) + failures(merged);
  return html_page("hamelin sweep", sweep_page_style, html);
}

}  // namespace hamelin::study
