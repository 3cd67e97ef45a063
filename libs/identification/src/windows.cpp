// Rows of least squares from a record: the equations of motion averaged over windows.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/regressor.hpp"
#include "hamelin/identification/samples.hpp"
#include "local_polynomial.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double smoothing_max_s = 0.1, window_min_s = 0.1, window_max_s = 0.5;
constexpr double rate_noise_max = 0.25;  // of the speed at which dry friction changes
constexpr int smoothing_ticks = 8, window_ticks = 12;
constexpr double strides_per_window = 4.0;
constexpr Index windows_min = 32, windows_max = 20000;
constexpr double still_speed = 1e-3;            // [rad/s or m/s]
constexpr double noise_share_max = 1e-3;        // of the variance of averaged accelerations
constexpr double square_of_weight = 1.6317;     // ∫φ² dt · T
constexpr double square_of_curvature = 1120.0;  // ∫φ̈² dt · T⁵

// The weight φ = 35/(16 T) (1 − u²)³, u = 2 (t − t_c)/T, docs/theory.md (2.48).
struct Window {
  double center_s, length_s;

  [[nodiscard]] double u(double t) const noexcept {
    return std::clamp(2.0 * (t - center_s) / length_s, -1.0, 1.0);
  }
  [[nodiscard]] double weight(double t) const noexcept {
    const double x = 1.0 - u(t) * u(t);
    return 35.0 / 16.0 / length_s * x * x * x;
  }
  /// ∫φ dt from the middle on.
  [[nodiscard]] double integral(double t) const noexcept {
    const double x = u(t), x2 = x * x;
    return 35.0 / 32.0 * x * (1.0 + x2 * (-1.0 + x2 * (0.6 - x2 / 7.0)));
  }
};

// A part of a record without gaps: its intervals between two ticks, with positions and rates in
// their middles from the local polynomials, and mean rates from the positions as they are.
struct Piece {
  std::size_t first_tick = 0;  ///< at which the first interval begins
  std::vector<double> edges;   ///< one more than there are intervals
  MatrixXd q, v, mean_rate;    ///< dof × intervals

  [[nodiscard]] Index intervals() const noexcept { return q.cols(); }
  [[nodiscard]] double length_s() const noexcept { return edges.back() - edges.front(); }
};

struct Windowing {
  double length_s, stride_s;

  [[nodiscard]] Index count(const Piece& piece) const {
    const double room = piece.length_s() - length_s;
    return room < 0.0 ? 0 : static_cast<Index>(std::floor(room / stride_s * (1.0 + 1e-12))) + 1;
  }
  [[nodiscard]] Window window(const Piece& piece, Index i) const {
    return {piece.edges.front() + 0.5 * length_s + static_cast<double>(i) * stride_s, length_s};
  }
  /// Calls visit(i, window) for the windows that overlap an interval.
  template <class Visit>
  void for_each(const Piece& piece, Index interval, const Visit& visit) const {
    const auto k = static_cast<std::size_t>(interval);
    const double from = piece.edges[k] - piece.edges.front(),
                 to = piece.edges[k + 1] - piece.edges.front();
    const auto first = static_cast<Index>(std::floor((from - length_s) / stride_s));
    const auto last = static_cast<Index>(std::ceil(to / stride_s));
    for (Index i = std::max<Index>(0, first); i <= std::min(last, count(piece) - 1); ++i)
      visit(i, window(piece, i));
  }
};

double median_period(const Record& record) {
  std::vector<double> periods;
  for (std::size_t k = 1; k < record.ticks(); ++k)
    periods.push_back(record.time_s[k] - record.time_s[k - 1]);
  if (periods.empty())
    throw Error(ErrorCode::invalid, fmt::format("{}: number of ticks: {}, expected at least 2",
                                                record.where, record.ticks()));
  const auto middle = periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2);
  std::nth_element(periods.begin(), middle, periods.end());
  return *middle;
}

