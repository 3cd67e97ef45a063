#include "disturbances.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace hamelin::test {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

// An arm that is slower than this rests [rad/s].
constexpr double rest_speed = 1e-3;
// How far a hand moves each joint [rad].
constexpr double hand_way = 1.0;
// What a hand keeps from obstacles, from other parts of the arm and from joint limits [m, m, rad].
constexpr double hand_clearance_m = 0.04, hand_self_clearance_m = 0.005, hand_reserve = 0.05;
constexpr std::size_t trail_max = 5;
constexpr double deadline_exceeded_s = 0.01;

thread_local double clock_now_s = 0.0, planner_takes_s = 0.0;

scene::Payload random_payload(Rng& rng, std::string name) {
  scene::Payload payload;
  payload.name = std::move(name);
  payload.mass_kg = rng.below(10) == 0 ? 30.0 : rng.uniform(0.05, 2.5);
  payload.position_m = {rng.uniform(-0.03, 0.03), rng.uniform(-0.03, 0.03),
                        rng.uniform(0.02, 0.12)};
  payload.inertia_kg_m2 = payload.mass_kg * rng.uniform(5e-4, 2e-3) * Eigen::Matrix3d::Identity();
  const auto point = [&] {
    return Vector3d(rng.uniform(-0.06, 0.06), rng.uniform(-0.06, 0.06), rng.uniform(0.03, 0.15));
  };
  const double outwards = rng.below(12) == 0 ? 1.0 : 0.0;  // beyond payload_reach_m
  for (std::uint64_t i = 0; i <= rng.below(2); ++i)
    payload.spheres.push_back({point() + outwards * Vector3d::UnitZ(), rng.uniform(0.01, 0.05)});
  if (rng.below(2) == 0) payload.capsules.push_back({point(), point(), rng.uniform(0.01, 0.04)});
  return payload;
}

}  // namespace

Events& Events::operator+=(const Events& other) {
  for (long Events::*count :
       {&Events::measurements, &Events::late, &Events::stops, &Events::resumptions, &Events::resets,
        &Events::loads, &Events::refused_loads, &Events::worlds, &Events::goals, &Events::params,
        &Events::refused})
    this->*count += other.*count;
  return *this;
}

Disturbances::Disturbances(control::Controller& controller, Arm& arm, const model::Model& bare,
                           bool has_map, std::uint64_t seed)
    : controller_(controller),
      arm_(arm),
      bare_(bare),
      start_q_(arm.q()),
      rng_(seed),
      world_(controller, arm.q(), has_map, seed + 1) {
  planner_takes_s = 0.0;
}

double Disturbances::clock_s() {
  return clock_now_s += planner_takes_s;
}

void Disturbances::note(const std::string& event) {
  trail_.push_front(fmt::format("{:.3f} s {}", time_s_, event));
  if (trail_.size() > trail_max) trail_.pop_back();
}

std::string Disturbances::trail() const {
  return fmt::format("{}", fmt::join(trail_, ", "));
}

template <class F>
void Disturbances::attempt(long& count, F&& change) {
  try {
    change();
    ++count;
  } catch (const Error&) {
    ++events_.refused;
  }
}

bool Disturbances::disturb(double time_s) {
  time_s_ = time_s;
  resumes_ = false;
  if (since_start_ == 0) return true;
  if (guide_by_hand(time_s)) {
    since_start_ = 0;
    return true;
  }
  if (happens(0.03) && world_.update(time_s)) ++events_.worlds;
  if (happens(0.005)) change_load();
  if (happens(0.003)) change_goals();
  if (happens(0.003)) change_params();
  stop_or_resume();
  begin_faults();
  return false;
}

void Disturbances::stop_or_resume() {
  if (happens(0.002)) {
    controller_.stop("a person entered the cell");
    ++events_.stops;
    note("stop");
  }
  const bool stops = controller_.answer().state == control::ControlState::stopping;
  if (!guided_ && stops && happens(0.02)) {
    controller_.resume();
    resumes_ = true;
    ++events_.resumptions;
    note("resume");
  }
  if (!guided_ && happens(0.001)) {
    controller_.stop("somebody takes the arm by its hand");
    note("stop for a hand");
    guided_ = true;
  }
}

void Disturbances::begin_faults() {
  if (happens(0.003)) {
    late_ = 1 + static_cast<int>(rng_.below(25));
    note(fmt::format("{} late answers", late_));
  }
  planner_takes_s = late_ > 0 ? deadline_exceeded_s : 0.0;
  if (late_ > 0) ++events_.late;
  late_ = std::max(0, late_ - 1);
  if (!happens(0.004)) return;
  (rng_.below(3) == 0 ? untimed_ : blind_) =
      1 + static_cast<int>(rng_.below(rng_.below(3) == 0 ? 30 : 3));
  how_ = static_cast<int>(rng_.below(5));
  longest_blind_ = std::max(longest_blind_, blind_);
  note(fmt::format("{} ticks without a measurement, {} without a time, kind {}", blind_, untimed_,
                   how_));
}

