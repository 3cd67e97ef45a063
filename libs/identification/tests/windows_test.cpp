#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/dynamics/regressor.hpp"
#include "hamelin/identification/samples.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/errors.hpp"
#include "motions.hpp"

using namespace hamelin;
using namespace hamelin::identification;
using Eigen::VectorXd;

namespace {

model::Model arm_with_rotor() {
  model::Robot robot = test::with_friction(model::make_chain({3, "x,z,y"}), 0.6, 0.4);
  robot.links[1].joint.armature = 0.2;
  return model::Model(std::move(robot));
}

// The torques of a motion as a function of time, sampled at ticks that the caller gives.
Record sampled_record(const model::Model& model, const test::SineMotion& motion,
                      const std::vector<double>& times) {
  Record record;
  record.where = "motion.csv";
  record.time_s = times;
  record.usable.assign(times.size(), 1);
  record.q = record.sampled = Eigen::MatrixXd(model.dof(), static_cast<Eigen::Index>(times.size()));
  dynamics::Workspace ws(model);
  for (std::size_t k = 0; k < times.size(); ++k) {
    const auto state = motion.at(times[k]);
    record.q.col(static_cast<Eigen::Index>(k)) = state.q;
    record.sampled.col(static_cast<Eigen::Index>(k)) = test::motor_torque(model, ws, state);
  }
  return record;
}

std::vector<double> even_ticks(int count, double period_s) {
  std::vector<double> times;
  for (int k = 0; k < count; ++k) times.push_back(period_s * k);
  return times;
}

double share_of(const model::Model& model, const Record& record, const WindowOptions& options) {
  return torque_errors(windowed_samples(model, record, options), parameters_of(model)).all.share;
}

std::string error_in(const model::Model& model, const Record& record,
                     const WindowOptions& options) {
  return test::error_of([&] { (void)windowed_samples(model, record, options); });
}

}  // namespace

TEST_CASE("the averaged equations hold for the true parameters", "[identification][unit]") {
  const model::Model model = arm_with_rotor();
  const test::SineMotion motion(model, 3);
  // second order: a quarter for half the period
  const double coarse = share_of(model, sampled_record(model, motion, even_ticks(1500, 4e-3)), {});
  const double fine = share_of(model, sampled_record(model, motion, even_ticks(3000, 2e-3)), {});
  CHECK(coarse <= 2e-3);
  CHECK(fine <= 0.5 * coarse);
  // any window is exact up to the quadrature, since it acts on both sides
  for (const double window_s : {0.1, 0.3, 0.6})
    CHECK(share_of(model, sampled_record(model, motion, even_ticks(3000, 2e-3)),
                   {.window_s = window_s}) <= 1e-3);
}

TEST_CASE("ticks may be uneven or lost", "[identification][unit]") {
  const model::Model model = arm_with_rotor();
  Rng rng(7);
  std::vector<double> times{0.0};
  while (times.back() < 6.0) times.push_back(times.back() + rng.uniform(1e-3, 5e-3));
  const test::SineMotion motion(model, 3);
  CHECK(share_of(model, sampled_record(model, motion, times), {}) <= 2e-3);

  Record gaps = sampled_record(model, motion, even_ticks(3000, 2e-3));
  for (std::size_t k = 1000; k < 1010; ++k) {
    gaps.usable[k] = 0;
    gaps.q.col(static_cast<Eigen::Index>(k)).setConstant(std::nan(""));
    gaps.sampled.col(static_cast<Eigen::Index>(k)).setConstant(1e6);
  }
  CHECK(share_of(model, gaps, {}) <= 1e-3);
  const Samples samples = windowed_samples(model, gaps, {});
  for (const double time_s : samples.time_s)
    CHECK((time_s + 0.5 * samples.window_s <= 2.0 || time_s - 0.5 * samples.window_s >= 2.018));
}

TEST_CASE("impulses and late samples of torques count where they act", "[identification][unit]") {
  const model::Model model = arm_with_rotor();
  const test::SineMotion motion(model, 4);
  Record record = sampled_record(model, motion, even_ticks(3000, 2e-3));
  Record pushed = record;
  pushed.impulses = 0.5 * 2e-3 * record.sampled;
  pushed.sampled *= 0.5;
  CHECK(share_of(model, pushed, {}) <= 2e-3);

  Record late = record;
  dynamics::Workspace ws(model);
  late.sampled_shift_s = 1e-3;
  for (std::size_t k = 0; k < late.ticks(); ++k)
    late.sampled.col(static_cast<Eigen::Index>(k)) =
        test::motor_torque(model, ws, motion.at(late.time_s[k] + 1e-3));
  const double in_time = share_of(model, late, {});
  CHECK(in_time <= 3e-4);
  late.sampled_shift_s = 0.0;
  CHECK(share_of(model, late, {}) >= 3.0 * in_time);
}

TEST_CASE("noisier positions get longer windows", "[identification][unit]") {
  const model::Model model = arm_with_rotor();
  const test::SineMotion motion(model, 5);
  double before = 0.0;
  for (const double noise : {0.0, 3e-4, 3e-3}) {
    Record record = sampled_record(model, motion, even_ticks(4000, 2e-3));
    Rng rng(3);
    for (double& q : record.q.reshaped()) q += noise * rng.normal();
    const Samples samples = windowed_samples(model, record, {});
    CHECK(samples.window_s > before);
    CHECK(samples.window_s <= 0.5);
    before = samples.window_s;
    for (const double found : samples.q_noise)
      CHECK(found == Approx(noise).epsilon(0.1).margin(3e-6));
  }
}

TEST_CASE("records that say too little are refused", "[identification][unit]") {
  const model::Model model = arm_with_rotor();
  const test::SineMotion motion(model, 5);
  const Record record = sampled_record(model, motion, even_ticks(100, 2e-3));
  CHECK(error_in(model, record, {}) ==
        "motion.csv: its 0.182 s of usable motion give 4 windows of 0.1 s, expected at least 32");
  CHECK(error_in(model, record, {.window_s = 0.01}) ==
        "motion.csv: window: 0.01 s, expected at least 0.024 s, which are 12 ticks");
  CHECK(error_in(model, record, {.friction_speed = 0.0}) ==
        "friction speed: 0, expected a positive number");
  Record bare = record;
  bare.sampled.resize(0, 0);
  CHECK(error_in(model, bare, {}) == "motion.csv: has no torques, expected those of the motors");
  Record broken = record;
  broken.q(1, 50) = std::nan("");
  CHECK(error_in(model, broken, {}) ==
        "motion.csv: q at 0.1 s: is not finite, expected finite numbers");
  Record short_of_ticks = record;
  short_of_ticks.q.conservativeResize(Eigen::NoChange, 99);
  CHECK(error_in(model, short_of_ticks, {}) ==
        "motion.csv: q: has 3 × 99 numbers, expected 3 × 100 (joints, ticks)");
}
