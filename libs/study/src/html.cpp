#include "html.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace hamelin::study {

namespace {

constexpr std::string_view common_style = R"css(
:root { color-scheme: light dark; --ink: #1a1d21; --soft: #5c6570; --line: #d5dae0; --ground: #fff; --panel: #f6f7f9; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ed; --soft: #9aa4b0; --line: #363c45; --ground: #14171b;
  --panel: #1c2026; } }
body { margin: 0 auto; max-width: 100rem; padding: 1.5rem 2rem 4rem; background: var(--ground); color: var(--ink);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .5rem; }
p, .soft { color: var(--soft); max-width: 65rem; } p { margin: .3rem 0 .8rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 14px; font-variant-numeric: tabular-nums; }
td svg { vertical-align: middle; }
th, td { padding: .32rem .5rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { font-weight: 600; color: var(--soft); font-size: .82rem; vertical-align: bottom; }
th.text, td.text { text-align: left; }
code { font: 12px/1.45 ui-monospace, "DejaVu Sans Mono", Menlo, monospace; }
.panels { display: flex; flex-wrap: wrap; gap: 1.2rem; }
figure { margin: 0; background: var(--panel); border: 1px solid var(--line); border-radius: 8px; padding: .8rem 1rem; }
figcaption { font-weight: 600; } figcaption span { font-weight: 400; color: var(--soft); }
svg text { fill: var(--soft); font-size: 12px; } .axis { stroke: var(--line); stroke-width: 1; fill: none; }
.legend { display: flex; flex-wrap: wrap; gap: .3rem 1.4rem; margin: .4rem 0 .9rem; } .legend svg { vertical-align: -2px; }
details { margin-top: 1rem; } summary { cursor: pointer; font-weight: 600; }
)css";

}  // namespace

std::string html_page(std::string_view title, std::string_view style, std::string_view body) {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n<style>{}{}</style>\n</head>\n<body>\n{}"
      "</body>\n</html>\n",
      escaped(title), common_style, style.empty() ? style : style.substr(1), body);
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  return out;
}

std::string head_cell(std::string_view text, bool words) {
  return fmt::format("<th{}>{}</th>", words ? " class=\"text\"" : "", text);
}

std::string cell(std::string_view text, std::string_view kind) {
  return kind.empty() ? fmt::format("<td>{}</td>", text) : fmt::format("<td class=\"{}\">{}</td>", kind, text);
}

LogAxis::LogAxis(const std::vector<double>& values, double at_low, double at_high)
    : low_(0), high_(1), from_(at_low), to_(at_high) {
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  low_ = std::floor(2.0 * std::log10(*least)) / 2.0;
  high_ = std::max(low_ + 0.5, std::ceil(2.0 * std::log10(*most)) / 2.0);
}

double LogAxis::operator()(double value) const {
  return from_ + (std::log10(value) - low_) / (high_ - low_) * (to_ - from_);
}

std::vector<double> LogAxis::ticks(std::size_t most) const {
  const double decades = high_ - low_, room = static_cast<double>(most);
  if (3.0 * decades <= room) return ticks(1, {1.0, 2.0, 5.0});
  return ticks(static_cast<int>(std::ceil(decades / room)), {1.0});
}

std::vector<double> LogAxis::ticks(int decades_apart, const std::vector<double>& of_each) const {
  std::vector<double> all;
  for (int decade = static_cast<int>(std::floor(low_)); decade <= std::floor(high_); ++decade) {
    if (decade % decades_apart != 0) continue;
    for (const double digit : of_each) {
      const double at = digit * std::pow(10.0, decade);
      if (std::log10(at) >= low_ - 1e-9 && std::log10(at) <= high_ + 1e-9) all.push_back(at);
    }
  }
  return all;
}

}  // namespace hamelin::study
