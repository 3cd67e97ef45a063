#include "hamelin/io/text_table.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace hamelin {

std::string to_text(const TextTable& table) {
  std::vector<std::size_t> widths;
  for (const auto& cell : table.head) widths.push_back(cell.size());
  for (const auto& row : table.rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  std::string text;
  const auto add = [&](const std::vector<std::string>& row) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i)
      line += i < table.text_columns ? fmt::format("{:<{}}  ", row[i], widths[i])
                                     : fmt::format("{:>{}}  ", row[i], widths[i]);
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  };
  add(table.head);
  for (const auto& row : table.rows) add(row);
  return text;
}

std::string to_markdown(const TextTable& table) {
  const auto line = [](const std::vector<std::string>& cells) {
    return fmt::format("| {} |\n", fmt::join(cells, " | "));
  };
  std::vector<std::string> rule;
  for (std::size_t i = 0; i < table.head.size(); ++i)
    rule.emplace_back(i < table.text_columns ? "---" : "--:");
  std::string text = line(table.head) + line(rule);
  for (const auto& row : table.rows) text += line(row);
  return text;
}

}  // namespace hamelin
