#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <tinyxml2.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/frames.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/temporary.hpp"

// The checks share no code with hamelin: urdfdom reads the file and Eigen places its links, and
// MuJoCo reads the file with its own reader.
using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using geometry::SE3;

namespace {

namespace fs = std::filesystem;

const fs::path source = HAMELIN_SOURCE_DIR;
const std::vector<std::string> files{
    "data/robots/arm6.urdf",    "data/robots/arm7.urdf",  "data/robots/desk6.urdf",
    "data/robots/gantry.urdf",  "data/robots/rail7.urdf", "data/robots/third_party/panda.urdf",
    "tests/follow/wrist6.urdf",
};

struct File {
  std::string name, text, tip;
};

// A URDF with a moving chain, and twigs of fixed and of moving joints on it and on the base.
File random_file(std::uint64_t seed) {
  Rng rng(seed);
  const auto triple = [&](double size) {
    const Vector3d x = test::random_vector(rng, size);
    return fmt::format("{:.17g} {:.17g} {:.17g}", x.x(), x.y(), x.z());
  };
  std::string links, joints;
  int count = 0;
  const auto add = [&](const std::string& parent, const std::string& type) {
    const std::string name = fmt::format("part{}", ++count);
    links += fmt::format(
        "<link name='{}'><inertial><origin xyz='{}' rpy='{}'/><mass value='1'/><inertia "
        "ixx='0.1' iyy='0.1' izz='0.1' ixy='0' ixz='0' iyz='0'/></inertial></link>\n",
        name, triple(0.1), triple(3.0));
    joints += fmt::format(
        "<joint name='to_{}' type='{}'><parent link='{}'/><child link='{}'/><origin xyz='{}' "
        "rpy='{}'/><axis xyz='{}'/>{}</joint>\n",
        name, type, parent, name, triple(0.4), triple(3.0), triple(1.0),
        type == "fixed" ? "" : "<limit lower='-2' upper='2' effort='1' velocity='1'/>");
    return name;
  };
  std::string tip = "base";
  for (int i = 0; i < 6; ++i) {
    for (int twig = static_cast<int>(rng.uniform(0.0, 3.0)); twig > 0; --twig)
      add(add(tip, "fixed"), twig == 2 ? "revolute" : "fixed");
    if (i % 2 == 1) tip = add(tip, "fixed");
    tip = add(tip, rng.uniform(0.0, 1.0) < 0.3 ? "prismatic" : "revolute");
  }
  tip = add(tip, "fixed");
  const std::string name = fmt::format("random{}", seed);
  return {
      name,
      fmt::format("<robot name='{}'>\n<link name='base'/>\n{}{}</robot>\n", name, links, joints),
      tip};
}

std::vector<File> robots() {
  std::vector<File> out;
  for (const std::string& file : files) {
    const auto urdf = urdf::parseURDFFile((source / file).string());
    std::string tip = urdf->getRoot()->name;
    while (!urdf->getLink(tip)->child_links.empty())
      tip = urdf->getLink(tip)->child_links.front()->name;
    out.push_back({file, read_file(source / file), tip});
  }
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) out.push_back(random_file(seed));
  return out;
}

Isometry3d isometry(const urdf::Pose& pose) {
  Isometry3d g = Isometry3d::Identity();
  g.translation() = Vector3d(pose.position.x, pose.position.y, pose.position.z);
  g.linear() =
      Eigen::Quaterniond(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z)
          .toRotationMatrix();
  return g;
}

// The pose of a link as a product of the joint transforms from the root; joints without a position
// are at 0.
Isometry3d placed(const urdf::ModelInterface& urdf, const std::string& name,
                  const std::map<std::string, double>& at) {
  Isometry3d g = Isometry3d::Identity();
  for (auto link = urdf.getLink(name); link->parent_joint;
       link = urdf.getLink(link->parent_joint->parent_link_name)) {
    const auto& joint = *link->parent_joint;
    Isometry3d step = isometry(joint.parent_to_joint_origin_transform);
    const Vector3d axis = Vector3d(joint.axis.x, joint.axis.y, joint.axis.z).normalized();
    if (const auto x = at.find(joint.name); x != at.end()) {
      if (joint.type == urdf::Joint::PRISMATIC)
        step.translate(axis * x->second);
      else
        step.rotate(Eigen::AngleAxisd(x->second, axis));
    }
    g = step * g;
  }
  return g;
}

