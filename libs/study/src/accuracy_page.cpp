#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "accuracy_tables.hpp"
#include "html.hpp"

namespace hamelin::study {

namespace {

// A colour an integrator (after Okabe and Ito), a shape an order, dashes for step control. The boxes of the legend hide
// and show their lines without a script.
constexpr std::string_view style = R"css(
:root { --c0: #0072b2; --c1: #c8480a; --c2: #00845f; --c3: #a8528a; --c4: #b07700; --c5: #3b8fd0; --c6: #6b4fb3;
  --c7: #7a6a58; }
@media (prefers-color-scheme: dark) { :root { --c0: #4aa8e8; --c1: #ff7a45; --c2: #2fc79a; --c3: #e08fc3; --c4: #f0b429;
  --c5: #8fd0ff; --c6: #a993f0; --c7: #b8a896; } }
.c0 { --c: var(--c0); } .c1 { --c: var(--c1); } .c2 { --c: var(--c2); } .c3 { --c: var(--c3); }
.c4 { --c: var(--c4); } .c5 { --c: var(--c5); } .c6 { --c: var(--c6); } .c7 { --c: var(--c7); }
.line { stroke: var(--c); stroke-width: 1.6; fill: none; } .dashed { stroke-dasharray: 5 3; }
.mark { fill: var(--c); stroke: var(--panel); stroke-width: 1; } .limited { fill: var(--panel); stroke: var(--c); }
.floor { stroke: var(--soft); stroke-width: 1; stroke-dasharray: 2 3; }
.legend label { cursor: pointer; white-space: nowrap; }
.wide { margin-top: 1.2rem; }
.wide:focus-visible { outline: 2px solid var(--c0); }
caption { text-align: left; color: var(--soft); padding-bottom: .3rem; }
tbody tr:hover { background: var(--panel); }
tr.above td, tr.above th { border-top: 2px solid var(--line); }
tbody th { font-size: 14px; color: var(--ink); font-weight: 400; }
)css";

constexpr std::size_t colours = 8, shapes = 5;

/// A line of the plots: the rows with one label.
struct Series {
  std::string label;
  std::size_t number = 0, colour = 0, shape = 0;
  bool controlled = false;
  std::vector<const AccuracyRow*> rows;
};

/// By label, over all measurements: one legend holds for the page.
std::map<std::string, Series> all_series(const std::vector<Accuracy>& all, std::vector<std::string>& order) {
  std::map<std::string, Series> series;
  std::map<std::string, std::size_t> colour;
  std::map<std::string, std::vector<int>> orders;
  for (const auto& accuracy : all)
    for (const auto& row : accuracy.rows) {
      const std::string label = row.label();
      if (series.contains(label)) continue;
      Series& s = series[label];
      s.label = label;
      s.number = order.size();
      s.controlled = row.rtol.has_value();
      s.colour = colour.emplace(row.integrator, colour.size() % colours).first->second;
      auto& known = orders[row.integrator];
      const auto at = std::find(known.begin(), known.end(), row.order);
      s.shape = static_cast<std::size_t>(at - known.begin()) % shapes;
      if (at == known.end()) known.push_back(row.order);
      order.push_back(label);
    }
  return series;
}

std::string mark(const Series& series, double x, double y, bool limited) {
  const char* kind = limited ? "mark limited" : "mark";
  switch (series.shape) {
    case 0:
      return fmt::format("<circle class=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\"/>", kind, x, y);
    case 1:
      return fmt::format("<rect class=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"7\" height=\"7\"/>", kind, x - 3.5,
                         y - 3.5);
    case 2:
      return fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}l4.5 8h-9z\"/>", kind, x, y - 5.0);
    case 3:
      return fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}l5 5l-5 5l-5 -5z\"/>", kind, x, y - 5.0);
    default:
      return fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}l4.5 -8h-9z\"/>", kind, x, y + 5.0);
  }
}

/// What a plot takes of a row; none where the row has no such number.
struct Plot {
  const char *title, *against, *x_words, *y_words;
  std::optional<double> (*x)(const AccuracyRow&);
  std::optional<double> (*y)(const AccuracyRow&);
  bool of_error;  ///< y is an error in q, which the reference limits
};

// What rounding leaves of an error of nothing: a logarithm needs some.
constexpr double least_shown = 1e-17;

