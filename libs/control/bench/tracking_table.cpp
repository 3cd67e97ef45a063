#include <fmt/format.h>

#include "../tests/sine_stream.hpp"

// hamelin_tracking_table: errors of what is estimated from the poses of a body that swings by
// ±0.25 m, beside those of differences of the last poses, and of the true derivatives.
int main() {
  using namespace hamelin;
  constexpr const char* row = "{:>6}{:>6}{:>6}{:>16}{:>16}{:>26}{:>28}{:>28}\n";
  fmt::print("root mean square errors with the default options: estimated / differences / true\n");
  fmt::print(row, "T [s]", "[Hz]", "[mm]", "v [m/s]", "a [m/s^2]", "0.1 s ahead [mm]",
             "0.3 s ahead [mm]", "1 s ahead [mm]");
  for (const auto& stream : test::sine_streams()) {
    const test::SineErrors e = test::sine_errors(stream, {}, 1);
    const auto ahead = [&](std::size_t i) {
      return fmt::format("{:.3g} / {:.3g} / {:.3g}", 1e3 * e.estimated.prediction_m[i],
                         1e3 * e.differences.prediction_m[i], 1e3 * e.exact.prediction_m[i]);
    };
    fmt::print(row, stream.period_s, stream.rate_hz, 1e3 * stream.noise_m,
               fmt::format("{:.3f} / {:.3f}", e.estimated.velocity_m_s, e.differences.velocity_m_s),
               fmt::format("{:.2f} / {:.2f}", e.estimated.acceleration_m_s2,
                           e.differences.acceleration_m_s2),
               ahead(0), ahead(1), ahead(2));
  }
}
