#include <fmt/format.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <map>
#include <string_view>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/srdf.hpp"
#include "urdf_tree.hpp"

namespace hamelin::description {

namespace {

using detail::UrdfBody;
using detail::UrdfJoint;
using detail::UrdfLink;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::SE3;

// The <inertial> of one URDF link, in the base frame.
struct Inertial {
  SE3 frame;  // COM frame in the base frame
  double mass_kg = 0.0;
  Matrix3d inertia;  // in that frame
  const UrdfLink* link = nullptr;
};

// The sum of inertias about their common centre of mass, in the axes of `axes`. Without mass, the
// centre is the origin of `axes`.
Inertial sum_of(const std::vector<Inertial>& parts, const SE3& axes) {
  Inertial sum;
  Vector3d moment = Vector3d::Zero();
  for (const Inertial& part : parts) {
    sum.mass_kg += part.mass_kg;
    moment += part.mass_kg * part.frame.p();
  }
  sum.frame = SE3(axes.R(), sum.mass_kg > 0.0 ? Vector3d(moment / sum.mass_kg) : axes.p());
  Matrix3d I = Matrix3d::Zero();
  for (const Inertial& part : parts) {
    const SE3 in_com = sum.frame.inverse() * part.frame;
    const Vector3d& c = in_com.p();
    I += in_com.R() * part.inertia * in_com.R().transpose() +
         part.mass_kg * (c.squaredNorm() * Matrix3d::Identity() - c * c.transpose());
  }
  sum.inertia = 0.5 * (I + I.transpose());
  return sum;
}

class Reader {
 public:
  Reader(const detail::UrdfFile& file, const std::string& where, const RobotOptions& options)
      : file_(file),
        where_(where),
        options_(options),
        tree_(detail::make_tree(file, where, options.tip)) {}

  Robot read() {
    robot_.name = file_.name;
    robot_.notes = tree_.notes;
    read_collision_shapes();
    for (std::size_t i = 0; i < tree_.bodies.size(); ++i) robot_.links.push_back(moving_link(i));
    keep_base_shapes();
    const std::string& tip = tree_.tip->name();
    robot_.tip = {tip, static_cast<int>(tree_.bodies.size()) - 1, tree_.poses.at(tip)};
    for (const UrdfLink* link : tree_.order)
      if (link != tree_.tip)
        robot_.frames.push_back(
            {link->name(), tree_.body_of.at(link->name()), tree_.poses.at(link->name())});
    disable_pairs();
    note_skipped();
    detail::round_to_quaternions(robot_);
    model::check(robot_, where_);
    return std::move(robot_);
  }

 private:
  [[noreturn]] void fail_at(const UrdfLink& link, const std::string& message) const {
    detail::fail(ErrorCode::invalid, where_, link.shapes.line,
                 fmt::format("link '{}': {}", link.name(), message));
  }
  [[noreturn]] void fail_at(const UrdfJoint& joint, const std::string& message) const {
    detail::fail(ErrorCode::invalid, where_, joint.line,
                 fmt::format("joint '{}': {}", joint.name, message));
  }
  template <class... Args>
  void note(const char* format, const Args&... args) {
    robot_.notes.push_back(fmt::format(fmt::runtime(format), args...));
  }

  // ---- collision shapes: those of the file, or the sidecar's ----

  // Spheres by URDF link, in that link's frame.
  void read_collision_shapes() {
    std::size_t own_spheres = 0;
    for (const UrdfLink* link : tree_.order)
      for (const LinkShape& shape : link->shapes.collision) {
        if (shape.kind != LinkShape::Kind::sphere) continue;
        detail::check_sizes(shape, {where_, fmt::format("link '{}'", link->name())});
        spheres_.links[link->name()].push_back({shape.pose.p(), shape.radius_m});
        ++own_spheres;
      }
    if (auto sidecar = detail::sidecar_of(options_))
      apply_sidecar(std::move(*sidecar), own_spheres);
    apply_srdf();
    std::size_t moving = 0;
    const auto count = [&](const auto& by_link, const char* shapes) {
      std::size_t fixed = 0;
      for (const auto& [name, list] : by_link)
        (tree_.body_of.at(name) < 0 ? fixed : moving) += list.size();
      if (fixed > 0)
        note("{} collision {} on the base do not move and are checked for self-collision only",
             fixed, shapes);
    };
    count(spheres_.links, "spheres");
    count(spheres_.capsules, "capsules");
    if (moving == 0) note("no collision spheres or capsules: collisions are not checked");
  }

