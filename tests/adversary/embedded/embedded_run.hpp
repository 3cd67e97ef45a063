#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "disturbances.hpp"
#include "judge.hpp"

namespace hamelin::test {

/// One run of an adversary through an embedded controller. Everything follows from the seed.
struct EmbeddedRun {
  std::uint64_t seed = 1;
  bool position = false;  ///< whether set points are sent, else torques
  bool shielded = true;
  int ticks = 600;
};

/// What a run showed.
struct EmbeddedReport {
  std::vector<std::string> findings;  ///< one line per kind of fault
  std::array<long, faults> counts{};
  Events events;
  long ticks = 0, stopping = 0, overtaken = 0;
  std::string unstarted;  ///< why the controller could not start where the arm was put; or empty
  double least_clearance_m = 1.0, strayed_share = 0.0, path = 0.0;
};

/// @throws std::exception if the run cannot be made
[[nodiscard]] EmbeddedReport run_embedded(const EmbeddedRun& run);

}  // namespace hamelin::test
