#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace hamelin {

/// A table of cells that are text already; each row has as many cells as the head. The first
/// `text_columns` columns are text and stand to the left, the others are numbers and stand to the
/// right.
struct TextTable {
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
  std::size_t text_columns = 1;
};

/// The table as lines with aligned columns, without blanks at the ends.
[[nodiscard]] std::string to_text(const TextTable& table);
/// The table as Markdown.
[[nodiscard]] std::string to_markdown(const TextTable& table);

}  // namespace hamelin
