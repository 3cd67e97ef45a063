#include "mjcf.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <string_view>

namespace hamelin::mujoco {

namespace {

using Eigen::Vector3d;

constexpr std::array<std::string_view, 4> kind_names{"link", "base", "obstacle", "map"};
// Half the range of a joint that is limited on one side only [rad or m].
constexpr double far_away = 1e6;

std::string text(const Vector3d& x) {
  return fmt::format("{} {} {}", x.x(), x.y(), x.z());
}

std::string rotation(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  return fmt::format("{} {} {} {}", q.w(), q.x(), q.y(), q.z());
}

// A point on the axis of a joint, in the base frame at q = 0: the origin of its link's body.
Vector3d joint_origin(const model::Robot& robot, int joint) {
  if (joint < 0) return Vector3d::Zero();
  const model::Link& link = robot.links[static_cast<std::size_t>(joint)];
  if (link.joint.type == model::JointType::prismatic) return link.com.p();
  const Vector3d axis = link.joint.screw.head<3>(), moment = link.joint.screw.tail<3>();
  return axis.cross(moment);
}

Vector3d joint_axis(const model::Joint& joint) {
  return joint.type == model::JointType::prismatic ? Vector3d(joint.screw.tail<3>())
                                                   : Vector3d(joint.screw.head<3>());
}

/// Writes the elements of a model.
class Writer {
 public:
  Writer(const simulation::PlantSetup& setup, const scene::Environment& environment,
         const scene::SelfField* self, int map_boxes)
      : setup_(setup),
        robot_(setup.model.robot()),
        environment_(environment),
        self_(self),
        map_boxes_(map_boxes),
        shapes_of_link_(static_cast<std::size_t>(robot_.dof())) {
    const auto& shapes = setup.model.shapes();
    for (std::size_t i = 0; i < shapes.size(); ++i)
      shapes_of_link_[static_cast<std::size_t>(shapes[i].link)].push_back(static_cast<int>(i));
  }

  std::string write() {
    add("<mujoco><compiler angle='radian' inertiafromgeom='false'/><size nuser_body='0' "
        "nconmax='{}' njmax='{}'/><option gravity='{}'/>"
        "<default><geom condim='1' margin='0' gap='0' contype='0' conaffinity='1'/></default>"
        "<worldbody>\n",
        contacts_max, contacts_max + 2 * robot_.dof(), text(setup_.model.gravity()));
    const auto& obstacles = environment_.obstacles();
    for (std::size_t i = 0; i < obstacles.size(); ++i) add_obstacle(static_cast<int>(i));
    if (map_boxes_ > 0) add_map();
    add_arm();
    add("</worldbody>\n");
    if (self_ != nullptr) add_self_pairs();
    add("</mujoco>\n");
    return std::move(out_);
  }

 private:
  template <typename... T>
  void add(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(std::back_inserter(out_), format, std::forward<T>(values)...);
  }

  // Moving obstacles are bodies of their own, which the plant places at each node.
  void add_obstacle(int index) {
    const scene::Obstacle& o = environment_.obstacles()[static_cast<std::size_t>(index)];
    if (o.shape == scene::Shape::frame) return;
    const geometry::SE3 pose = scene::motion_at(o, 0.0).pose;
    add("<body name='{}' mocap='{}' pos='{}' quat='{}'><geom name='{}' ", obstacle_body_name(index),
        environment_.moves(static_cast<std::size_t>(index)) ? "true" : "false", text(pose.p()),
        rotation(pose.R()), name_of(Kind::obstacle, index));
    switch (o.shape) {
      case scene::Shape::sphere:
        add("type='sphere' size='{}'", o.radius_m);
        break;
      case scene::Shape::box:
        add("type='box' size='{}'", text(0.5 * o.size_m));
        break;
      case scene::Shape::cylinder:
        add("type='cylinder' size='{} {}'", o.radius_m, 0.5 * o.length_m);
        break;
      case scene::Shape::capsule:
        add("type='capsule' size='{} {}'", o.radius_m, 0.5 * o.length_m);
        break;
      case scene::Shape::frame:
        break;
    }
    add("/></body>\n");
  }

  // The plant gives these boxes their places and sizes. Shapes that the compiler sees at the origin
  // of their body stay there.
  void add_map() {
    const geometry::SE3& pose = environment_.map_pose();
    add("<body name='{}' pos='{}' quat='{}'>", map_body_name, text(pose.p()), rotation(pose.R()));
    for (int i = 0; i < map_boxes_; ++i)
      add("<geom name='{}' type='box' pos='1 1 1' size='1 1 1'/>", name_of(Kind::map, i));
    add("</body>\n");
  }

  // All bodies have the axes of the base at q = 0.
  void add_arm() {
    const geometry::SE3& base = setup_.model.base();
    add("<body name='base' pos='{}' quat='{}'>\n", text(base.p()), rotation(base.R()));
    int index = 0;
    for (const auto& sphere : robot_.base_spheres)
      add_base_shape(index++, sphere.center_m, sphere.center_m, sphere.radius_m);
    for (const auto& capsule : robot_.base_segments)
      add_base_shape(index++, capsule.from_m, capsule.to_m, capsule.radius_m);
    for (int i = 0; i < robot_.dof(); ++i) add_link(i);
    for (int i = 0; i <= robot_.dof(); ++i) add("</body>");
  }

