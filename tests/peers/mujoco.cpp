#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <array>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "peer.hpp"

namespace hamelin::peers {

namespace {

// The model with contacts, constraints and warm start switched off: a chain does not need them.
std::string mjcf(const model::Robot& robot) {
  std::string open, close;
  for (int i = 0; i < robot.dof(); ++i) {
    const auto& link = robot.links[static_cast<std::size_t>(i)];
    const Eigen::Vector3d at = joint_origin(robot, i) - joint_origin(robot, i - 1);
    const Eigen::Vector3d com = link.com.p() - joint_origin(robot, i),
                          axis = joint_axis(link.joint);
    // principal axes are computed here, because MuJoCo's own search for them ends at 1e-8
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(inertia_in_base_axes(link));
    Eigen::Matrix3d axes = principal.eigenvectors();
    if (axes.determinant() < 0.0) axes.col(0) *= -1.0;
    const Eigen::Quaterniond turn(axes);
    const Eigen::Vector3d& I = principal.eigenvalues();
    open += fmt::format(
        "<body pos='{:.17g} {:.17g} {:.17g}'><joint type='{}' axis='{:.17g} {:.17g} {:.17g}'/>"
        "<inertial pos='{:.17g} {:.17g} {:.17g}' mass='{:.17g}' "
        "quat='{:.17g} {:.17g} {:.17g} {:.17g}' diaginertia='{:.17g} {:.17g} {:.17g}'/>\n",
        at.x(), at.y(), at.z(), link.joint.type == model::JointType::prismatic ? "slide" : "hinge",
        axis.x(), axis.y(), axis.z(), com.x(), com.y(), com.z(), link.mass_kg, turn.w(), turn.x(),
        turn.y(), turn.z(), I[0], I[1], I[2]);
    close += "</body>";
  }
  return fmt::format(
      "<mujoco><compiler angle='radian' inertiafromgeom='false'/>"
      "<size nuser_body='0'/><option gravity='0 0 -9.81'><flag contact='disable' "
      "constraint='disable' "
      "warmstart='disable'/></option><worldbody>{}{}</worldbody></mujoco>",
      open, close);
}

class MujocoStepper final : public Stepper {
 public:
  MujocoStepper(const mjModel* model, int integrator)
      : model_(mj_copyModel(nullptr, model), mj_deleteModel),
        data_(mj_makeData(model_.get()), mj_deleteData) {
    model_->opt.integrator = integrator;
  }
  void set(const VectorXd& q, const VectorXd& v) override {
    mj_resetData(model_.get(), data_.get());
    mju_copy(data_->qpos, q.data(), model_->nq);
    mju_copy(data_->qvel, v.data(), model_->nv);
  }
  bool step(double h) override {
    model_->opt.timestep = h;
    mj_step(model_.get(), data_.get());
    // MuJoCo resets its state if it diverges, and counts a warning
    for (const int kind : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
      if (data_->warning[kind].number > 0) return false;
    return true;
  }
  void get(VectorXd& q, VectorXd& v) override {
    mju_copy(q.data(), data_->qpos, model_->nq);
    mju_copy(v.data(), data_->qvel, model_->nv);
  }

 private:
  std::unique_ptr<mjModel, void (*)(mjModel*)> model_;
  std::unique_ptr<mjData, void (*)(mjData*)> data_;
};

class Mujoco final : public Peer {
 public:
  explicit Mujoco(const model::Robot& robot) {
    const auto file =
        std::filesystem::temp_directory_path() / fmt::format("hamelin_peers_{}.xml", ::getpid());
    std::ofstream(file) << mjcf(robot);
    std::array<char, 1000> error{};
    model_.reset(mj_loadXML(file.c_str(), nullptr, error.data(), static_cast<int>(error.size())));
    std::filesystem::remove(file);
    if (!model_) throw std::runtime_error(fmt::format("MuJoCo: {}", error.data()));
    data_.reset(mj_makeData(model_.get()));
  }
  [[nodiscard]] std::string name() const override {
    return fmt::format("MuJoCo {}", mj_versionString());
  }
  void inverse_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& a,
                        VectorXd& tau) override {
    mju_copy(data_->qpos, q.data(), model_->nq);
    mju_copy(data_->qvel, v.data(), model_->nv);
    mju_copy(data_->qacc, a.data(), model_->nv);
    mj_inverse(model_.get(), data_.get());
    mju_copy(tau.data(), data_->qfrc_inverse, model_->nv);
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& tau,
                        VectorXd& a) override {
    mju_copy(data_->qpos, q.data(), model_->nq);
    mju_copy(data_->qvel, v.data(), model_->nv);
    mju_copy(data_->qfrc_applied, tau.data(), model_->nv);
    mj_forward(model_.get(), data_.get());
    mju_copy(a.data(), data_->qacc, model_->nv);
  }
  [[nodiscard]] std::vector<std::string> steppers() const override {
    return {"Euler", "RK4", "implicit"};
  }
  [[nodiscard]] std::unique_ptr<Stepper> stepper(const std::string& name) override {
    const int integrator = name == "Euler" ? mjINT_EULER
                           : name == "RK4" ? mjINT_RK4
                                           : mjINT_IMPLICIT;
    return std::make_unique<MujocoStepper>(model_.get(), integrator);
  }

 private:
  std::unique_ptr<mjModel, void (*)(mjModel*)> model_{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, void (*)(mjData*)> data_{nullptr, mj_deleteData};
};

}  // namespace

std::unique_ptr<Peer> make_mujoco(const model::Robot& robot) {
  constexpr int links_max = 90;  // limit of the nesting depth in MuJoCo's XML reader
  if (robot.dof() > links_max) return nullptr;
  // the steppers report warnings; by default MuJoCo writes them to a log file
  mju_user_warning = [](const char*) {};
  return std::make_unique<Mujoco>(robot);
}

}  // namespace hamelin::peers
