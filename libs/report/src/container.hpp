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

/// Collects arrays of numbers behind a JSON head. The layout is: size of the head as u32 (little
/// endian), the head, zeros up to a multiple of 8, the arrays. The head describes an array by {at,
/// n, type, scale, offset, none}; its values are offset + scale · raw. Equal arrays are stored
/// once.
class Container {
 public:
  /// Stores the values unchanged.
  [[nodiscard]] Json exact(std::span<const double> values) { return add("f64", values); }
  [[nodiscard]] Json exact(std::span<const std::int16_t> values) { return add("i16", values); }
  [[nodiscard]] Json exact(std::span<const std::uint16_t> values) { return add("u16", values); }
  [[nodiscard]] Json exact(std::span<const std::uint8_t> values) { return add("u8", values); }

  /// Rounds the values to multiples of `step`, as i32; stores them unchanged as f64 if an i32
  /// cannot hold the multiples.
  [[nodiscard]] Json stepped(std::span<const double> values, double step);
  /// 65535 levels between the smallest and the largest value; NaN becomes none.
  [[nodiscard]] Json levels(std::span<const double> values);
  /// offset + multiples of `step`, as u16. NaN and values that are too large become none; values
  /// that are too small become `offset`.
  [[nodiscard]] Json bounded(std::span<const double> values, double step, double offset);
  /// i16 around the middle of the range, in steps of `step`, or of a larger one if the range
  /// requires it. No NaN.
  [[nodiscard]] Json centred(std::span<const double> values, double step);
  /// f32 with `bits` significant bits, a relative error of 2^-bits. NaN is preserved.
  [[nodiscard]] Json relative(std::span<const double> values, int bits);

  /// The bytes of the container. @throws Error invalid for a head of 4 GiB or more
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