  // The base touches links only, see add_self_pairs().
  void add_base_shape(int index, const Vector3d& from, const Vector3d& to, double radius) {
    if (self_ != nullptr) add_shape(Kind::base, index, from, to, radius, false);
  }

  void add_link(int i) {
    const model::Link& link = robot_.links[static_cast<std::size_t>(i)];
    const Vector3d origin = joint_origin(robot_, i);
    add("<body name='{}' pos='{}'>", link_name(i), text(origin - joint_origin(robot_, i - 1)));
    add_joint(i);
    add("<inertial pos='{}' quat='{}' mass='1' diaginertia='1 1 1'/>\n",
        text(link.com.p() - origin), rotation(principal_inertia(link).axes));
    for (const int k : shapes_of_link_[static_cast<std::size_t>(i)]) {
      const model::Model::Shape& shape = setup_.model.shapes()[static_cast<std::size_t>(k)];
      const auto index = static_cast<std::size_t>(shape.index_in_link);
      Vector3d from, to;
      if (shape.is_capsule) {
        from = link.com * link.segments[index].from_m;
        to = link.com * link.segments[index].to_m;
      } else {
        from = to = link.com * link.spheres[index].center_m;
      }
      add_shape(Kind::link, k, from - origin, to - origin, shape.radius, true);
    }
  }

  void add_joint(int i) {
    const model::Joint& joint = robot_.links[static_cast<std::size_t>(i)].joint;
    add("<joint type='{}' axis='{}' armature='{}' damping='{}' frictionloss='{}'",
        joint.type == model::JointType::prismatic ? "slide" : "hinge", text(joint_axis(joint)),
        joint.armature, setup_.damping[i], setup_.friction[i]);
    if (setup_.scene.model.joint_limits && (joint.lower || joint.upper))
      add(" limited='true' range='{} {}'", joint.lower.value_or(-far_away),
          joint.upper.value_or(far_away));
    add("/>");
  }

  // @param touches_world whether it can touch obstacles and the map
  void add_shape(Kind kind, int index, const Vector3d& from, const Vector3d& to, double radius,
                 bool touches_world) {
    add("<geom name='{}' contype='{}' conaffinity='0' ", name_of(kind, index),
        touches_world ? 1 : 0);
    if (from == to)
      add("type='sphere' pos='{}' size='{}'/>\n", text(from), radius);
    else
      add("type='capsule' fromto='{} {}' size='{}'/>\n", text(from), text(to), radius);
  }

  void add_self_pairs() {
    const auto name = [](int shape) {
      return shape >= 0 ? name_of(Kind::link, shape) : name_of(Kind::base, -1 - shape);
    };
    add("<contact>\n");
    for (const auto& pair : self_->pairs())
      for (const int a : self_->parts()[static_cast<std::size_t>(pair.part_a)].shapes)
        for (const int b : self_->parts()[static_cast<std::size_t>(pair.part_b)].shapes)
          add("<pair geom1='{}' geom2='{}' condim='1' margin='0' gap='0'/>\n", name(a), name(b));
    add("</contact>\n");
  }

  const simulation::PlantSetup& setup_;
  const model::Robot& robot_;
  const scene::Environment& environment_;
  const scene::SelfField* self_;
  int map_boxes_;
  std::vector<std::vector<int>> shapes_of_link_;
  std::string out_;
};

}  // namespace

std::string name_of(Kind kind, int index) {
  return fmt::format("{} {}", kind_names[static_cast<std::size_t>(kind)], index);
}

ShapeId id_of(const char* name) {
  const std::string_view whole(name);
  const std::size_t space = whole.find(' ');
  for (std::size_t i = 0; i < kind_names.size(); ++i)
    if (whole.substr(0, space) == kind_names[i])
      return {static_cast<Kind>(i), std::atoi(name + space + 1)};
  return {};
}

std::string link_name(int link) {
  return fmt::format("link {}", link);
}

std::string obstacle_body_name(int obstacle) {
  return fmt::format("obstacle {}", obstacle);
}

PrincipalInertia principal_inertia(const model::Link& link) {
  const Eigen::Matrix3d in_base_axes =
      link.com.R() * model::symmetric_part(link.inertia_kg_m2) * link.com.R().transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(in_base_axes);
  PrincipalInertia out{principal.eigenvalues(), principal.eigenvectors()};
  if (out.axes.determinant() < 0.0) out.axes.col(0) *= -1.0;
  return out;
}

std::string mjcf(const simulation::PlantSetup& setup, const scene::Environment& environment,
                 const scene::SelfField* self, int map_boxes) {
  return Writer(setup, environment, self, map_boxes).write();
}

}  // namespace hamelin::mujoco