  void apply_sidecar(detail::SphereFile sidecar, std::size_t own_spheres) {
    spheres_ = std::move(sidecar);
    if (own_spheres > 0)
      note("the file's own {} collision spheres are replaced by those of {}", own_spheres,
           std::filesystem::path(spheres_.where).filename().string());
    for (const auto& [name, list] : spheres_.links) require_link(name);
    for (const auto& [name, list] : spheres_.capsules) require_link(name);
    for (const auto& [a, b] : spheres_.self_collision_disabled) {
      require_link(a);
      require_link(b);
    }
  }

  void apply_srdf() {
    if (!options_.srdf) return;
    const auto pairs = read_srdf(*options_.srdf, link_names());
    robot_.notes.push_back(
        detail::merge_pairs(spheres_.self_collision_disabled, pairs, options_.srdf->filename()));
  }

  [[nodiscard]] std::vector<std::string> link_names() const {
    std::vector<std::string> names;
    for (const UrdfLink* link : tree_.order) names.push_back(link->name());
    return names;
  }

  void require_link(const std::string& name) const {
    if (tree_.poses.count(name) == 0)
      detail::fail(
          ErrorCode::invalid, spheres_.where, 0,
          fmt::format("the robot has no link '{}'{}", name, did_you_mean(name, link_names())));
  }

  // ---- moving links ----

  Link moving_link(std::size_t index) {
    const UrdfBody& body = tree_.bodies[index];
    Link out;
    out.name = body.own->name();
    out.parent = static_cast<int>(index) - 1;
    out.joint = moving_joint(*body.own);
    set_inertia(out, body);
    const SE3 to_com = out.com.inverse();
    for (const UrdfLink* member : body.members)
      if (const auto list = spheres_.links.find(member->name()); list != spheres_.links.end())
        for (const Sphere& sphere : list->second)
          out.spheres.push_back({to_com * (tree_.poses.at(member->name()) * sphere.center_m),
                                 sphere.radius_m, member == body.own ? "" : member->name()});
    for (const UrdfLink* member : body.members)
      if (const auto list = spheres_.capsules.find(member->name()); list != spheres_.capsules.end())
        for (const Segment& capsule : list->second) {
          const SE3 to_link = to_com * tree_.poses.at(member->name());
          out.segments.push_back({to_link * capsule.from_m, to_link * capsule.to_m,
                                  capsule.radius_m, member == body.own ? "" : member->name()});
        }
    return out;
  }

  Joint moving_joint(const UrdfLink& child) {
    const UrdfJoint& joint = *tree_.joint.at(child.name());
    const SE3& frame = tree_.poses.at(child.name());
    const Vector3d axis = frame.R() * joint.axis;
    Joint out;
    out.name = joint.name;
    if (joint.type == UrdfJoint::Type::prismatic) {
      out.type = JointType::prismatic;
      out.screw.tail<3>() = axis;
    } else {
      out.screw << axis, frame.p().cross(axis);
    }
    const std::string axis_note = detail::normalise_screw(
        out, fmt::format("{}: line {}: joint '{}'", where_, joint.line, joint.name));
    if (!axis_note.empty()) robot_.notes.push_back(axis_note);
    out.damping = joint.damping;
    out.friction = joint.friction;
    if (joint.limits) set_limits(out, joint, *joint.limits);
    return out;
  }

  void set_limits(Joint& out, const UrdfJoint& joint, const detail::UrdfLimits& limits) {
    if (joint.type != UrdfJoint::Type::continuous) {
      if (!(limits.lower < limits.upper))
        fail_at(joint, fmt::format("lower limit {} is not below upper limit {}", limits.lower,
                                   limits.upper));
      out.lower = limits.lower;
      out.upper = limits.upper;
    } else if (limits.has_position) {
      note("joint '{}': continuous, so its position limits are ignored", joint.name);
    }
    const auto bound = [&](const char* attribute, double value) -> std::optional<double> {
      if (value < 0.0)
        fail_at(joint, fmt::format("{} limit {}, expected a positive number", attribute, value));
      if (value > 0.0) return value;
      note("joint '{}': {}=\"0\" is read as no limit", joint.name, attribute);
      return std::nullopt;
    };
    out.effort_max = bound("effort", limits.effort);
    out.velocity_max = bound("velocity", limits.velocity);
  }

