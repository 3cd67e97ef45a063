#include "hamelin/identification/identify.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "hamelin/identification/pseudo_inertia.hpp"
#include "hamelin/test/errors.hpp"
#include "motions.hpp"

using namespace hamelin;
using namespace hamelin::identification;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

Samples samples_of(const model::Model& model, const test::SineMotion& motion, int count) {
  return test::samples_along(model, motion, count, 0.05);
}

bool all_bodies(const model::Model& model, const Parameters& parameters) {
  for (int i = 0; i < model.dof(); ++i) {
    const LinkParameters link = parameters.inertial.segment<10>(10 * i);
    if (link[0] > 0.0 && Eigen::LLT<Eigen::Matrix4d>(pseudo_inertia(link)).info() != Eigen::Success)
      return false;
  }
  return true;
}

}  // namespace

TEST_CASE("exact samples give the torques of another motion", "[identification][unit]") {
  const auto* file = GENERATE("arm7.urdf", "rail7.urdf", "planar4.json");
  CAPTURE(file);
  model::Robot robot = test::with_friction(test::data_robot(file), 1.0, 0.7);
  robot.links[1].joint.armature = 0.3;
  const model::Model truth(robot), prior(test::wrong_prior(robot, 0.3));
  const Fit found = fit(prior, samples_of(truth, test::SineMotion(truth, 1), 600), {}, "exact");
  const test::SineMotion other(truth, 2);
  CHECK(test::errors_along(truth, prior, other, 20.0).all.share > 0.05);
  const model::Model identified(with_parameters(prior, found.parameters));
  CHECK(test::errors_along(truth, identified, other, 20.0).all.share <= 1e-6);
  for (int i = 0; i < truth.dof(); ++i) {
    const model::Joint& joint = robot.links[static_cast<std::size_t>(i)].joint;
    CHECK(found.parameters.damping[i] == Approx(joint.damping).epsilon(1e-5));
    CHECK(found.parameters.friction[i] == Approx(joint.friction).epsilon(1e-5));
  }
}

TEST_CASE("noisy positions and held torques give the torques of another motion within 2 %",
          "[identification][integration]") {
  struct Case {
    const char* file;
    double period_s, q_noise, tau_noise;
    std::uint64_t seed;
  };
  const auto c = GENERATE(
      Case{"arm7.urdf", 1e-3, 1e-4, 0.0, 1}, Case{"arm7.urdf", 8e-3, 1e-4, 0.01, 2},
      Case{"third_party/panda.urdf", 1e-3, 1e-4, 0.0, 3}, Case{"gantry.urdf", 2e-3, 1e-4, 0.01, 4});
  CAPTURE(c.file, c.period_s, c.seed);
  const model::Model truth(test::with_friction(test::data_robot(c.file), 1.0, 0.8));
  const model::Model prior(test::wrong_prior(truth.robot(), 0.3));
  const Record record = test::simulated_record(truth, test::SineMotion(truth, 10 + c.seed),
                                               {.duration_s = 10.0,
                                                .period_s = c.period_s,
                                                .q_noise = c.q_noise,
                                                .tau_noise = c.tau_noise,
                                                .seed = c.seed});
  const Identification found = identify(prior, record, {});
  CHECK(found.errors_before.all.share > 0.04);
  CHECK(found.held_out.all.share <= 0.02);
  for (const double noise : found.q_noise) CHECK(noise == Approx(c.q_noise).epsilon(0.1));
  CHECK(all_bodies(prior, found.fit.parameters));

  const TorqueErrors errors = test::errors_along(truth, model::Model(found.robot),
                                                 test::SineMotion(truth, 20 + c.seed), 10.0);
  CHECK(errors.all.share <= 0.005);
  for (const TorqueError& joint : errors.joints) CHECK(joint.share <= 0.02);
  for (int j = 0; j < truth.dof(); ++j) {
    const model::Joint& joint = truth.robot().links[static_cast<std::size_t>(j)].joint;
    CAPTURE(j, found.fit.damping_error[j], found.fit.friction_error[j]);
    CHECK(std::abs(found.fit.parameters.damping[j] - joint.damping) <=
          0.002 * joint.damping + 6.0 * found.fit.damping_error[j]);
    CHECK(std::abs(found.fit.parameters.friction[j] - joint.friction) <=
          0.002 * joint.friction + 6.0 * found.fit.friction_error[j]);
  }
}