Measurement Disturbances::measure(double time_s) {
  Measurement out{time_s, arm_.q(), arm_.v()};
  ++since_start_;
  if (blind_ > 0 || untimed_ > 0) ++events_.measurements;
  if (blind_ > 0) {
    --blind_;
    const auto joint =
        static_cast<Eigen::Index>(rng_.below(static_cast<std::uint64_t>(out.q.size())));
    if (how_ == 0) out.q[joint] = nan;
    if (how_ == 1) out.v[joint] = nan;
    if (how_ == 2) out.q.setConstant(inf);
    if (how_ == 3) out.v[joint] = -inf;
    if (how_ == 4) out.q[joint] = 1e7;
  }
  if (untimed_ > 0) {
    --untimed_;
    out.time_s = std::array{nan, inf, -inf, time_s - 0.01, -1.0}[static_cast<std::size_t>(how_)];
  }
  return out;
}

bool Disturbances::guide_by_hand(double time_s) {
  if (!guided_ || controller_.answer().state != control::ControlState::stopping) return false;
  if (arm_.v().lpNorm<Eigen::Infinity>() > rest_speed || late_ + blind_ + untimed_ > 0)
    return false;
  const auto q = free_configuration(time_s);
  if (!q) return false;
  arm_.put(*q);
  controller_.reset();
  guided_ = false;
  ++events_.resets;
  note("reset");
  return true;
}

// Not near what moves: a controller starts only where it can stop.
std::optional<VectorXd> Disturbances::free_configuration(double time_s) {
  const model::Model& model = controller_.model();
  const auto world = controller_.world().latest();
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm(model);
  const scene::SelfField self(model);
  VectorXd q(model.dof());
  for (int i = 0; i < 20; ++i) {
    const VectorXd& from = rng_.below(2) == 0 ? start_q_ : arm_.q();
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      const auto& joint = model.robot().links[static_cast<std::size_t>(j)].joint;
      q[j] = std::clamp(from[j] + rng_.uniform(-hand_way, hand_way), *joint.lower + hand_reserve,
                        *joint.upper - hand_reserve);
    }
    dynamics::forward_kinematics(model, ws, q);
    arm.place(model, ws);
    bool free = world->environment.clearance(arm.view(), {time_s}, 1.0) > hand_clearance_m;
    for (std::size_t k = 0; free && k < self.pairs().size(); ++k)
      free = self.distance(k, arm.view(), 1.0) > hand_self_clearance_m;
    if (free) return q;
  }
  return std::nullopt;
}

void Disturbances::change_load() {
  const std::vector<std::string> names = controller_.attached();
  long ignored = 0;
  attempt(ignored, [&] {
    std::uint64_t number = 0;
    if (!names.empty() && rng_.below(2) == 0) {
      number = controller_.detach(names[rng_.below(names.size())], arm_.q());
    } else {
      const std::string name = "load " + std::to_string(++payloads_);
      known_[name] = random_payload(rng_, name);
      number = controller_.attach(known_[name], arm_.q());
    }
    for (const std::string& name : controller_.attached()) loads_[number].push_back(known_[name]);
  });
}

void Disturbances::change_goals() {
  VectorXd q(bare_.dof());
  for (double& x : q) x = rng_.uniform(-2.5, 2.5);
  const Vector3d place(rng_.uniform(-0.7, 0.7), rng_.uniform(-0.7, 0.7), rng_.uniform(0.1, 0.9));
  attempt(events_.goals, [&] {
    if (rng_.below(2) == 0)
      controller_.set_goal(scene::position_goal(place));
    else
      controller_.set_goals({scene::joint_goal(q), scene::position_goal(place)});
  });
}

void Disturbances::change_params() {
  attempt(events_.params, [&] {
    controller_.set_planner_params({{"cruise_speed", rng_.uniform(-0.3, 2.0)}});
  });
}

std::optional<model::Model> Disturbances::take_load() {
  const control::Answer& answer = controller_.answer();
  if (answer.refused_load != refused_load_) ++events_.refused_loads;
  refused_load_ = answer.refused_load;
  if (answer.load == load_) return std::nullopt;
  load_ = answer.load;
  ++events_.loads;
  note(fmt::format("{} loads carried", loads_[load_].size()));
  return scene::carrying(bare_, loads_[load_], true, 0.0, arm_.q());
}

}  // namespace hamelin::test
