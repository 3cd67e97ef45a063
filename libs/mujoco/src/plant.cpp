#include "hamelin/mujoco/plant.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "loading.hpp"
#include "mjcf.hpp"
#include "near_boxes.hpp"

namespace hamelin::mujoco {

namespace {

using Eigen::VectorXd;

constexpr int map_boxes_at_first = 64;

scene::Environment make_environment(const simulation::PlantSetup& setup) {
  const scene::Scene& scene = setup.scene;
  const double beyond_m =
      scene::payload_bounds(scene.events, setup.model, scene.name + ": /events").reach_m;
  return scene::make_environment(scene, setup.model, beyond_m);
}

class MujocoPlant final : public simulation::Plant {
 public:
  explicit MujocoPlant(const simulation::PlantSetup& setup)
      : setup_(setup),
        description_{"mujoco",
                     "MuJoCo",
                     api().mj_versionString(),
                     "mujoco-euler",
                     "improvement of the constraint solver",
                     0.0,
                     "reached a state that MuJoCo rejects",
                     true},
        environment_(make_environment(setup)),
        ws_(setup.model) {
    if (setup.scene.model.self_collision) self_.emplace(setup.model);
    build(environment_.map_field().empty() ? 0 : map_boxes_at_first);
    description_.tolerance = model_->opt.tolerance;
  }

  [[nodiscard]] const Description& description() const noexcept override { return description_; }

  void start(const VectorXd& q, const VectorXd& v) override {
    node_ = {0, 0.0, q, v};
    report_ = {};
    put_state();
    arrive(true);
  }

  [[nodiscard]] bool step(const VectorXd& torque, double step_s) override {
    model_->opt.timestep = step_s;
    std::copy_n(torque.data(), model_->nv, data_->qfrc_applied);
    if (!wrenches_.empty()) apply_wrenches();
    api().mj_step2(model_.get(), data_.get());
    report_ = {};
    report_.step_s = step_s;
    report_.evaluations = 1;
    report_.updates = data_->solver_iter;
    report_.converged = accepted();
    if (!report_.converged) return false;
    book_work(torque);
    ++node_.k;
    node_.time_s = static_cast<double>(node_.k) * step_s;
    std::copy_n(data_->qpos, model_->nq, node_.q.data());
    std::copy_n(data_->qvel, model_->nv, node_.v.data());
    arrive(!environment_.advance(node_.time_s).empty());
    return report_.converged = accepted();
  }

  void take_load() override {
    ws_ = dynamics::Workspace(setup_.model);
    if (self_) self_.emplace(setup_.model);
    build(map_boxes_);
    put_state();
    arrive(true);
  }

  void push(std::span<const dynamics::ExternalWrench> wrenches) override {
    wrenches_.assign(wrenches.begin(), wrenches.end());
  }

  void change_map(const scene::MapChangeSpec& change) override {
    environment_ = environment_.with_change(change);
    arrive(true);
  }

  void change_obstacle(std::size_t index, const scene::Obstacle& obstacle) override {
    environment_ = environment_.with_obstacle(index, obstacle);
    build(map_boxes_);
    put_state();
    arrive(true);
  }

  [[nodiscard]] integration::Energy energy() override {
    return {dynamics::kinetic_energy(setup_.model, ws_, node_.q, node_.v),
            dynamics::potential_energy(setup_.model, ws_, node_.q)};
  }

  [[nodiscard]] Contacts contacts() const override {
    Contacts found;
    for (int i = 0; i < data_->ncon; ++i) {
      if (data_->contact[i].dist > 0.0 || is_allowed(data_->contact[i])) continue;
      ++found.count;
      found.deepest_m = std::min(found.deepest_m, data_->contact[i].dist);
    }
    return found;
  }

  [[nodiscard]] std::string describe_contact() const override {
    const mjContact* deepest = nullptr;
    for (int i = 0; i < data_->ncon; ++i)
      if (!is_allowed(data_->contact[i]) &&
          (deepest == nullptr || data_->contact[i].dist < deepest->dist))
        deepest = data_->contact + i;
    if (deepest == nullptr) return "counts no contact";
    const bool link_first = shape(deepest->geom1).kind == Kind::link;
    return fmt::format("counts a contact at {:.9g} s: {} is {:.2g} mm inside {}", node_.time_s,
                       describe_shape(link_first ? deepest->geom1 : deepest->geom2),
                       -1e3 * deepest->dist,
                       describe_shape(link_first ? deepest->geom2 : deepest->geom1));
  }