/// Makes the pieces of a record, and estimates the noise of its positions.
class Pieces {
 public:
  Pieces(const Record& record, double friction_speed)
      : record_(record),
        period_s_(median_period(record)),
        smoothing_s_(smoothing_ticks * period_s_),
        squares_(VectorXd::Zero(record.q.rows())) {
    cut();
    noise_ = (squares_ / std::max(1.0, freedom_)).cwiseSqrt();
    // The rate of a cubic over n ticks in S seconds has the variance 75 σ²/(n S²).
    const double ratio = noise_.maxCoeff() / (rate_noise_max * friction_speed);
    const double needed = std::cbrt(75.0 * period_s_ * ratio * ratio);
    if (const double longer = std::min(needed, smoothing_max_s); longer > smoothing_s_) {
      smoothing_s_ = longer;
      cut();
    }
  }

  [[nodiscard]] const std::vector<Piece>& pieces() const noexcept { return pieces_; }
  [[nodiscard]] double period_s() const noexcept { return period_s_; }
  [[nodiscard]] const VectorXd& noise() const noexcept { return noise_; }
  [[nodiscard]] double longest_s() const {
    double longest = 0.0;
    for (const Piece& piece : pieces_) longest = std::max(longest, piece.length_s());
    return longest;
  }

 private:
  [[nodiscard]] bool joined(std::size_t k) const {
    constexpr double gap = 3.5;  // periods: a tick or two may be lost
    return record_.usable[k] != 0 && record_.usable[k + 1] != 0 &&
           record_.time_s[k + 1] - record_.time_s[k] <= gap * period_s_;
  }
  void cut() {
    pieces_.clear();
    std::size_t first = 0;
    for (std::size_t k = 0; k < record_.ticks(); ++k)
      if (k + 1 == record_.ticks() || !joined(k)) {
        add(first, k + 1);
        first = k + 1;
      }
  }
  void add(std::size_t first, std::size_t last);

  const Record& record_;
  double period_s_, smoothing_s_, freedom_ = 0.0;
  VectorXd squares_, noise_;
  std::vector<Piece> pieces_;
};

void Pieces::add(std::size_t first, std::size_t last) {
  if (last - first < 2) return;
  LocalPolynomial polynomial(record_.time_s, record_.q, 0.5 * smoothing_s_);
  const auto room = static_cast<Index>(last - first - 1);
  Piece piece;
  piece.q = piece.v = piece.mean_rate = MatrixXd(record_.q.rows(), room);
  Index count = 0;
  for (std::size_t k = first; k + 1 < last; ++k) {
    const double from = record_.time_s[k], to = record_.time_s[k + 1];
    if (!polynomial.fit(0.5 * (from + to), first, last)) {
      if (count > 0) break;
      continue;
    }
    if (count == 0) {
      piece.first_tick = k;
      piece.edges.push_back(from);
    }
    piece.edges.push_back(to);
    const auto at = static_cast<Index>(k);
    piece.q.col(count) = polynomial.q();
    piece.v.col(count) = polynomial.v();
    piece.mean_rate.col(count++) = (record_.q.col(at + 1) - record_.q.col(at)) / (to - from);
    squares_ += polynomial.squares();
    freedom_ += polynomial.freedom();
  }
  if (count == 0) return;
  for (MatrixXd* matrix : {&piece.q, &piece.v, &piece.mean_rate})
    matrix->conservativeResize(Eigen::NoChange, count);
  pieces_.push_back(std::move(piece));
}