TEST_CASE("standard errors of damping are those of repeated records", "[identification][slow]") {
  const model::Model truth(test::with_friction(test::data_robot("spatial3.json"), 1.0, 0.5));
  const model::Model prior(test::wrong_prior(truth.robot(), 0.2));
  const test::SineMotion motion(truth, 5);
  VectorXd sum = VectorXd::Zero(3), squares = sum, predicted = sum;
  const int records = 40;
  for (int i = 0; i < records; ++i) {
    const Record record = test::simulated_record(truth, motion,
                                                 {.duration_s = 6.0,
                                                  .period_s = 4e-3,
                                                  .q_noise = 1e-4,
                                                  .tau_noise = 0.05,
                                                  .seed = static_cast<std::uint64_t>(100 + i)});
    const Identification found = identify(prior, record, {});
    sum += found.fit.parameters.damping;
    squares += found.fit.parameters.damping.cwiseAbs2();
    predicted += found.fit.damping_error;
  }
  const VectorXd mean = sum / records;
  const VectorXd spread = (squares / records - mean.cwiseAbs2()).cwiseSqrt();
  for (int j = 0; j < 3; ++j) {
    CAPTURE(j, spread[j], predicted[j] / records);
    CHECK(predicted[j] / records >= 0.6 * spread[j]);
    CHECK(predicted[j] / records <= 1.7 * spread[j]);
  }
}

TEST_CASE("links stay bodies whatever the data, and unexcited ones stay as they were",
          "[identification][unit]") {
  const model::Model truth(test::data_robot("arm7.urdf"));
  Samples samples = samples_of(truth, test::SineMotion(truth, 1), 60);
  Rng rng(4);
  for (auto& joint : samples.joints)
    for (double& b : joint.b) b = 300.0 * rng.normal();
  const Fit found = fit(truth, samples, {}, "bad");
  CHECK(all_bodies(truth, found.parameters));
  CHECK_NOTHROW(with_parameters(truth, found.parameters));
  CHECK((found.parameters.damping.array() >= 0.0).all());
  CHECK((found.parameters.friction.array() >= 0.0).all());

  // a single sample says little
  Samples one = between(samples_of(truth, test::SineMotion(truth, 1), 60), 10.0, 11.0);
  const Fit little = fit(truth, one, {}, "one");
  CHECK((little.parameters.inertial - parameters_of(truth).inertial).norm() <=
        1e-3 * parameters_of(truth).inertial.norm());
  CHECK(little.determined < found.base_parameters);
}

TEST_CASE("joints that stay and links without mass keep what the robot says",
          "[identification][unit]") {
  model::Robot robot = test::with_friction(test::data_robot("planar4.json"), 1.0, 0.7);
  const model::Model truth(robot);
  MatrixXd q(4, 200), v = q, a = q, tau = q;
  dynamics::Workspace ws(truth);
  const test::SineMotion motion(truth, 1);
  for (int k = 0; k < 200; ++k) {
    auto state = motion.at(0.05 * k);
    state.v[2] = state.a[2] = 0.0;
    state.q[2] = 0.3;
    q.col(k) = state.q;
    v.col(k) = state.v;
    a.col(k) = state.a;
    tau.col(k) = test::motor_torque(truth, ws, state);
  }
  const Samples samples = exact_samples(truth, q, v, a, tau, test::friction_speed);
  const Fit found = fit(truth, samples, {}, "still");
  CHECK(found.still_joints == std::vector<int>{2});
  CHECK(found.parameters.friction[2] == robot.links[2].joint.friction);
  CHECK(std::isnan(found.friction_error[2]));

  Samples at_rest = samples;
  for (auto& joint : at_rest.joints) joint.A.rightCols<2>().setZero();
  CHECK(test::error_of([&] { (void)fit(truth, at_rest, {}, "rest.csv"); }) ==
        "rest.csv: joints 'j1', 'j2', 'j3', 'j4' do not move, expected a motion");

  robot.links[3].mass_kg = 0.0;
  robot.links[3].inertia_kg_m2.setZero();
  robot.links[3].joint.armature = 0.1;
  const model::Model massless(robot);
  const Fit without = fit(massless, samples_of(massless, motion, 200), {}, "massless");
  CHECK(without.parameters.inertial.tail<10>().isZero(0.0));
}

TEST_CASE("the same record gives the same bytes", "[identification][unit]") {
  const model::Model truth(test::data_robot("spatial3.json"));
  const Record record = test::simulated_record(
      truth, test::SineMotion(truth, 1), {.duration_s = 4.0, .period_s = 4e-3, .q_noise = 1e-4});
  const auto once = [&] { return to_json(identify(truth, record, {}), std::nullopt).dump(); };
  CHECK(once() == once());
}
