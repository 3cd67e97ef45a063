#include <fmt/format.h>

#include <utility>

#include "read_scene.hpp"

namespace hamelin::scene {

std::vector<SensorSpec> read_sensors(const Reader& in, const Scene& scene) {
  std::vector<SensorSpec> out;
  in.each("sensors", [&](const Reader& given) {
    SensorSpec sensor;
    sensor.name = given.get<std::string>("name", fmt::format("camera {}", out.size() + 1));
    const auto mount = given.get<std::string>("mount", "world");
    sensor.mount = mount == "tip"     ? Mount::tip
                   : mount == "base"  ? Mount::base
                   : mount == "frame" ? Mount::frame
                                      : Mount::world;
    sensor.frame = given.get<std::string>("frame", "");
    if ((sensor.mount == Mount::frame) == sensor.frame.empty())
      given.fail("frame", sensor.frame.empty() ? "is not given, expected one with mount \"frame\""
                                               : "is given, expected mount \"frame\" with it");
    sensor.pose = given.pose();
    sensor.quaternion_wxyz = given.quaternion();
    if (const auto size = given.get<std::vector<int>>("size", {}); !size.empty()) {
      sensor.width = size[0];
      sensor.height = size[1];
    }
    sensor.fov_rad = given.get("fov_rad", sensor.fov_rad);
    sensor.rate_hz = given.get("rate_hz", sensor.rate_hz);
    sensor.range_m = given.get("range_m", sensor.range_m);
    sensor.noise_m = given.get("noise_m", sensor.noise_m);
    sensor.delay_s = given.get("delay_s", sensor.delay_s);
    if (!scene.map)
      given.fail("type", "there is no map, expected one in the scene, into which a sensor sees");
    out.push_back(std::move(sensor));
  });
  return out;
}

}  // namespace hamelin::scene
