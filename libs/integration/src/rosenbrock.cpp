#include "rosenbrock.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::integration {

namespace {

constexpr double default_tolerance = 1e-10;
constexpr double safety = 0.9, most = 6.0, least = 0.2;  // growth and shrinking of a step, as odeint's controller has
constexpr double difference = 1e-5;                      // of the Jacobian; central, so its error is about 1e-10
constexpr int max_rejections = 60;

Options controlled_always(Options options) {
  if (!options.step_control()) options.rtol = options.atol = default_tolerance;
  return options;
}

}  // namespace

Rosenbrock::Rosenbrock(const Model& model, const Options& options)
    : Explicit("rosenbrock", model, controlled_always(options)),
      size_(2 * model.dof() + 3),
      method_(
          static_cast<std::size_t>(size_), [this](const double* y, double* dy) { derivative(y, dy); },
          [this](const double* y, double* by_rows) { jacobian(y, by_rows); }) {
  for (auto* x : {&y_, &next_, &error_, &point_, &up_, &down_}) *x = VectorXd::Zero(size_);
  q_ = v_ = VectorXd::Zero(model.dof());
}

std::string Rosenbrock::criterion() const {
  return fmt::format("error <= {} + {} |(q, v)|, rms", options_.atol, options_.rtol);
}

void Rosenbrock::derivative(const double* y, double* dy) {
  const Eigen::Index n = model_.dof();
  q_ = Eigen::Map<const VectorXd>(y, n);
  v_ = Eigen::Map<const VectorXd>(y + n, n);
  accelerate(*channels_, q_, v_, *report_);
  StepReport power;
  book_work(power, v_, 1.0);
  Eigen::Map<VectorXd> out(dy, size_);
  out.head(n) = v_;
  out.segment(n, n) = acceleration_;
  out.tail(3) << power.gyroscopic_work_J, power.dissipated_J, power.held_work_J;
}

void Rosenbrock::jacobian(const double* y, double* by_rows) {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> J(by_rows, size_, size_);
  J.setZero();
  point_ = Eigen::Map<const VectorXd>(y, size_);
  for (Eigen::Index j = 0; j < size_ - 3; ++j) {
    point_[j] = y[j] + difference;
    derivative(point_.data(), up_.data());
    point_[j] = y[j] - difference;
    derivative(point_.data(), down_.data());
    point_[j] = y[j];
    J.col(j) = (up_ - down_) / (2.0 * difference);
  }
}

StepReport Rosenbrock::attempt(State&, const Channels&, double) {
  StepReport report;
  report.converged = false;  // there are no fixed steps
  return report;
}

StepReport Rosenbrock::controlled(State& state, const Channels& channels, double limit) {
  const Eigen::Index n = model_.dof();
  StepReport report;
  report.converged = false;
  channels_ = &channels;
  report_ = &report;
  y_ << state.q, state.v, 0.0, 0.0, 0.0;
  const double wish = state.step_next > 0.0 ? state.step_next : limit;
  const double shortest = 10.0 * std::numeric_limits<double>::epsilon() * std::abs(state.time_s);
  for (double h = wish; report.rejected <= max_rejections && h > shortest; ++report.rejected) {
    h = std::min(h, limit);
    method_.step(y_.data(), h, next_.data(), error_.data());
    ++report.factorizations;
    const auto scale = options_.atol + options_.rtol * y_.cwiseAbs().cwiseMax(next_.cwiseAbs()).array();
    report.residual = std::sqrt((error_.array() / scale).head(2 * n).square().mean());
    if (!std::isfinite(report.residual) || !next_.allFinite()) {
      h *= least;
      continue;
    }
    const double next = h * std::clamp(safety / std::pow(report.residual, 0.25), least, most);
    if (report.residual > 1.0) {
      h = next;
      continue;
    }
    state.q = next_.head(n);
    state.v = next_.segment(n, n);
    report.gyroscopic_work_J = next_[2 * n];
    report.dissipated_J = next_[2 * n + 1];
    report.held_work_J = next_[2 * n + 2];
    // a step that the limit cut short says nothing against the wish there was
    state.step_next = report.rejected > 0 ? std::min(next, h) : h < wish ? std::max(next, wish) : next;
    report.step_s = h;
    report.converged = true;
    break;
  }
  return report;
}

}  // namespace hamelin::integration
