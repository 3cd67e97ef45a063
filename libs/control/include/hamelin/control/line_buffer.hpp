#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>

namespace hamelin::control {

/// Receives lines for a log: level HAMELIN_LOG_INFO or HAMELIN_LOG_WARNING.
using LineSink = std::function<void(std::int32_t level, std::string_view line)>;

/// Memory for a line that a tick makes, which must not allocate. What does not fit is cut.
class LineBuffer {
 public:
  static constexpr std::size_t size_max = 512;
  [[nodiscard]] std::string_view view() const noexcept { return {text_.data(), size_}; }
  void clear() noexcept { size_ = 0; }

  /// What is free, and that so much of it was written.
  [[nodiscard]] char* end() noexcept { return text_.data() + size_; }
  [[nodiscard]] std::size_t room() const noexcept { return size_max - size_; }
  void extend(std::size_t written) noexcept { size_ += written < room() ? written : room(); }

 private:
  std::array<char, size_max> text_{};
  std::size_t size_ = 0;
};

}  // namespace hamelin::control
