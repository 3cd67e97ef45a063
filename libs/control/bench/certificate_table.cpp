#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>

#include "../tests/certificate_motions.hpp"

// hamelin_certificate_table [MOTIONS]: compares the certificate with dense sampling by FCL for
// random motions (default 10000), divided among the arms. "free, not": free by sampling, but not
// certified. "straight": those among them that follow a line in joint space exactly.
int main(int argc, char** argv) {
  using namespace hamelin;
  const long motions = argc > 1 ? std::strtol(argv[1], nullptr, 10) : 10000;
  auto arms = test::arms_in_maps(std::filesystem::temp_directory_path());
  const int each = static_cast<int>(motions / static_cast<long>(arms.size()));
  constexpr const char* row = "{:<18}{:>9}{:>11}{:>10}{:>10}{:>16}{:>15}{:>11}{:>15}\n";
  fmt::print(row, "arm, map", "motions", "certified", "contact", "reported", "contradictions",
             "free, not", "straight", "least margin");
  test::MotionCounts all;
  std::uint64_t seed = 1000;
  for (auto& arm : arms) {
    test::MotionCounts counts;
    const std::string name = arm.name;
    test::MotionJudge judge(std::move(arm), seed++);
    judge.run(each, counts);
    fmt::print(row, name, counts.motions, counts.certified, counts.contacts, counts.reported,
               counts.contradictions, counts.free_uncertified, counts.straight_uncertified,
               fmt::format("{:.2g} mm", 1e3 * counts.least_margin_m));
    all.motions += counts.motions;
    all.certified += counts.certified;
    all.contacts += counts.contacts;
    all.reported += counts.reported;
    all.contradictions += counts.contradictions;
    all.free_uncertified += counts.free_uncertified;
    all.straight_uncertified += counts.straight_uncertified;
    all.least_margin_m = std::min(all.least_margin_m, counts.least_margin_m);
  }
  fmt::print(row, "all", all.motions, all.certified, all.contacts, all.reported, all.contradictions,
             all.free_uncertified, all.straight_uncertified,
             fmt::format("{:.2g} mm", 1e3 * all.least_margin_m));
  return all.contradictions == 0 ? 0 : 1;
}
