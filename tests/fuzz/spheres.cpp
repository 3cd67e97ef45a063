#include "detail.hpp"
#include "hamelin/description/robot_io.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

namespace {

constexpr const char* arm = R"(<robot name="arm"><link name="base"/><link name="a">
<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint></robot>)";

}  // namespace

void spheres(std::string_view bytes) {
  const MemoryFile file(bytes);
  std::size_t count = 0;
  if (!accepts(file.path(), [&] { count = description::check_spheres(file.path()); })) return;
  // Links that the arm does not have are reported as an error.
  (void)accepts("", [&] {
    const model::Robot robot =
        description::detail::read_urdf(arm, "arm.urdf", {std::nullopt, file.path()});
    require(robot.links[0].spheres.size() + robot.base_spheres.size() == count,
            "all spheres are on the robot");
  });
}

}  // namespace hamelin::fuzz