  // The <inertial> of one URDF link, if it has mass or inertia.
  std::optional<Inertial> inertial_of(const UrdfLink& link) {
    if (!link.inertial) return std::nullopt;
    const double mass = link.inertial->mass_kg;
    const Matrix3d& I = link.inertial->inertia_kg_m2;
    if (!(mass >= 0.0)) fail_at(link, fmt::format("mass {} kg, expected at least 0", mass));
    const std::string fault = model::inertia_fault(I, false);
    if (!fault.empty()) fail_at(link, "inertia " + fault);
    detail::check_triangle_inequality(robot_, link.name(), I, options_.strict,
                                      fmt::format("{}: line {}", where_, link.shapes.line));
    if (mass == 0.0 && I.isZero(0.0)) return std::nullopt;
    if (mass == 0.0)
      robot_.warnings.push_back(
          fmt::format("link '{}' has inertia but no mass; the inertia is used", link.name()));
    return Inertial{tree_.poses.at(link.name()) * link.inertial->pose, mass, I, &link};
  }

  void set_inertia(Link& out, const UrdfBody& body) {
    std::vector<Inertial> parts;
    for (const UrdfLink* member : body.members)
      if (auto part = inertial_of(*member)) parts.push_back(*part);
    const bool alone = parts.size() == 1 && parts.front().link == body.own;
    const Inertial all = alone ? parts.front() : sum_of(parts, tree_.poses.at(body.own->name()));
    out.com = all.frame;
    out.mass_kg = all.mass_kg;
    out.inertia_kg_m2 = all.inertia;
    detail::check_triangle_inequality(robot_, out.name, all.inertia, options_.strict, where_);
  }

  // ---- the base, pairs, notes ----

  void keep_base_shapes() {
    for (const UrdfLink* link : tree_.order) {
      const std::string& name = link->name();
      if (tree_.body_of.at(name) >= 0) continue;
      const SE3& pose = tree_.poses.at(name);
      if (const auto list = spheres_.links.find(name); list != spheres_.links.end())
        for (const Sphere& sphere : list->second)
          robot_.base_spheres.push_back({pose * sphere.center_m, sphere.radius_m, name});
      if (const auto list = spheres_.capsules.find(name); list != spheres_.capsules.end())
        for (const Segment& capsule : list->second)
          robot_.base_segments.push_back(
              {pose * capsule.from_m, pose * capsule.to_m, capsule.radius_m, name});
    }
  }

  // Pairs keep the names of the file. A pair is dropped if one of its links has no shape and is not
  // moved by a joint of its own.
  void disable_pairs() {
    const auto has_shapes = [](const auto& by_link, const std::string& name) {
      const auto list = by_link.find(name);
      return list != by_link.end() && !list->second.empty();
    };
    const auto is_part = [&](const std::string& name) {
      return has_shapes(spheres_.links, name) || has_shapes(spheres_.capsules, name) ||
             std::any_of(tree_.bodies.begin(), tree_.bodies.end(),
                         [&](const UrdfBody& body) { return body.own->name() == name; });
    };
    for (const auto& [a, b] : spheres_.self_collision_disabled)
      if (is_part(a) && is_part(b)) robot_.self_collision_disabled.emplace_back(a, b);
  }

  void note_skipped() {
    std::vector<std::string> skipped;
    bool shapes = false;
    for (const auto& [element, count] : file_.skipped) {
      skipped.push_back(fmt::format("{} {}", count, element));
      shapes = shapes || element.rfind("<collision>", 0) == 0;
    }
    if (!skipped.empty())
      note("skipped: {}{}", detail::join(skipped),
           shapes && spheres_.where.empty()
               ? "; `hamelin robot fit` makes spheres or capsules of collision shapes"
               : "");
  }

  const detail::UrdfFile& file_;
  const std::string& where_;
  const RobotOptions& options_;
  detail::UrdfTree tree_;
  Robot robot_;
  detail::SphereFile spheres_;
};

}  // namespace

Robot detail::read_urdf(const std::string& text, const std::string& where,
                        const RobotOptions& options) {
  const UrdfFile file = read_urdf_file(text, where, Visuals::skip);
  return Reader(file, where, options).read();
}

}  // namespace hamelin::description
