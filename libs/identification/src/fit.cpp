#include "hamelin/identification/fit.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/regressor.hpp"
#include "hamelin/identification/objective.hpp"
#include "hamelin/identification/pseudo_inertia.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double still_speed_rms = 1e-3;  // [rad/s or m/s]
constexpr double sigma_first = 0.1;       // of the torque, before there are residuals
constexpr double sigma_least = 1e-7;      // of the torque, for data without noise
constexpr int passes_max = 10;
constexpr Index samples_per_block = 20;  // residuals of other blocks are independent

double root_mean_square(const VectorXd& x) {
  return x.size() == 0 ? 0.0 : std::sqrt(x.squaredNorm() / static_cast<double>(x.size()));
}

/// The parameters as an affine function of the coordinates that are fitted.
struct Coordinates {
  Parameters prior;
  std::vector<Index> links;              ///< with mass
  std::vector<LinkCoordinates> of_link;  ///< of these
  std::vector<Index> moving;             ///< joints
  VectorXd damping_unit, friction_unit;  ///< of the moving joints

  [[nodiscard]] Index inertial() const noexcept { return 10 * static_cast<Index>(links.size()); }
  [[nodiscard]] Index size() const noexcept {
    return inertial() + 2 * static_cast<Index>(moving.size());
  }
  /// The columns of A per coordinate of the links.
  [[nodiscard]] MatrixXd on_links(const MatrixXd& A) const {
    MatrixXd out(A.rows(), inertial());
    for (std::size_t i = 0; i < links.size(); ++i)
      out.middleCols<10>(10 * static_cast<Index>(i)) =
          A.middleCols<10>(10 * links[i]) * of_link[i].to_parameters();
    return out;
  }
  [[nodiscard]] Parameters parameters(const VectorXd& x) const;
};

Parameters Coordinates::parameters(const VectorXd& x) const {
  Parameters out = prior;
  for (std::size_t i = 0; i < links.size(); ++i)
    out.inertial.segment<10>(10 * links[i]) +=
        of_link[i].to_parameters() * x.segment<10>(10 * static_cast<Index>(i));
  for (std::size_t i = 0; i < moving.size(); ++i) {
    const auto at = static_cast<Index>(i);
    out.damping[moving[i]] = damping_unit[at] * x[inertial() + 2 * at];
    out.friction[moving[i]] = friction_unit[at] * x[inertial() + 2 * at + 1];
  }
  return out;
}

Coordinates coordinates_of(const model::Model& model, const Samples& samples, Fit& out) {
  Coordinates result;
  result.prior = parameters_of(model);
  const Index dof = model.dof();
  for (Index i = 0; i < dof; ++i) {
    auto part = result.prior.inertial.segment<10>(10 * i);
    if (!(part[0] > 0.0)) continue;
    result.links.push_back(i);
    result.of_link.emplace_back(part);
    part = result.of_link.back().prior();
    if (result.of_link.back().repaired()) out.repaired_links.push_back(static_cast<int>(i));
  }
  std::vector<double> damping, friction;
  for (Index j = 0; j < dof; ++j) {
    const Samples::Joint& joint = samples.joints[static_cast<std::size_t>(j)];
    const double speed = root_mean_square(joint.A.col(10 * dof));
    if (!(speed > still_speed_rms)) {
      out.still_joints.push_back(static_cast<int>(j));
      continue;
    }
    const double torque = std::max(root_mean_square(joint.b), 1e-9);
    result.moving.push_back(j);
    damping.push_back(torque / speed);
    friction.push_back(torque);
  }
  const auto count = static_cast<Index>(damping.size());
  result.damping_unit = Eigen::Map<const VectorXd>(damping.data(), count);
  result.friction_unit = Eigen::Map<const VectorXd>(friction.data(), count);
  return result;
}