  void allow(const scene::Allowance& allowance) override { allowance_ = allowance; }

 private:
  [[nodiscard]] bool is_allowed(const mjContact& contact) const {
    if (allowance_.empty()) return false;
    for (const int geom : {contact.geom1, contact.geom2}) {
      const ShapeId id = shape(geom);
      if (id.kind == Kind::obstacle &&
          allowance_.names(environment_.obstacles()[static_cast<std::size_t>(id.index)].name))
        return true;
      if (id.kind == Kind::map && allows(Eigen::Vector3d::Map(contact.pos))) return true;
    }
    return false;
  }
  // A voxel that a box touches is allowed as a whole.
  [[nodiscard]] bool allows(const Eigen::Vector3d& world) const {
    const Eigen::Vector3d p = setup_.scene.map->pose.inverse() * world;
    const double voxel = environment_.summary().resolution_m;
    return std::any_of(allowance_.boxes_m.begin(), allowance_.boxes_m.end(), [&](const auto& box) {
      return (p.array() >= box.lo.array() - voxel).all() &&
             (p.array() <= box.hi.array() + voxel).all();
    });
  }

  // Makes MuJoCo's model, at rest at q = 0, with room for so many boxes of the map.
  void build(int map_boxes) {
    data_.reset();
    map_boxes_ = map_boxes;
    model_ = load_model(mjcf(setup_, environment_, self_ ? &*self_ : nullptr, map_boxes),
                        setup_.scene.name);
    data_.reset(api().mj_makeData(model_.get()));
    const auto& links = setup_.model.robot().links;
    for (int i = 0; i < setup_.model.dof(); ++i) {
      const model::Link& link = links[static_cast<std::size_t>(i)];
      const int body = api().mj_name2id(model_.get(), mjOBJ_BODY, link_name(i).c_str());
      model_->body_mass[body] = link.mass_kg;
      std::copy_n(principal_inertia(link).moments.data(), 3, vector_of(model_->body_inertia, body));
    }
    api().mj_setConst(model_.get(), data_.get());
    find_obstacles();
    std::vector<int> shapes;
    for (int geom = 0; geom < model_->ngeom; ++geom)
      if (shape(geom).kind == Kind::link) shapes.push_back(geom);
    near_.set_arm(std::move(shapes));
  }

  void find_obstacles() {
    obstacles_.clear();
    const auto& obstacles = environment_.obstacles();
    for (std::size_t k = 0; k < obstacles.size(); ++k) {
      const scene::Obstacle& obstacle = obstacles[k];
      const int index = static_cast<int>(k);
      const int geom = api().mj_name2id(model_.get(), mjOBJ_GEOM,
                                        name_of(Kind::obstacle, index).c_str()),
                body =
                    api().mj_name2id(model_.get(), mjOBJ_BODY, obstacle_body_name(index).c_str());
      if (obstacle.shape != scene::Shape::frame &&
          (environment_.moves(k) || obstacle.appears_s > 0.0))
        obstacles_.push_back({&obstacle, geom, model_->body_mocapid[body]});
    }
  }

  void put_state() {
    api().mj_resetData(model_.get(), data_.get());
    std::copy_n(node_.q.data(), model_->nq, data_->qpos);
    std::copy_n(node_.v.data(), model_->nv, data_->qvel);
  }

  // Finds contacts and constraints at the node, with the obstacles where they are now.
  // @param other_map whether the map is not that of the node before
  void arrive(bool other_map) {
    for (const ChangingObstacle& o : obstacles_) {
      model_->geom_conaffinity[o.geom] = scene::exists(*o.obstacle, node_.time_s) ? 1 : 0;
      if (o.mocap < 0) continue;
      const geometry::SE3 at = scene::motion_at(*o.obstacle, node_.time_s).pose;
      std::copy_n(at.p().data(), 3, vector_of(data_->mocap_pos, o.mocap));
      std::copy_n(geometry::quaternion_wxyz(at.R()).data(), 4, data_->mocap_quat + 4 * o.mocap);
    }
    api().mj_step1(model_.get(), data_.get());
    if (environment_.map_field().empty()) return;
    const double moved = near_.moved_m(*data_);
    if (!other_map && moved < 0.5 * NearBoxes::slack_m) return;
    choose_boxes();
    // The boxes chosen before were not all that the arm may touch here.
    if (other_map || moved > NearBoxes::slack_m) api().mj_step1(model_.get(), data_.get());
  }

