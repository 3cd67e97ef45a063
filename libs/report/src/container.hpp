#pragma once
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::report {

/// Gathers arrays of numbers behind a JSON head: u32 (little endian) size of the head, the head, zeros up to a multiple
/// of 8, the arrays. An array is named in the head by {at, n, type, scale, offset, none}; its values are
/// offset + scale · raw. Equal arrays are kept once.
class Container {
 public:
  /// As they are.
  [[nodiscard]] Json exact(std::span<const double> values) { return add("f64", values); }
  [[nodiscard]] Json exact(std::span<const std::int16_t> values) { return add("i16", values); }
  [[nodiscard]] Json exact(std::span<const std::uint16_t> values) { return add("u16", values); }
  [[nodiscard]] Json exact(std::span<const std::uint8_t> values) { return add("u8", values); }

  /// Rounded to multiples of `step`; f64 as they are where an i32 cannot hold that.
  [[nodiscard]] Json stepped(std::span<const double> values, double step);
  /// 65535 levels between smallest and largest, NaN as none.
  [[nodiscard]] Json levels(std::span<const double> values);
  /// Multiples of `step` from `offset` on as u16, NaN and what is too large as none; what is too small as the smallest.
  [[nodiscard]] Json bounded(std::span<const double> values, double step, double offset);
  /// i16 around their middle, in steps of `step` or coarser where the range asks for it. No NaN.
  [[nodiscard]] Json centred(std::span<const double> values, double step);
  /// f32 of `bits` significant bits: a relative error of 2^-bits over any range. NaN stays.
  [[nodiscard]] Json relative(std::span<const double> values, int bits);

  /// The whole. @throws Error invalid for a head of 4 GiB or more
  [[nodiscard]] std::string finish(const Json& head) const;

 private:
  template <class T>
  Json add(const char* type, std::span<const T> values) {
    return add(type, reinterpret_cast<const char*>(values.data()), values.size(), sizeof(T));
  }
  Json add(const char* type, const char* data, std::size_t count, std::size_t size);

  std::string blob_;
  std::multimap<std::size_t, std::pair<std::size_t, std::size_t>> known_;  ///< hash → at, bytes
};

}  // namespace hamelin::report