// MuJoCo's model of a URDF, with all links as bodies and without shapes.
class Mujoco {
 public:
  explicit Mujoco(const std::string& text) {
    tinyxml2::XMLDocument document;
    REQUIRE(document.Parse(text.c_str()) == tinyxml2::XML_SUCCESS);
    auto* robot = document.FirstChildElement("robot");
    for (auto* link = robot->FirstChildElement("link"); link != nullptr;
         link = link->NextSiblingElement("link"))
      for (const char* shape : {"visual", "collision"})
        while (auto* element = link->FirstChildElement(shape)) link->DeleteChild(element);
    auto* compiler = robot->InsertNewChildElement("mujoco")->InsertNewChildElement("compiler");
    compiler->SetAttribute("fusestatic", "false");
    compiler->SetAttribute("boundmass", "0.001");
    compiler->SetAttribute("boundinertia", "0.000001");
    compiler->SetAttribute("balanceinertia", "true");
    const fs::path file = test::temporary("robot.urdf");
    REQUIRE(document.SaveFile(file.c_str()) == tinyxml2::XML_SUCCESS);
    char message[1000] = "";
    model_.reset(mj_loadXML(file.c_str(), nullptr, message, sizeof message));
    INFO(message);
    REQUIRE(model_ != nullptr);
    data_.reset(mj_makeData(model_.get()));
  }
  void place(const std::map<std::string, double>& at) {
    mju_zero(data_->qpos, model_->nq);
    for (const auto& [name, x] : at) data_->qpos[model_->jnt_qposadr[joint(name)]] = x;
    mj_kinematics(model_.get(), data_.get());
    mj_comPos(model_.get(), data_.get());
  }
  // Of a link; the root of the file is MuJoCo's world.
  [[nodiscard]] Isometry3d pose(const std::string& link) const {
    Isometry3d g = Isometry3d::Identity();
    const int body = mj_name2id(model_.get(), mjOBJ_BODY, link.c_str());
    if (body < 0) return g;
    g.translation() = Eigen::Map<const Vector3d>(data_->xpos + 3 * body);
    g.linear() =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(data_->xmat + 9 * body);
    return g;
  }
  // In world axes, of a link's origin; columns in the order of names.
  [[nodiscard]] Matrix6Xd jacobian(const std::string& link,
                                   const std::vector<std::string>& joints) const {
    Matrix6Xd J = Matrix6Xd::Zero(6, static_cast<Eigen::Index>(joints.size()));
    const int body = mj_name2id(model_.get(), mjOBJ_BODY, link.c_str());
    if (body < 0) return J;
    using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
    Rows linear(3, model_->nv), angular(3, model_->nv);
    mj_jacBody(model_.get(), data_.get(), linear.data(), angular.data(), body);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const int column = model_->jnt_dofadr[joint(joints[j])];
      J.col(static_cast<Eigen::Index>(j)) << angular.col(column), linear.col(column);
    }
    return J;
  }

 private:
  [[nodiscard]] int joint(const std::string& name) const {
    const int id = mj_name2id(model_.get(), mjOBJ_JOINT, name.c_str());
    REQUIRE(id >= 0);
    return id;
  }
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model_{nullptr, &mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_{nullptr, &mj_deleteData};
};

double difference(const SE3& a, const Isometry3d& b) {
  return std::max((a.R() - b.linear()).norm(), (a.p() - b.translation()).norm());
}

}  // namespace

TEST_CASE("every link of a URDF is a frame, where urdfdom and MuJoCo have it", "[frames]") {
  for (const File& file : robots()) {
    CAPTURE(file.name);
    const fs::path path = test::temporary("given.urdf");
    write_file_atomically(path, file.text);
    description::RobotOptions options;
    options.tip = file.tip;
    const Model model(description::read_robot(path, options));
    const auto urdf = urdf::parseURDF(file.text);
    Mujoco mujoco(file.text);
    REQUIRE(model.frames().size() == urdf->links_.size());
    std::vector<std::string> joints;
    for (const auto& link : model.robot().links) joints.push_back(link.joint.name);
    Workspace ws(model);
    Matrix6Xd J(6, model.dof());
    Rng rng(7);
    for (int k = 0; k < 20; ++k) {
      const VectorXd q = test::random_within_limits(model, rng);
      std::map<std::string, double> at;
      for (std::size_t j = 0; j < joints.size(); ++j)
        at[joints[j]] = q[static_cast<Eigen::Index>(j)];
      mujoco.place(at);
      forward_kinematics(model, ws, q);
      for (const auto& [name, link] : urdf->links_) {
        CAPTURE(name);
        const int frame = model.frame(name);
        const SE3 pose = frame_pose(model, ws, frame);
        CHECK(difference(pose, placed(*urdf, name, at)) <= 1e-12);
        CHECK(difference(pose, mujoco.pose(name)) <= 1e-12);
        frame_jacobian(model, ws, frame, Reference::local_world_aligned, J);
        CHECK((J - mujoco.jacobian(name, joints)).norm() <= 1e-12);
      }
    }
  }
}