// The rows of a joint by the coordinates, as differences from what does not change. At most size
// + 1 rows are left, by orthogonal transformations, which keep all digits.
Objective::Equations equations_of(const Coordinates& coordinates, const Samples::Joint& joint,
                                  Index j) {
  const Index inertial_columns = coordinates.prior.inertial.size();
  MatrixXd all(joint.A.rows(), coordinates.size() + 1);
  all.leftCols(coordinates.inertial()) = coordinates.on_links(joint.A);
  all.rightCols(1 + 2 * static_cast<Index>(coordinates.moving.size())).setZero();
  all.rightCols<1>() = joint.b - joint.A.leftCols(inertial_columns) * coordinates.prior.inertial;
  const auto found = std::find(coordinates.moving.begin(), coordinates.moving.end(), j);
  if (found == coordinates.moving.end()) {
    all.rightCols<1>() -= joint.A.col(inertial_columns) * coordinates.prior.damping[j] +
                          joint.A.col(inertial_columns + 1) * coordinates.prior.friction[j];
  } else {
    const auto at = static_cast<Index>(found - coordinates.moving.begin());
    const Index column = coordinates.inertial() + 2 * at;
    all.col(column) = coordinates.damping_unit[at] * joint.A.col(inertial_columns);
    all.col(column + 1) = coordinates.friction_unit[at] * joint.A.col(inertial_columns + 1);
  }
  if (all.rows() > all.cols()) {
    const Eigen::HouseholderQR<MatrixXd> qr(all);
    all = MatrixXd(qr.matrixQR().topRows(all.cols()).triangularView<Eigen::Upper>());
  }
  return {all.leftCols(coordinates.size()), all.rightCols<1>(), 1.0};
}

Objective objective_of(const Coordinates& coordinates, const Samples& samples,
                       const FitOptions& options) {
  Objective out;
  out.links = static_cast<Index>(coordinates.links.size());
  out.prior_weight = options.prior_weight;
  out.friction_prior.resize(2 * static_cast<Index>(coordinates.moving.size()));
  for (std::size_t i = 0; i < coordinates.moving.size(); ++i) {
    const auto at = static_cast<Index>(i);
    const Index j = coordinates.moving[i];
    out.friction_prior[2 * at] = coordinates.prior.damping[j] / coordinates.damping_unit[at];
    out.friction_prior[2 * at + 1] = coordinates.prior.friction[j] / coordinates.friction_unit[at];
  }
  for (std::size_t j = 0; j < samples.joints.size(); ++j)
    out.joints.push_back(equations_of(coordinates, samples.joints[j], static_cast<Index>(j)));
  return out;
}

/// Alternates the fit and the weights of the joints, docs/theory.md (2.54).
class WeightedFit {
 public:
  WeightedFit(Objective objective, const Samples& samples)
      : objective_(std::move(objective)), samples_(samples) {
    const auto dof = static_cast<Index>(samples.joints.size());
    least_ = sigma_ = VectorXd(dof);
    for (Index j = 0; j < dof; ++j) {
      const double torque = root_mean_square(samples.joints[static_cast<std::size_t>(j)].b);
      least_[j] = std::max(sigma_least * torque, 1e-12);
      sigma_[j] = std::max(sigma_first * torque, 1e-12);
    }
    x_ = VectorXd::Zero(objective_.size());
    x_.tail(objective_.friction_prior.size()) = objective_.friction_prior;
  }

  void run() {
    constexpr double settled = 0.01;
    for (int pass = 0; pass < passes_max; ++pass) {
      for (Index j = 0; j < sigma_.size(); ++j)
        objective_.joints[static_cast<std::size_t>(j)].weight =
            1.0 / (samples_.overlap * sigma_[j] * sigma_[j]);
      x_ = minimum(objective_, x_);
      const VectorXd before = sigma_;
      update_sigma();
      if (((sigma_ - before).array().abs() <= settled * before.array()).all()) return;
    }
  }
  [[nodiscard]] const VectorXd& x() const noexcept { return x_; }
  [[nodiscard]] const VectorXd& sigma() const noexcept { return sigma_; }
  [[nodiscard]] const Objective& objective() const noexcept { return objective_; }

 private:
  // The residuals of a joint have fewer degrees of freedom by what its rows determine.
  void update_sigma() {
    VectorXd gradient;
    MatrixXd hessian;
    objective_.evaluate(x_, &gradient, &hessian);
    const Eigen::LDLT<MatrixXd> factor(hessian);
    for (Index j = 0; j < sigma_.size(); ++j) {
      const auto& joint = objective_.joints[static_cast<std::size_t>(j)];
      const MatrixXd solved = factor.solve(joint.R.transpose());
      const double used =
          samples_.overlap * joint.weight * joint.R.cwiseProduct(solved.transpose()).sum();
      const auto rows = static_cast<double>(samples_.rows());
      const double squares = (joint.R * x_ - joint.y).squaredNorm();
      sigma_[j] = std::max(least_[j], std::sqrt(squares / std::max(0.1 * rows, rows - used)));
    }
  }

  Objective objective_;
  const Samples& samples_;
  VectorXd x_, sigma_, least_;
};

