#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "movers.hpp"

namespace hamelin::bench {

using Eigen::Vector3d;

namespace {

constexpr double amplitude_max_m = 0.4;
constexpr double offset_max_m = 0.15;  // of the centre of the swing from the way of the arm

std::optional<std::vector<scene::Obstacle>> draw_pendulum(Rng& rng, const ArmWay& way,
                                                          const MoverRequest& request) {
  scene::Obstacle o;
  const double size = rounded_m(rng.uniform(0.03, 0.08));
  if (rng.below(2) == 0) {
    o.shape = scene::Shape::sphere;
    o.radius_m = size;
  } else {
    o.shape = scene::Shape::box;
    o.size_m = Vector3d::Constant(2.0 * size);
  }
  const Vector3d on_way = way.point(rng, 0.2, 0.8);
  const double offset = rng.uniform(0.0, offset_max_m);
  o.pose = {Eigen::Matrix3d::Identity(),
            rounded_m(Vector3d(on_way + offset * random_direction(rng)))};
  scene::SineMotion swing;
  swing.period_s = std::round(rng.uniform(2.0, 6.0) * 100.0) / 100.0;
  const double largest = std::min(amplitude_max_m, request.speed_max_m_s * swing.period_s /
                                                       (2.0 * std::numbers::pi)),
               amplitude = rng.uniform(0.5, 1.0) * largest;
  swing.amplitude_m = rounded_m(Vector3d(amplitude * random_direction(rng)));
  o.motion = swing;
  if (scene::max_speed(o) > request.speed_max_m_s ||
      !way.stays_clear(o, swing.period_s, always_clear_m))
    return std::nullopt;
  return std::vector{o};
}

}  // namespace

std::vector<scene::Obstacle> make_pendulums(Rng& rng, const ArmWay& way,
                                            const MoverRequest& request) {
  std::vector<scene::Obstacle> out;
  while (out.size() < request.count) {
    auto one = draw_accepted("pendulums", [&] { return draw_pendulum(rng, way, request); }).front();
    one.name = fmt::format("pendulum {}", out.size() + 1);
    out.push_back(std::move(one));
  }
  return out;
}

}  // namespace hamelin::bench
