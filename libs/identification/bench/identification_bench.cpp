// What each part of the identification is good for, and what it costs.
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <catch2/catch.hpp>
#include <cmath>

#include "../src/local_polynomial.hpp"
#include "../tests/motions.hpp"
#include "hamelin/identification/identify.hpp"
#include "hamelin/identification/pseudo_inertia.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::identification;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Positions, rates and accelerations of local polynomials against the torques as they are.
Samples pointwise_samples(const model::Model& model, const Record& record, double window_s) {
  LocalPolynomial polynomial(record.time_s, record.q, 0.5 * window_s);
  std::vector<VectorXd> q, v, a, tau;
  for (std::size_t k = 0; k < record.ticks(); k += 10) {
    if (!polynomial.fit(record.time_s[k], 0, record.ticks())) continue;
    q.push_back(polynomial.q());
    v.push_back(polynomial.v());
    a.push_back(polynomial.a());
    tau.push_back(record.held.col(static_cast<Index>(k)));
  }
  const auto matrix = [&](const std::vector<VectorXd>& columns) {
    MatrixXd out(model.dof(), static_cast<Index>(columns.size()));
    for (std::size_t k = 0; k < columns.size(); ++k) out.col(static_cast<Index>(k)) = columns[k];
    return out;
  };
  return exact_samples(model, matrix(q), matrix(v), matrix(a), matrix(tau), test::friction_speed);
}

// The least change of all parameters that minimizes the weighted residuals: no prior and no limits.
Parameters least_squares(const model::Model& model, const Samples& samples, const VectorXd& sigma) {
  const Index dof = model.dof(), rows = samples.rows(), size = 12 * dof;
  Parameters out = parameters_of(model);
  MatrixXd A = MatrixXd::Zero(rows * dof, size);
  VectorXd b(rows * dof);
  for (Index j = 0; j < dof; ++j) {
    const auto& joint = samples.joints[static_cast<std::size_t>(j)];
    A.block(j * rows, 0, rows, 10 * dof) = joint.A.leftCols(10 * dof) / sigma[j];
    A.block(j * rows, 10 * dof + 2 * j, rows, 2) = joint.A.rightCols<2>() / sigma[j];
    b.segment(j * rows, rows) = (joint.b - joint.A.leftCols(10 * dof) * out.inertial) / sigma[j];
  }
  Eigen::BDCSVD<MatrixXd> svd(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  svd.setThreshold(1e-9);
  const VectorXd x = svd.solve(b);
  out.inertial += x.head(10 * dof);
  for (Index j = 0; j < dof; ++j) {
    out.damping[j] = x[10 * dof + 2 * j];
    out.friction[j] = x[10 * dof + 2 * j + 1];
  }
  return out;
}

int links_that_are_no_bodies(const Parameters& parameters) {
  int count = 0;
  for (Index i = 0; i < parameters.damping.size(); ++i)
    if (Eigen::LLT<Eigen::Matrix4d>(pseudo_inertia(parameters.inertial.segment<10>(10 * i)))
            .info() != Eigen::Success)
      ++count;
  return count;
}

// Errors on the exact states of another motion.
TorqueErrors errors_on(const model::Model& truth, const test::SineMotion& motion,
                       const Parameters& parameters) {
  return torque_errors(test::samples_along(truth, motion, 1000, 0.01), parameters);
}

struct Score {
  double all = 0.0, worst = 0.0;
  int impossible = 0;

  void add(const TorqueErrors& errors, const Parameters& parameters) {
    all = std::max(all, 100.0 * errors.all.share);
    for (const TorqueError& joint : errors.joints) worst = std::max(worst, 100.0 * joint.share);
    impossible += links_that_are_no_bodies(parameters);
  }
  void print(const char* name) const {
    fmt::print("  {:<44} {:>8.3f} {:>8.3f} {:>4}\n", name, all, worst, impossible);
  }
};

void ablate(const std::string& file, double period_s, double duration_s) {
  const model::Model truth(test::with_friction(test::data_robot(file), 1.0, 0.8));
  const model::Model prior(test::wrong_prior(truth.robot(), 0.3));
  Score before, full, plain, point_short, point_long;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Record record = test::simulated_record(
        truth, test::SineMotion(truth, 10 + seed),
        {.duration_s = duration_s, .period_s = period_s, .q_noise = 1e-4, .seed = seed});
    const test::SineMotion other(truth, 20 + seed);
    const Samples samples = windowed_samples(prior, record, {});
    const auto add = [&](Score& score, const Parameters& parameters) {
      score.add(errors_on(truth, other, parameters), parameters);
    };
    const Fit found = fit(prior, samples, {}, "bench");
    add(before, parameters_of(prior));
    add(full, found.parameters);
    add(plain, least_squares(prior, samples, found.sigma));
    add(point_short, fit(prior, pointwise_samples(prior, record, 0.1), {}, "bench").parameters);
    add(point_long, fit(prior, pointwise_samples(prior, record, 0.3), {}, "bench").parameters);
  }
  fmt::print(
      "{}, {:g} Hz, {:g} s, 5 seeds: % of the torques of another motion, over all joints "
      "and of the worst one; links that are no bodies\n",
      file, 1.0 / period_s, duration_s);
  before.print("prior, masses wrong by 30 %, no friction");
  full.print("identified");
  plain.print("plain least squares");
  point_short.print("accelerations of 0.1 s, torques as they are");
  point_long.print("accelerations of 0.3 s, torques as they are");
}

}  // namespace

TEST_CASE("ablation") {
  ablate("arm7.urdf", 1e-3, 10.0);
  ablate("arm7.urdf", 8e-3, 4.0);
  ablate("third_party/panda.urdf", 1e-3, 10.0);
}

TEST_CASE("time") {
  const model::Model truth(test::with_friction(test::data_robot("arm7.urdf"), 1.0, 0.8));
  const Record record =
      test::simulated_record(truth, test::SineMotion(truth, 1), {.q_noise = 1e-4});
  BENCHMARK("identify, 7 joints, 10 s at 1 kHz") {
    return identify(truth, record, {});
  };
}