// Standard errors by sums over blocks of neighbouring samples, which hold for residuals that are
// correlated within a block: Liang, Zeger (1986).
void set_errors(const Coordinates& coordinates, const WeightedFit& weighted, const Samples& samples,
                Fit& out) {
  const Index size = coordinates.size(), rows = samples.rows();
  VectorXd gradient;
  MatrixXd hessian, scores = MatrixXd::Zero(size, (rows - 1) / samples_per_block + 1);
  weighted.objective().evaluate(weighted.x(), &gradient, &hessian);
  const Index dof = static_cast<Index>(samples.joints.size());
  for (Index j = 0; j < dof; ++j) {
    const Samples::Joint& joint = samples.joints[static_cast<std::size_t>(j)];
    const double weight = weighted.objective().joints[static_cast<std::size_t>(j)].weight;
    VectorXd residual = joint.b - joint.A.leftCols(10 * dof) * out.parameters.inertial -
                        joint.A.col(10 * dof) * out.parameters.damping[j] -
                        joint.A.col(10 * dof + 1) * out.parameters.friction[j];
    MatrixXd by_coordinate = MatrixXd::Zero(rows, size);
    by_coordinate.leftCols(coordinates.inertial()) = coordinates.on_links(joint.A);
    for (std::size_t i = 0; i < coordinates.moving.size(); ++i) {
      if (coordinates.moving[i] != j) continue;
      const auto at = static_cast<Index>(i);
      const Index column = coordinates.inertial() + 2 * at;
      by_coordinate.col(column) = coordinates.damping_unit[at] * joint.A.col(10 * dof);
      by_coordinate.col(column + 1) = coordinates.friction_unit[at] * joint.A.col(10 * dof + 1);
    }
    for (Index k = 0; k < rows; ++k)
      scores.col(k / samples_per_block) += weight * residual[k] * by_coordinate.row(k).transpose();
  }
  const MatrixXd spread = hessian.ldlt().solve(scores);
  const auto blocks = static_cast<double>(scores.cols());
  const VectorXd error =
      (spread.rowwise().squaredNorm() * (blocks / std::max(1.0, blocks - 1.0))).cwiseSqrt();
  out.damping_error = out.friction_error =
      VectorXd::Constant(dof, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < coordinates.moving.size(); ++i) {
    const auto at = static_cast<Index>(i);
    const Index column = coordinates.inertial() + 2 * at, j = coordinates.moving[i];
    out.damping_error[j] = coordinates.damping_unit[at] * error[column];
    out.friction_error[j] = coordinates.friction_unit[at] * error[column + 1];
  }
}

// The number of combinations that torques depend on, by states that excite them all.
int count_base_parameters(const model::Model& model, const Coordinates& coordinates) {
  constexpr double rank_share = 1e-7;
  const Index dof = model.dof(), inertial = coordinates.inertial();
  if (inertial == 0) return 0;
  const Index states = 4 * inertial / dof + 10;
  Rng rng(1);
  const auto random = [&](double scale) {
    VectorXd x(dof);
    for (double& value : x) value = scale * rng.normal();
    return x;
  };
  MatrixXd all(states * dof, inertial), Y(dof, 10 * dof);
  dynamics::Workspace ws(model);
  for (Index k = 0; k < states; ++k) {
    const VectorXd q = random(1.5), v = random(2.0), a = random(5.0);
    dynamics::inverse_dynamics_regressor(model, ws, q, v, a, Y);
    all.middleRows(k * dof, dof) = coordinates.on_links(Y);
  }
  for (Index i = 0; i < dof; ++i) {  // joints of different torques count alike
    double squares = 0.0;
    for (Index k = 0; k < states; ++k) squares += all.row(k * dof + i).squaredNorm();
    if (squares > 0.0)
      for (Index k = 0; k < states; ++k) all.row(k * dof + i) /= std::sqrt(squares);
  }
  Eigen::ColPivHouseholderQR<MatrixXd> qr(all);
  qr.setThreshold(rank_share);
  return static_cast<int>(qr.rank());
}

void set_excitation(const model::Model& model, const Coordinates& coordinates,
                    const WeightedFit& weighted, const Samples& samples, Fit& out) {
  const Index inertial = coordinates.inertial();
  out.base_parameters = count_base_parameters(model, coordinates);
  if (out.base_parameters == 0) return;
  MatrixXd information = MatrixXd::Zero(inertial, inertial), scaled = information;
  for (std::size_t j = 0; j < samples.joints.size(); ++j) {
    const auto& joint = weighted.objective().joints[j];
    const MatrixXd square = joint.R.leftCols(inertial).transpose() * joint.R.leftCols(inertial);
    information += joint.weight * square;
    const double torque = std::max(samples.joints[j].b.squaredNorm(), 1e-24);
    scaled += square / torque;
  }
  const VectorXd known = Eigen::SelfAdjointEigenSolver<MatrixXd>(information).eigenvalues();
  out.determined =
      std::min(out.base_parameters,
               static_cast<int>((known.array() > weighted.objective().prior_weight).count()));
  const VectorXd squares = Eigen::SelfAdjointEigenSolver<MatrixXd>(scaled).eigenvalues();
  const double smallest = squares[inertial - out.base_parameters];
  out.condition = smallest > 0.0 ? std::sqrt(squares[inertial - 1] / smallest)
                                 : std::numeric_limits<double>::infinity();
}

