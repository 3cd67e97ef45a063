#pragma once
#include <string>
#include <string_view>
#include <vector>

/// What the pages of this library share: self-contained HTML without scripts, light or dark as the reader's system is.
namespace hamelin::study {

/// A whole page. @param style CSS beside the common one
[[nodiscard]] std::string html_page(std::string_view title, std::string_view style, std::string_view body);

/// Text as HTML shows it, in attributes too.
[[nodiscard]] std::string escaped(std::string_view text);

/// Table cells; the content is HTML.
[[nodiscard]] std::string head_cell(std::string_view text, bool words = false);
[[nodiscard]] std::string cell(std::string_view text, std::string_view kind = "");

/// A logarithmic axis over whole decades and halves of them.
class LogAxis {
 public:
  /// From at_low to at_high in the picture.
  /// @param values positive, at least one
  LogAxis(const std::vector<double>& values, double at_low, double at_high);
  [[nodiscard]] double operator()(double value) const;
  /// Whole decades.
  [[nodiscard]] std::vector<double> ticks() const { return ticks(1, {1.0}); }
  /// At most `most` of them or few more: 1, 2 and 5 of each decade, or 1, or 1 of every so many decades.
  [[nodiscard]] std::vector<double> ticks(std::size_t most) const;

 private:
  [[nodiscard]] std::vector<double> ticks(int decades_apart, const std::vector<double>& of_each) const;

  double low_, high_, from_, to_;  // decades, and where they are in the picture
};

}  // namespace hamelin::study
