// hamelin_hard_cases [SCHEME...]: prints the figures of docs/hard_cases.md as a table. Default: the
// paper's scheme and hamel-variational.
#include <fmt/format.h>

#include <vector>

#include "cases.hpp"

using namespace hamelin;
using namespace hamelin::hard_cases;

namespace {

void print(const std::string& name, const Motion& motion, const std::vector<std::string>& schemes,
           const integration::Parameters& parameters = {}) {
  for (const auto& scheme : schemes) {
    const Outcome o = run(motion, scheme, parameters);
    fmt::print("{:<42} {:<20} {:>9.2e} {:>9.2e} {:>7.2f} {:>8.2f} {:>8} {:>8.2f} {:>9}  {}{}\n",
               name, scheme, o.energy_error_J, o.energy_scale_J, o.late_over_early, o.updates_mean,
               o.updates_max, o.factorizations_mean, o.halvings,
               o.completed ? "completed"
                           : fmt::format("no root at step {} of {}", o.steps + 1, motion.steps),
               o.deepest > 0.0 ? fmt::format(", {:.2e} rad deep", o.deepest) : "");
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> schemes(argv + 1, argv + argc);
  if (schemes.empty()) schemes = {"hamel", "hamel-variational"};
  fmt::print("{:<42} {:<20} {:>9} {:>9} {:>7} {:>8} {:>8} {:>8} {:>9}\n", "case", "scheme",
             "|dE| J", "max K J", "late/e.", "updates", "at most", "factors", "halvings");
  print("stretched, 7 links, 1 ms, 1 s", stretched(7, 1e-3, 1000), schemes);
  print("turning through pi, 1 ms, 10 s", turn_through_half_turns(1e-3, 10000), schemes);
  print("100 links, 1 ms, 0.2 s", stretched(100, 1e-3, 200), schemes);
  print("200 links, 1 ms, 0.2 s", stretched(200, 1e-3, 200), schemes);
  print("tip 10^6 times as heavy, 1 ms, 1 s", mass_ratio(6, 1e-3, 1000), schemes);
  print("the same under step control, 1e-9", mass_ratio(6, 1e-3, 1000), {"gauss:8"},
        controlled(1e-9));
  print("first link 10^6 times as heavy, 1 ms, 1 s", mass_ratio(0, 1e-3, 1000), schemes);
  for (const double h : {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1})
    print(fmt::format("grid of steps, 7 links, {} s", h),
          stretched(7, h, std::min(2000L, std::lround(1.0 / h))), schemes);
  for (const double stiffness : {1e4, 1e6, 1e7})
    print(fmt::format("barrier of {:.0e} Nm/rad, 1 ms, 10 s", stiffness),
          falling_on_barrier(stiffness, 1e-3, 10000), schemes);
  print("planar3, 10^6 steps of 10 ms", million_steps(), schemes);
}
