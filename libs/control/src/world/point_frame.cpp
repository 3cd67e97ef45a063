#include "hamelin/control/point_frame.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"

namespace hamelin::control {

void check(const PointFrame& frame) {
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorCode::invalid, "points: " + what);
  };
  const Eigen::Index count = frame.points.cols();
  if (count < 1 || count > PointFrame::points_max)
    refuse(fmt::format("{} given, expected 1 to {}", count, PointFrame::points_max));
  if (!frame.points.allFinite())
    refuse("one is not finite, expected finite numbers: leave out what the sensor did not see");
  if (!frame.sensor.p().allFinite() || !frame.sensor.R().allFinite())
    refuse("the sensor's pose is not finite, expected finite numbers");
  if (!std::isfinite(frame.time_s)) refuse("time_s: is not finite, expected when they were seen");
  if (!(frame.range_m > 0.0))
    refuse(fmt::format("range_m: {} m given, expected more than 0", frame.range_m));
}

}  // namespace hamelin::control
