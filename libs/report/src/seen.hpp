#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "container.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::report {

/// Voxels that the depth sensors of a run found occupied, and when for the first time.
class Seen {
 public:
  /// @param runs of an event, as the schema of logs describes them @return whether they are that
  [[nodiscard]] bool add(const Json& runs, double time_s);
  /// Null if there are none. @param alone whether they are all that the arm knows of the map
  [[nodiscard]] Json json(Container& container, bool alone, std::vector<std::string>& notes) const;

 private:
  std::vector<std::int16_t> voxels_;  ///< three numbers for each
  std::vector<double> since_s_;
  std::size_t left_out_ = 0;
};

}  // namespace hamelin::report
