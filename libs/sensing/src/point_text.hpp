#pragma once
#include <Eigen/Geometry>
#include <charconv>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::sensing {

/// The lines of a file, one after the other, and messages that name them.
class Text {
 public:
  Text(std::string_view bytes, std::string where) : bytes_(bytes), where_(std::move(where)) {}

  /// Goes on to the next line. @return false at the end
  bool next();
  [[nodiscard]] std::string_view line() const noexcept { return line_; }
  /// What follows the line.
  [[nodiscard]] std::string_view rest() const noexcept { return bytes_.substr(at_); }
  [[nodiscard]] std::size_t words() const;
  /// A word of the line, empty behind the last one.
  [[nodiscard]] std::string_view word(std::size_t i) const;
  /// A word that is a number from 0 on. @throws Error parse
  [[nodiscard]] std::size_t count(std::size_t i) const;
  /// All numbers of the line. @throws Error parse for what is none
  void numbers(std::vector<double>& out) const;
  /// The seven words from `first` on as position and quaternion w, x, y, z. @throws Error parse
  [[nodiscard]] geometry::SE3 pose(std::size_t first) const;
  /// Whether the line is empty or begins with #.
  [[nodiscard]] bool is_comment() const;
  /// @throws Error parse, with the file and the line
  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::string_view bytes_, line_;
  std::string where_;
  std::size_t at_ = 0, number_ = 0;
};

}  // namespace hamelin::sensing
