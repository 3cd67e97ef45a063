// Reads the log of the example 04: the fastest joint, and where the arm was nearest to the shelf.
#include <fmt/core.h>

#include <hamelin/log/read_log.hpp>

int main(int, char** argv) {  // 05_read_log LOG
  hamelin::log::LogReader reader(argv[1]);
  hamelin::Json line;
  double fastest = 0.0, nearest_m = 1.0, when_s = 0.0;
  int ticks = 0;
  while (reader.next(line)) {
    if (line["type"] != "tick") continue;
    ++ticks;
    for (const double v : line["v"]) fastest = std::max(fastest, std::abs(v));
    if (const double clearance_m = line["clearance_m"]; clearance_m < nearest_m) {
      nearest_m = clearance_m;
      when_s = line["time_s"];
    }
  }
  fmt::print("{} ticks, fastest joint {:.6f} rad/s\n", ticks, fastest);
  fmt::print("nearest to the shelf at {:.2f} s: {:.6f} m\n", when_s, nearest_m);
}
