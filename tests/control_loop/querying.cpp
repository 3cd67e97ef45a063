// A planner whose own threads query the world while its tick goes on. It holds the arm at rest.
// Each thread checks that the answers of its handle agree with each other; a contradiction fails
// the next tick.
#include <atomic>
#include <cmath>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/planning/nominal_arm.hpp"

namespace {

using namespace hamelin::planning;

constexpr const char* schema = R"({
  "type": "object",
  "additionalProperties": false,
  "properties": {
    "threads": {"type": "integer", "minimum": 0, "maximum": 64, "default": 8}
  }
})";

class Querying : public Planner {
 public:
  static constexpr std::uint32_t properties = HAMELIN_USES_THREADS;

  Querying(const Host& host, const Setup& setup, const hamelin::Json& params)
      : host_(host), setup_(setup), arm_(setup), torque_(Eigen::VectorXd::Zero(setup.dof())) {
    rounds_series_ = host.declare_series("rounds", "");
    world_series_ = host.declare_series("newest snapshot queried", "");
    for (int i = 0; i < params.at("threads").get<int>(); ++i)
      threads_.emplace_back([this, i] { work(static_cast<std::uint64_t>(i)); });
  }
  ~Querying() override {
    stop_ = true;
    for (auto& thread : threads_) thread.join();
  }

  void tick(const Tick& tick, Command& command) override {
    if (const int fault = fault_; fault != 0)
      throw std::runtime_error("the answers of a query contradict each other: fault " +
                               std::to_string(fault));
    arm_.update(tick);
    torque_.setZero();
    arm_.add_gravity(torque_);
    command.held_torque() = torque_;
    command.damping().setConstant(50.0);
    command.set_series(rounds_series_, static_cast<double>(rounds_.load()));
    command.set_series(world_series_, static_cast<double>(world_.load()));
  }

 private:
  void expect(bool right, int fault) {
    if (!right) fault_ = fault;
  }

  void work(std::uint64_t seed) {
    Query query(host_);
    hamelin::Rng rng(seed + 1);
    const auto dof = static_cast<std::size_t>(setup_.dof());
    std::vector<double> q(4 * dof), clearance(4);
    std::vector<hamelin_contact> contacts(20000);
    std::vector<hamelin_self_contact> self(1000);
    std::vector<hamelin_box> boxes(256);
    std::vector<hamelin_obstacle_state> obstacles(64);
    std::uint64_t last = 0;
    while (!stop_) {
      const Query::Snapshot now = query.refresh();
      expect(now.world >= last, 1);
      last = now.world;
      if (std::uint64_t seen = world_; seen < last) world_.compare_exchange_strong(seen, last);
      for (auto& x : q) x = rng.uniform(-2.0, 2.0);
      query.clearance(q, 0.1, -1.0, clearance);
      for (std::size_t i = 0; i < 4; ++i)
        check_configuration(query, std::span(q).subspan(i * dof, dof), clearance[i], contacts,
                            self);
      const std::span from = std::span(q).first(dof), to = std::span(q).subspan(dof, dof);
      if (query.motion_clear(from, to, 0.1, 0.1))
        expect(clearance[0] > 0.0 && clearance[1] > 0.0, 2);
      Eigen::Vector3d gradient;
      const Eigen::Vector3d point(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform());
      const double distance = query.distance(point, 0.1, 0.2, &gradient);
      expect(distance <= 0.2 &&
                 (gradient.isZero() ? distance == 0.2 : std::abs(gradient.norm() - 1.0) < 1e-9),
             3);
      expect(query.boxes({-1.0, -1.0, 0.0}, {1.0, 1.0, 1.0}, boxes) > 0, 4);
      const std::size_t count = query.obstacles(0.1, obstacles);
      for (std::size_t i = 0; i < count; ++i)
        expect(obstacles[i].id >= 0 && obstacles[i].name[0] != '\0', 5);
      ++rounds_;
    }
  }

  void check_configuration(const Query& query, std::span<const double> q, double clearance,
                           std::vector<hamelin_contact>& contacts,
                           std::vector<hamelin_self_contact>& self) {
    double nearest = setup_.influence_m();
    const std::size_t count = query.contacts(q, 0.1, setup_.influence_m(), contacts);
    expect(count <= contacts.size(), 6);
    for (std::size_t i = 0; i < count; ++i) nearest = std::min(nearest, contacts[i].distance_m);
    const std::size_t pairs = query.self_contacts(q, setup_.influence_m(), self);
    for (std::size_t i = 0; i < pairs; ++i) nearest = std::min(nearest, self[i].distance_m);
    expect(std::abs(nearest - clearance) < 1e-9, 7);
    expect(query.clearance(q, 0.1, clearance) >= clearance - 1e-12, 8);
    expect(query.clearance(q, 0.1, clearance + 0.01) < clearance + 0.01, 9);
  }

  Host host_;
  Setup setup_;
  NominalArm arm_;
  Eigen::VectorXd torque_;
  std::int32_t rounds_series_ = -1, world_series_ = -1;
  std::atomic<bool> stop_{false};
  std::atomic<int> fault_{0};
  std::atomic<std::uint64_t> rounds_{0}, world_{0};
  std::vector<std::thread> threads_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Querying, "querying", "0.0.1", "queries the world from its own threads",
                       schema);