  void choose_boxes() {
    const scene::BoxField& field = environment_.map_field().boxes();
    const int count = near_.choose(field, environment_.map_pose(), *model_, *data_);
    if (count > map_boxes_) {
      const std::vector<double> warm(data_->qacc_warmstart, data_->qacc_warmstart + model_->nv);
      build(std::max(count, 2 * map_boxes_));
      put_state();
      std::copy_n(warm.data(), model_->nv, data_->qacc_warmstart);
      return arrive(true);
    }
    near_.place(field, *model_, api().mj_name2id(model_.get(), mjOBJ_BODY, map_body_name));
  }

  // MuJoCo resets a state with numbers that are not finite or too large, and counts a warning.
  [[nodiscard]] bool accepted() const {
    for (const int kind : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
      if (data_->warning[kind].number > 0) return false;
    return true;
  }

  // Adds the wrenches at the node to the joint torques, by MuJoCo's own Jacobians.
  void apply_wrenches() {
    dynamics::forward_kinematics(setup_.model, ws_, node_.q);
    for (const dynamics::ExternalWrench& each : wrenches_) {
      const int link = setup_.model.frames()[static_cast<std::size_t>(each.frame)].link;
      if (link < 0) continue;
      const geometry::SE3 pose = dynamics::frame_pose(setup_.model, ws_, each.frame);
      const dynamics::Vector6d wrench = dynamics::aligned_wrench(each, pose);
      api().mj_applyFT(model_.get(), data_.get(), wrench.data() + 3, wrench.data(), pose.p().data(),
                       api().mj_name2id(model_.get(), mjOBJ_BODY, link_name(link).c_str()),
                       data_->qfrc_applied);
    }
  }

  // Works of the step that led from the node to the state: torques times the displacement. Damping
  // acts at the velocity at the end of the step.
  void book_work(const VectorXd& torque) {
    for (int i = 0; i < model_->nv; ++i) {
      const double moved = data_->qpos[i] - node_.q[i];
      report_.held_work_J += torque[i] * moved;
      report_.external_work_J += (data_->qfrc_applied[i] - torque[i]) * moved;
      report_.dissipated_J +=
          (setup_.damping[i] * data_->qvel[i] - data_->qfrc_constraint[i]) * moved;
    }
  }

  [[nodiscard]] ShapeId shape(int geom) const {
    return id_of(api().mj_id2name(model_.get(), mjOBJ_GEOM, geom));
  }

  [[nodiscard]] std::string describe_shape(int geom) const {
    const ShapeId id = shape(geom);
    switch (id.kind) {
      case Kind::link:
        return setup_.model.describe(setup_.model.shapes()[static_cast<std::size_t>(id.index)]);
      case Kind::base:
        return fmt::format("shape {} of the base", id.index);
      case Kind::obstacle:
        return environment_.describe(id.index);
      case Kind::map:
        return environment_.describe(scene::Contact::map);
    }
    return {};
  }

  /// An obstacle that moves or appears.
  struct ChangingObstacle {
    const scene::Obstacle* obstacle;
    int geom;
    int mocap;  ///< −1: does not move
  };

  simulation::PlantSetup setup_;
  Description description_;
  scene::Environment environment_;
  scene::Allowance allowance_;
  std::optional<scene::SelfField> self_;
  dynamics::Workspace ws_;
  ModelPointer model_;
  DataPointer data_;
  int map_boxes_ = 0;  ///< that the model has room for
  NearBoxes near_;
  std::vector<ChangingObstacle> obstacles_;
  std::vector<dynamics::ExternalWrench> wrenches_;
};

}  // namespace

std::unique_ptr<simulation::Plant> make_plant(const simulation::PlantSetup& setup) {
  const model::Robot& robot = setup.model.robot();
  if (robot.dof() > joints_max)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /plant/type: '{}' has {} joints, expected at most {} for MuJoCo",
                            setup.scene.name, robot.name, robot.dof(), joints_max));
  return std::make_unique<MujocoPlant>(setup);
}

}  // namespace hamelin::mujoco