std::optional<double> shown_error(const AccuracyRow& row) {
  if (!row.error_q) return std::nullopt;
  return std::max({row.reference_limited ? *row.reference_error : *row.error_q, least_shown});
}

std::optional<double> shown_energy(const AccuracyRow& row) {
  if (!row.energy_error_max_J) return std::nullopt;
  return std::max(*row.energy_error_max_J, least_shown);
}

constexpr std::array<Plot, 3> plots{
    {{"Error against CPU time", "", "CPU time [µs]", "error in q(T) [rad or m]",
      [](const AccuracyRow& row) { return row.cpu_us; }, shown_error, true},
     {"Error against step", "fixed steps", "step [s]", "error in q(T) [rad or m]",
      [](const AccuracyRow& row) { return row.step_s; }, shown_error, true},
     {"Energy error against step", "fixed steps", "step [s]", "largest energy error [J]",
      [](const AccuracyRow& row) { return row.step_s; }, shown_energy, false}}};

std::string hint(const AccuracyRow& row) {
  std::string text = row.label();
  if (row.step_s) text += fmt::format(", step {:.6g} s", *row.step_s);
  if (row.rtol) text += fmt::format(", rtol {:.0e}", *row.rtol);
  if (row.tolerance) text += fmt::format(", tolerance {:.0e}", *row.tolerance);
  if (row.error_q) text += fmt::format("; error {} {:.1e}", row.reference_limited ? "at most" : "", *row.error_bound());
  if (row.energy_error_max_J) text += fmt::format(", energy {:.1e} J", *row.energy_error_max_J);
  if (row.cpu_us) text += fmt::format(", {:.4g} µs", *row.cpu_us);
  return text;
}

/// 1e-4 rather than 0.0001, which would reach into the words beside the axis.
std::string tick_words(double value) {
  const double decade = std::floor(std::log10(value) + 1e-9);
  return decade < -2.0 ? fmt::format("{:.0f}e{:.0f}", value / std::pow(10.0, decade), decade)
                       : fmt::format("{:g}", value);
}