// The share of noise in the averaged accelerations, of the joint where it is largest.
double noise_share(const Pieces& pieces, const Windowing& windowing) {
  const VectorXd& noise = pieces.noise();
  VectorXd accelerations = VectorXd::Zero(noise.size()), rates = accelerations;
  Index count = 0;
  for (const Piece& piece : pieces.pieces()) {
    const Index windows = windowing.count(piece);
    MatrixXd a = MatrixXd::Zero(noise.size(), windows), v = a;
    for (Index k = 0; k < piece.intervals(); ++k)
      windowing.for_each(piece, k, [&](Index i, const Window& window) {
        const double from = piece.edges[static_cast<std::size_t>(k)],
                     to = piece.edges[static_cast<std::size_t>(k) + 1];
        a.col(i) -= (window.weight(to) - window.weight(from)) * piece.mean_rate.col(k);
        v.col(i) += (window.integral(to) - window.integral(from)) * piece.mean_rate.col(k);
      });
    accelerations += a.rowwise().squaredNorm();
    rates += v.rowwise().squaredNorm();
    count += windows;
  }
  if (count == 0) return 1.0;
  const double gain = square_of_curvature * pieces.period_s() / std::pow(windowing.length_s, 5);
  double worst = 0.0;
  for (Index j = 0; j < noise.size(); ++j)
    if (rates[j] > still_speed * still_speed * static_cast<double>(count))
      worst = std::max(worst,
                       gain * noise[j] * noise[j] * static_cast<double>(count) / accelerations[j]);
  return worst;
}

Windowing windowing_of(double length_s, const Pieces& pieces) {
  double total = 0.0;
  for (const Piece& piece : pieces.pieces()) total += piece.length_s();
  return {length_s,
          std::max(length_s / strides_per_window, total / static_cast<double>(windows_max))};
}

Windowing choose_windowing(const Record& record, const Pieces& pieces,
                           const std::optional<double>& given_s) {
  const double least = window_ticks * pieces.period_s();
  if (given_s) {
    if (!(*given_s >= least) || !std::isfinite(*given_s))
      throw Error(ErrorCode::usage,
                  fmt::format("{}: window: {} s, expected at least {:.3g} s, which are {} ticks",
                              record.where, *given_s, least, window_ticks));
    return windowing_of(*given_s, pieces);
  }
  constexpr double growth = 1.25, share_of_longest = 0.1;
  double length = std::max(window_min_s, least);
  const double most =
      std::max(length, std::min(window_max_s, share_of_longest * pieces.longest_s()));
  while (length * growth <= most &&
         noise_share(pieces, windowing_of(length, pieces)) > noise_share_max)
    length *= growth;
  return windowing_of(length, pieces);
}

/// Fills the rows of all windows.
class Rows {
 public:
  Rows(const model::Model& model, const Record& record, double friction_speed, Index count)
      : model_(model),
        record_(record),
        friction_speed_(friction_speed),
        ws_(model),
        P_(model.dof(), 10 * model.dof()),
        L_(P_),
        unused_(P_),
        torque_(model.dof()) {
    samples_.joints.assign(static_cast<std::size_t>(model.dof()),
                           {MatrixXd::Zero(count, 10 * model.dof() + 2), VectorXd::Zero(count)});
  }

  void add(const Piece& piece, const Windowing& windowing) {
    for (Index k = 0; k < piece.intervals(); ++k) {
      dynamics::momentum_regressor(model_, ws_, piece.q.col(k), piece.mean_rate.col(k), P_, L_);
      dynamics::momentum_regressor(model_, ws_, piece.q.col(k), piece.v.col(k), unused_, L_);
      windowing.for_each(piece, k, [&](Index i, const Window& window) {
        add_interval(piece, k, window, first_row_ + i);
      });
    }
    for (Index i = 0; i < windowing.count(piece); ++i)
      samples_.time_s.push_back(windowing.window(piece, i).center_s);
    first_row_ += windowing.count(piece);
  }
  [[nodiscard]] Samples& samples() noexcept { return samples_; }

 private:
  void add_interval(const Piece& piece, Index k, const Window& window, Index row);
  void average_torque(const Piece& piece, Index k, const Window& window);

  const model::Model& model_;
  const Record& record_;
  double friction_speed_;
  dynamics::Workspace ws_;
  MatrixXd P_, L_, unused_;  ///< P at mean rates, L at smooth ones; P at these is not needed
  VectorXd torque_;
  Samples samples_;
  Index first_row_ = 0;
};

