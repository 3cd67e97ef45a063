#include "container.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <string_view>

#include "hamelin/core/error.hpp"

namespace hamelin::report {

static_assert(std::endian::native == std::endian::little,
              "the container's numbers are little endian");

namespace {

constexpr std::uint16_t none = 65535;

void align(std::string& bytes) {
  bytes.resize((bytes.size() + 7) / 8 * 8, '\0');
}

std::pair<double, double> range_of(std::span<const double> values) {
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    lo = std::min(lo, value);
    hi = std::max(hi, value);
  }
  return lo <= hi ? std::pair(lo, hi) : std::pair(0.0, 0.0);
}

Json scaled(Json array, double scale, double offset) {
  array["scale"] = scale;
  if (offset != 0.0) array["offset"] = offset;
  return array;
}

}  // namespace

Json Container::add(const char* type, const char* data, std::size_t count, std::size_t size) {
  const std::string_view bytes(data, count * size);
  const std::size_t hash = std::hash<std::string_view>()(bytes);
  std::size_t at = blob_.size();
  const auto [first, last] = known_.equal_range(hash);
  const auto known = std::find_if(first, last, [&](const auto& entry) {
    return std::string_view(blob_).substr(entry.second.first, entry.second.second) == bytes;
  });
  if (known != last) {
    at = known->second.first;
  } else {
    known_.emplace(hash, std::pair(at, bytes.size()));
    blob_ += bytes;
    align(blob_);
  }
  return {{"at", at}, {"n", count}, {"type", type}};
}

Json Container::stepped(std::span<const double> values, double step) {
  const auto [lo, hi] = range_of(values);
  const bool finite =
      std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  if (!finite || std::max(-lo, hi) > 2e9 * step) return exact(values);
  std::vector<std::int32_t> raw;
  raw.reserve(values.size());
  for (const double value : values)
    raw.push_back(static_cast<std::int32_t>(std::lround(value / step)));
  return scaled(add<std::int32_t>("i32", raw), step, 0.0);
}

Json Container::levels(std::span<const double> values) {
  const auto [lo, hi] = range_of(values);
  return bounded(values, hi > lo ? (hi - lo) / (none - 1) : 1.0, lo);
}

Json Container::bounded(std::span<const double> values, double step, double offset) {
  std::vector<std::uint16_t> raw;
  raw.reserve(values.size());
  for (const double value : values) {
    const double level = std::round((value - offset) / step);
    // NaN is not less than none
    raw.push_back(level < none ? static_cast<std::uint16_t>(std::max(0.0, level)) : none);
  }
  Json array = scaled(exact(raw), step, offset);
  array["none"] = none;
  return array;
}

Json Container::centred(std::span<const double> values, double step) {
  constexpr double half = 32767.0;
  const auto [lo, hi] = range_of(values);
  const bool fits = std::max(-lo, hi) <= half * step;
  const double offset = fits ? 0.0 : 0.5 * (lo + hi);
  const double scale = fits ? step : std::max(step, 0.5 * (hi - lo) / half);
  std::vector<std::int16_t> raw;
  raw.reserve(values.size());
  for (const double value : values)
    raw.push_back(
        static_cast<std::int16_t>(std::clamp(std::round((value - offset) / scale), -half, half)));
  return scaled(exact(raw), scale, offset);
}

Json Container::relative(std::span<const double> values, int bits) {
  std::vector<float> raw;
  raw.reserve(values.size());
  for (const double value : values) {
    int exponent = 0;
    const double mantissa = std::frexp(value, &exponent);  // NaN and infinity pass through
    raw.push_back(
        static_cast<float>(std::ldexp(std::round(std::ldexp(mantissa, bits)), exponent - bits)));
  }
  return add<float>("f32", raw);
}

std::string Container::finish(const Json& head) const {
  const std::string text = head.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > std::numeric_limits<std::uint32_t>::max())
    throw Error(ErrorCode::invalid,
                fmt::format("report: {} bytes of text, expected less than 4 GiB", text.size()));
  const auto size = static_cast<std::uint32_t>(text.size());
  std::string bytes(reinterpret_cast<const char*>(&size), sizeof(size));
  bytes += text;
  align(bytes);
  bytes += blob_;
  return bytes;
}

}  // namespace hamelin::report