void check_arguments(const model::Model& prior, const Samples& samples, const FitOptions& options) {
  const Index dof = prior.dof();
  bool fits = static_cast<Index>(samples.joints.size()) == dof;
  for (const auto& joint : samples.joints)
    fits = fits && joint.A.cols() == 10 * dof + 2 && joint.A.rows() == joint.b.size() &&
           joint.b.size() == samples.rows() && joint.A.allFinite() && joint.b.allFinite();
  if (!fits)
    throw Error(ErrorCode::usage,
                "fit: samples of other sizes or not finite, expected those of the model");
  if (!(options.prior_weight > 0.0) || !std::isfinite(options.prior_weight))
    throw Error(ErrorCode::usage, fmt::format("fit: prior weight {}, expected a positive number",
                                              options.prior_weight));
}

}  // namespace

Parameters parameters_of(const model::Model& model) {
  Parameters out{dynamics::inertial_parameters(model), VectorXd(model.dof()),
                 VectorXd(model.dof())};
  for (Index i = 0; i < model.dof(); ++i) {
    const model::Joint& joint = model.robot().links[static_cast<std::size_t>(i)].joint;
    out.damping[i] = joint.damping;
    out.friction[i] = joint.friction;
  }
  return out;
}

model::Robot with_parameters(const model::Model& model, const Parameters& parameters) {
  if (parameters.damping.size() != model.dof() || parameters.friction.size() != model.dof())
    throw Error(ErrorCode::usage,
                fmt::format("with_parameters: {} and {} friction coefficients given, expected {}",
                            parameters.damping.size(), parameters.friction.size(), model.dof()));
  model::Robot robot = dynamics::with_inertial_parameters(model, parameters.inertial);
  for (Index i = 0; i < model.dof(); ++i) {
    model::Joint& joint = robot.links[static_cast<std::size_t>(i)].joint;
    joint.damping = parameters.damping[i];
    joint.friction = parameters.friction[i];
  }
  return robot;
}

Fit fit(const model::Model& prior, const Samples& samples, const FitOptions& options,
        const std::string& where) {
  check_arguments(prior, samples, options);
  Fit out;
  const Coordinates coordinates = coordinates_of(prior, samples, out);
  if (coordinates.moving.empty()) {
    std::string names;
    for (const auto& link : prior.robot().links)
      names += fmt::format("{}'{}'", names.empty() ? "" : ", ", link.joint.name);
    throw Error(ErrorCode::invalid,
                fmt::format("{}: joints {} do not move, expected a motion", where, names));
  }
  WeightedFit weighted(objective_of(coordinates, samples, options), samples);
  weighted.run();
  out.parameters = coordinates.parameters(weighted.x());
  out.sigma = weighted.sigma();
  set_errors(coordinates, weighted, samples, out);
  set_excitation(prior, coordinates, weighted, samples, out);
  return out;
}

TorqueErrors torque_errors(const Samples& samples, const Parameters& parameters) {
  TorqueErrors out;
  const auto dof = static_cast<Index>(samples.joints.size());
  const auto rows = static_cast<double>(std::max<Index>(1, samples.rows()));
  double differences = 0.0, torques = 0.0;
  for (Index j = 0; j < dof; ++j) {
    const Samples::Joint& joint = samples.joints[static_cast<std::size_t>(j)];
    const double difference = (joint.b - joint.A.leftCols(10 * dof) * parameters.inertial -
                               joint.A.col(10 * dof) * parameters.damping[j] -
                               joint.A.col(10 * dof + 1) * parameters.friction[j])
                                  .squaredNorm();
    const double torque = joint.b.squaredNorm();
    out.joints.push_back(
        {std::sqrt(difference / rows), torque > 0.0 ? std::sqrt(difference / torque) : 0.0});
    differences += difference;
    torques += torque;
  }
  out.all = {std::sqrt(differences / rows), torques > 0.0 ? std::sqrt(differences / torques) : 0.0};
  return out;
}

}  // namespace hamelin::identification