std::string figure(const Plot& plot, const Accuracy& accuracy, const std::map<std::string, Series>& series,
                   const std::vector<std::string>& order) {
  constexpr double left = 62.0, right = 446.0, top = 12.0, bottom = 330.0;
  std::vector<double> xs, ys;
  for (const auto& row : accuracy.rows) {
    const auto x = plot.x(row), y = plot.y(row);
    if (!x || !y) continue;
    xs.push_back(*x);
    ys.push_back(*y);
  }
  if (xs.empty()) return "";
  const LogAxis x(xs, left + 10.0, right - 10.0), y(ys, bottom - 10.0, top + 10.0);
  std::string svg = fmt::format(
      "<figure><figcaption>{0} <span>{1}</span></figcaption>\n<svg width=\"460\" height=\"372\" role=\"img\" "
      "aria-label=\"{0} of {2}; the tables below hold the same figures\">\n<path class=\"axis\" d=\"M{3} "
      "{4}H{5}V{6}H{3}Z\"/>\n",
      plot.title, plot.against, escaped(accuracy.name), left, top, right, bottom);
  for (const double tick : x.ticks(8))
    svg += fmt::format(
        "<path class=\"axis\" d=\"M{0:.1f} {1}V{2}\"/><text x=\"{0:.1f}\" y=\"{3}\" "
        "text-anchor=\"middle\">{4}</text>\n",
        x(tick), top, bottom, bottom + 17.0, tick_words(tick));
  for (const double tick : y.ticks(8))
    svg += fmt::format(
        "<path class=\"axis\" d=\"M{1} {0:.1f}H{2}\"/><text x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5}</text>\n",
        y(tick), left, right, left - 7.0, y(tick) + 4.0, tick_words(tick));
  svg += fmt::format("<text x=\"{:.0f}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", 0.5 * (left + right),
                     bottom + 36.0, plot.x_words);
  svg += fmt::format("<text transform=\"translate(14 {:.0f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                     0.5 * (top + bottom), plot.y_words);
  if (plot.of_error && accuracy.reference) {
    const double at = y(std::max(accuracy.reference->error_q, least_shown));
    if (at > top && at < bottom)
      svg +=
          fmt::format("<path class=\"floor\" d=\"M{0} {1:.1f}H{2}\"><title>the reference’s own error</title></path>\n",
                      left, at, right);
  }
  for (const auto& label : order) {
    const Series& s = series.at(label);
    std::map<std::optional<double>, std::vector<const AccuracyRow*>> lines;  // one a tolerance
    for (const auto& row : accuracy.rows)
      if (row.label() == label && plot.x(row) && plot.y(row)) lines[row.tolerance].push_back(&row);
    if (lines.empty()) continue;
    svg += fmt::format("<g class=\"c{} s{}\">", s.colour, s.number);
    std::string marks;
    for (const auto& [tolerance, rows] : lines) {
      std::string path;
      for (const auto* row : rows) {
        const double px = x(*plot.x(*row)), py = y(*plot.y(*row));
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", px, py);
        marks += fmt::format("<g><title>{}</title>{}</g>\n", escaped(hint(*row)),
                             mark(s, px, py, plot.of_error && row->reference_limited));
      }
      svg += fmt::format("<path class=\"line{}\" d=\"{}\"/>\n", s.controlled ? " dashed" : "", path);
    }
    svg += marks + "</g>\n";
  }
  return svg + "</svg></figure>\n";
}

std::string html_table(const AccuracyTable& table, const std::string& caption) {
  std::string html = fmt::format(
      "<div class=\"wide\" tabindex=\"0\" role=\"region\" "
      "aria-label=\"{0}\"><table><caption>{0}</caption>\n<thead><tr>",
      escaped(caption));
  for (std::size_t i = 0; i < table.head.size(); ++i) html += head_cell(escaped(table.head[i]), i < table.words);
  html += "</tr></thead>\n<tbody>\n";
  bool over = false;  // the first row of ratios is set apart
  for (const auto& row : table.rows) {
    const bool ratio = row.front().starts_with("best of");
    html += ratio && !over ? "<tr class=\"above\">" : "<tr>";
    over = over || ratio;
    html += fmt::format("<th class=\"text\" scope=\"row\">{}</th>", escaped(row.front()));
    for (std::size_t i = 1; i < row.size(); ++i) html += cell(escaped(row[i]), i < table.words ? "text" : "");
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

}  // namespace

std::string to_page(const std::vector<Accuracy>& all) {
  std::vector<std::string> order;
  const auto series = all_series(all, order);
  std::string html =
      "<h1>Speed against error</h1>\n<p>Each mark is one integration of a free motion. Left and below is better. A "
      "hollow mark is as near to the reference as that is to the truth (dotted line): its error may be smaller. Dashed "
      "lines: step control. A mark under the pointer tells its settings.</p>\n<div class=\"legend\">\n";
  std::string hiding;
  for (const auto& label : order) {
    const Series& s = series.at(label);
    html += fmt::format(
        "<label class=\"c{0}\"><input type=\"checkbox\" id=\"s{1}\" checked> <svg width=\"34\" height=\"14\" "
        "aria-hidden=\"true\"><path class=\"line{2}\" d=\"M1 7H33\"/>{3}</svg> {4}</label>\n",
        s.colour, s.number, s.controlled ? " dashed" : "", mark(s, 17.0, 7.0, false), escaped(label));
    hiding += fmt::format("body:has(#s{0}:not(:checked)) .s{0} {{ display: none; }}\n", s.number);
  }
  html += "</div>\n";
  for (const auto& accuracy : all) {
    html += fmt::format("<h2>{}</h2>\n<p>{}</p>\n", escaped(accuracy.name), escaped(about(accuracy)));
    for (const auto& note : accuracy.notes) html += fmt::format("<p>Note: {}.</p>\n", escaped(note));
    html += "<div class=\"panels\">\n";
    for (const auto& plot : plots) html += figure(plot, accuracy, series, order);
    html += "</div>\n";
    if (accuracy.reference)
      html += html_table(cheapest_table(accuracy, typographic),
                         "CPU time of the cheapest row of each scheme whose error in q stays below");
    if (const auto peers_win = where_peers_win(accuracy); !peers_win.empty())
      html += fmt::format("<p>{}</p>\n", escaped(peers_win));
    html += std::string(all.size() == 1 ? "<details open>" : "<details>") + "<summary>All rows</summary>\n" +
            html_table(rows_table(accuracy, typographic), fmt::format("All rows of {}", accuracy.name)) +
            "</details>\n";
  }
  return html_page("hamelin accuracy", std::string(style) + hiding, html);
}

}  // namespace hamelin::study
