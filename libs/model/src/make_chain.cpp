#include "hamelin/model/make_chain.hpp"

#include <Eigen/Geometry>
#include <string_view>

#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::model {

namespace {

using Eigen::Vector3d;

std::vector<Vector3d> parse_axes(const std::string& text) {
  std::vector<Vector3d> axes;
  std::string_view rest = text;
  while (true) {
    const auto comma = rest.find(',');
    const std::string_view name = rest.substr(0, comma);
    if (name.size() != 1 || name[0] < 'x' || name[0] > 'z')
      throw Error(ErrorCode::usage, formatted("make-chain: axes '{}': '{}' is not an axis, "
                                              "expected a list of x, y and z such as x,z,x",
                                              text, name));
    axes.push_back(Vector3d::Unit(name[0] - 'x'));
    if (comma == std::string_view::npos) return axes;
    rest.remove_prefix(comma + 1);
  }
}

void require_positive(const char* option, double value, double most) {
  if (!(value > 0.0 && value <= most))
    throw Error(ErrorCode::usage,
                formatted("make-chain: {} is {}, expected a positive number up to {}", option,
                          value, most));
}

}  // namespace

Robot make_chain(const ChainOptions& options) {
  constexpr int links_max = 10000;
  if (options.links < 1 || options.links > links_max)
    throw Error(ErrorCode::usage,
                formatted("make-chain: links is {}, expected 1 to {}", options.links, links_max));
  const double L = options.length_m, m = options.mass_kg, r = options.radius_m;
  require_positive("length", L, 1e4 / options.links);
  require_positive("mass", m, 1e9);
  require_positive("radius", r, 1e3);
  const std::vector<Vector3d> axes = parse_axes(options.axes);

  Robot robot;
  robot.name = formatted("chain{}", options.links);
  for (int i = 0; i < options.links; ++i) {
    Link link;
    link.name = formatted("link{}", i + 1);
    link.parent = i - 1;
    link.joint.name = formatted("j{}", i + 1);
    const Vector3d& axis = axes[static_cast<std::size_t>(i) % axes.size()];
    link.joint.screw << axis, Vector3d(0.0, i * L, 0.0).cross(axis);
    link.com = geometry::SE3(Eigen::Matrix3d::Identity(), Vector3d(0.0, (i + 0.5) * L, 0.0));
    link.mass_kg = m;
    const double across = m * (L * L / 12.0 + r * r / 4.0);
    link.inertia_kg_m2 = Vector3d(across, m * r * r / 2.0, across).asDiagonal();
    link.segments.push_back({Vector3d(0.0, -0.5 * L, 0.0), Vector3d(0.0, 0.5 * L, 0.0), r});
    robot.links.push_back(std::move(link));
    if (i > 0)
      robot.self_collision_disabled.emplace_back(formatted("link{}", i),
                                                 formatted("link{}", i + 1));
  }
  robot.tip = {robot.links.back().name, options.links - 1,
               geometry::SE3(Eigen::Matrix3d::Identity(), Vector3d(0.0, options.links * L, 0.0))};
  check(robot, "make-chain");
  return robot;
}

}  // namespace hamelin::model
