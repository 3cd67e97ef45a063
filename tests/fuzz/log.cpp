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
    promise(summary.cut == lines.cut, "both readers agree on whether a log is cut");
    promise(summary.ticks + summary.events + 1 + (summary.has_result ? 1 : 0) == lines.lines.size(),
            "a log is a header, ticks, events and a result");
  }
  (void)accepts(file.path(), [&] {
    const log::Trajectory trajectory = log::read_trajectory(file.path());
    promise(!trajectory.points.empty(), "a trajectory has points");
    for (const auto& point : trajectory.points)
      promise(static_cast<std::size_t>(point.q.size()) == trajectory.joints.size(), "a point has all joints");
    (void)log::to_csv(trajectory);
  });
}

}  // namespace hamelin::fuzz
