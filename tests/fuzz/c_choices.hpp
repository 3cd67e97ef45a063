#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string_view>

#include "hamelin/control/hamelin_control.h"

/// What the fuzz target of the C interface chooses by the bytes of its input.
namespace hamelin::fuzz {

inline constexpr std::size_t dof = 7;
using Joints = std::array<double, dof>;
inline constexpr Joints start{0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785};
inline constexpr std::uint32_t any_size = 0xffffffff;

/// What the bytes of an input choose.
class Choices {
 public:
  explicit Choices(std::string_view bytes) : bytes_(bytes) {}
  [[nodiscard]] bool ended() const { return at_ >= bytes_.size(); }
  std::uint8_t byte() { return ended() ? 0 : static_cast<std::uint8_t>(bytes_[at_++]); }
  bool rarely() { return byte() < 24; }
  double number() {
    constexpr double inf = std::numeric_limits<double>::infinity(),
                     nan = std::numeric_limits<double>::quiet_NaN();
    constexpr std::array<double, 14> odd{nan,    inf,   -inf, 0.0,      -0.0, 1e308, -1e308,
                                         1e-320, 1e200, 1e6,  1.0001e6, -1.0, 100.0, 1e-3};
    const std::uint8_t kind = byte();
    if (kind < 40) return odd[kind % odd.size()];
    return (static_cast<double>(byte()) - 128.0) / 64.0;
  }
  template <std::size_t N>
  std::array<double, N> numbers() {
    std::array<double, N> out{};
    for (double& x : out) x = number();
    return out;
  }
  /// The pointer, or null.
  template <class T>
  T* or_null(T* pointer) {
    return rarely() ? nullptr : pointer;
  }
  std::uint32_t size_or_other(std::size_t size) {
    return rarely() ? (byte() < 128 ? byte() : any_size) : static_cast<std::uint32_t>(size);
  }
  const char* name() {
    constexpr std::array<const char*, 5> names{"ball", "crate", "", "can", nullptr};
    return names[byte() % names.size()];
  }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
};

struct Destroy {
  void operator()(hamelin_controller* controller) const { hamelin_controller_destroy(controller); }
};
using OwnedController = std::unique_ptr<hamelin_controller, Destroy>;

/// A controller of an arm of seven joints.
/// @param usual whether its options are valid; else any may be wrong, and null is returned if so
[[nodiscard]] OwnedController make_controller(Choices& choose, bool usual);

}  // namespace hamelin::fuzz