// docs/theory.md (2.49)
void Rows::add_interval(const Piece& piece, Index k, const Window& window, Index row) {
  const double from = piece.edges[static_cast<std::size_t>(k)],
               to = piece.edges[static_cast<std::size_t>(k) + 1];
  const double rise = window.weight(to) - window.weight(from),
               share = window.integral(to) - window.integral(from);
  if (share == 0.0) return;
  average_torque(piece, k, window);
  const Index inertial = P_.cols();
  for (Index j = 0; j < P_.rows(); ++j) {
    Samples::Joint& joint = samples_.joints[static_cast<std::size_t>(j)];
    const double rate = piece.mean_rate(j, k);
    joint.A.row(row).head(inertial) -= rise * P_.row(j) + share * L_.row(j);
    joint.A(row, inertial) += share * rate;
    joint.A(row, inertial + 1) += share * std::tanh(piece.v(j, k) / friction_speed_);
    const double armature = model_.robot().links[static_cast<std::size_t>(j)].joint.armature;
    joint.b[row] += torque_[j] + armature * rise * rate;
  }
}

// docs/theory.md (2.50): torques that are held exactly, linear ones by four points of Gauss.
void Rows::average_torque(const Piece& piece, Index k, const Window& window) {
  const double from = piece.edges[static_cast<std::size_t>(k)],
               to = piece.edges[static_cast<std::size_t>(k) + 1];
  const std::size_t tick = piece.first_tick + static_cast<std::size_t>(k);
  const auto column = static_cast<Index>(tick);
  torque_.setZero();
  if (record_.held.size() > 0)
    torque_ += (window.integral(to) - window.integral(from)) * record_.held.col(column);
  if (record_.impulses.size() > 0) torque_ += window.weight(from) * record_.impulses.col(column);
  if (record_.sampled.size() == 0) return;
  constexpr double nodes[] = {0.8611363115940526, 0.3399810435848563};
  constexpr double weights[] = {0.3478548451374538, 0.6521451548625461};
  const double middle = 0.5 * (from + to), half = 0.5 * (to - from);
  for (const double side : {-1.0, 1.0})
    for (int i = 0; i < 2; ++i) {
      const double t = middle + side * nodes[i] * half, sampled_at = t - record_.sampled_shift_s;
      const std::size_t before = sampled_at < from && tick > 0 ? tick - 1 : tick;
      const auto a = static_cast<Index>(before);
      const double begin = record_.time_s[before], end = record_.time_s[before + 1];
      const double along = (sampled_at - begin) / (end - begin);
      torque_ += half * weights[i] * window.weight(t) *
                 ((1.0 - along) * record_.sampled.col(a) + along * record_.sampled.col(a + 1));
    }
}

}  // namespace

Samples windowed_samples(const model::Model& model, const Record& record,
                         const WindowOptions& options) {
  check(record, model.robot());
  if (!(options.friction_speed > 0.0) || !std::isfinite(options.friction_speed))
    throw Error(ErrorCode::usage, fmt::format("friction speed: {}, expected a positive number",
                                              options.friction_speed));
  const Pieces pieces(record, options.friction_speed);
  const Windowing windowing = choose_windowing(record, pieces, options.window_s);
  Index count = 0;
  double total = 0.0;
  for (const Piece& piece : pieces.pieces()) {
    count += windowing.count(piece);
    total += piece.length_s();
  }
  if (count < windows_min)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: its {:.3g} s of usable motion give {} windows of {:.3g} s, "
                            "expected at least {}",
                            record.where, total, count, windowing.length_s, windows_min));
  Rows rows(model, record, options.friction_speed, count);
  for (const Piece& piece : pieces.pieces()) rows.add(piece, windowing);
  Samples samples = std::move(rows.samples());
  samples.overlap = std::max(1.0, windowing.length_s / (square_of_weight * windowing.stride_s));
  samples.window_s = windowing.length_s;
  samples.q_noise = pieces.noise();
  return samples;
}

}  // namespace hamelin::identification
