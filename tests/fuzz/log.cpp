#include <cmath>

#include "hamelin/log/read_log.hpp"
#include "hamelin/log/trajectory.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

void log(std::string_view bytes) {
  const MemoryFile file(bytes);
  log::LogSummary summary;
  const bool checked = accepts(file.path(), [&] { summary = log::check_log(file.path()); });
  if (checked) {
    const log::LogLines lines = log::read_log(file.path());
    require(summary.cut == lines.cut, "both readers agree on whether a log is truncated");
    require(summary.ticks + summary.events + 1 + (summary.has_result ? 1 : 0) == lines.lines.size(),
            "a log consists of header, ticks, events and result");
  }
  (void)accepts(file.path(), [&] {
    const log::Trajectory trajectory = log::read_trajectory(file.path());
    require(!trajectory.points.empty(), "a trajectory has points");
    for (const auto& point : trajectory.points)
      require(static_cast<std::size_t>(point.q.size()) == trajectory.joints.size(),
              "a point has a value for every joint");
    (void)log::to_csv(trajectory);
  });
}

}  // namespace hamelin::fuzz
