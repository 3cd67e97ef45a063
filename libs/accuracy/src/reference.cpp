#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "hamelin/accuracy/accuracy.hpp"
#include "hamelin/core/error.hpp"
#include "poll.hpp"

namespace hamelin::accuracy {

using Eigen::VectorXd;

namespace {

constexpr double coarsest_step_s = 0.01;
constexpr int halvings_max = 20;
// Rounding of the motion itself: a finer run is not more accurate.
constexpr double rounding = 1e-14;

struct Settings {
  const char* integrator;
  int order;        // 0: the scheme has one order only
  bool controlled;  // refined by rtol, else by halving a fixed step
};

// In order of preference: the first two that reach the end make the reference. They share the
// equations of motion, but neither stages nor step lengths.
constexpr std::array<Settings, 5> preferred{{{"dop853", 0, true},
                                             {"gauss", 16, false},
                                             {"composition", 8, false},
                                             {"rk4", 0, false},
                                             {"hamel-variational", 0, false}}};

// The end of the motion by one scheme.
struct End {
  VectorXd q, v;
  bool reached = false;
};

// A scheme's finest run, and its distance from the run before, docs/theory.md (13.2).
struct Refined {
  End end;
  double error = std::numeric_limits<double>::infinity();
  std::string description;
  long evaluations = 0;
};

double distance(const VectorXd& a, const VectorXd& b) {
  return (a - b).lpNorm<Eigen::Infinity>();
}

class Refinement {
 public:
  Refinement(const model::Model& model, const Options& options, const Settings& settings)
      : model_(model), options_(options), settings_(settings) {
    if (settings.controlled)
      refine_tolerances();
    else
      refine_steps();
  }
  [[nodiscard]] const Refined& best() const noexcept { return best_; }

 private:
  // Records a run. Returns whether a finer run may be more accurate.
  bool accept(const End& end, std::string description) {
    if (!end.reached) return true;
    if (best_.end.reached) {
      const double scale =
          1.0 + std::max(end.q.lpNorm<Eigen::Infinity>(), end.v.lpNorm<Eigen::Infinity>());
      const double moved = std::max(distance(end.q, best_.end.q), distance(end.v, best_.end.v));
      // docs/theory.md (13.3)
      const bool floor =
          moved <= rounding * scale || (moved > 0.5 * best_.error && best_.error < 1e-8 * scale);
      // Where rounding dominates, the run before is as good.
      if (floor && moved > best_.error) return false;
      best_.error = moved;
      best_.end = end;
      best_.description = std::move(description);
      return !floor;
    }
    best_.end = end;
    best_.description = std::move(description);
    return true;
  }

  [[nodiscard]] bool affordable(double next) const {
    return next * static_cast<double>(model_.dof()) <= options_.reference_work;
  }

  End run(const integration::Parameters& scheme, long steps) {
    const auto integrator = integration::make_integrator(settings_.integrator, model_, scheme);
    auto state = integrator->start(options_.q0, options_.v0);
    const double h = steps > 0 ? options_.duration_s / static_cast<double>(steps) : 0.0;
    double left = options_.duration_s;
    last_ = 0;
    state.step_next = std::min(1e-3, left);
    for (long k = 0; left > 0.0; ++k) {
      poll(options_, k);
      const auto report = integrator->advance(state, options_.channels, steps > 0 ? h : left);
      last_ += report.evaluations;
      // A step that was halved to find a root is already a step of the next run, so the two runs
      // would agree too well.
      if (!report.converged || report.halvings > 0 || !affordable(static_cast<double>(last_)))
        return {};
      if (steps > 0)
        left = k + 1 == steps ? 0.0 : left;
      else
        left = report.step_s == left ? 0.0 : left - report.step_s;
    }
    End end{state.q, VectorXd(state.q.size()), true};
    integrator->velocity(state, end.v);
    end.reached = end.q.allFinite() && end.v.allFinite();
    return end;
  }

  integration::Parameters scheme() const {
    integration::Parameters made;
    if (settings_.order > 0) made.order = settings_.order;
    made.tolerance = 1e-14;
    return made;
  }

  [[nodiscard]] std::string name() const {
    return settings_.order > 0 ? fmt::format("{}:{}", settings_.integrator, settings_.order)
                               : settings_.integrator;
  }

  void refine_tolerances() {
    for (const double rtol : {1e-10, 1e-11, 1e-12, 1e-13}) {
      auto made = scheme();
      made.rtol = made.atol = rtol;
      const End end = run(made, 0);
      best_.evaluations += last_;
      if (!end.reached || !accept(end, fmt::format("{} at rtol {}", name(), rtol))) return;
    }
  }

  void refine_steps() {
    long steps = static_cast<long>(std::ceil(options_.duration_s / coarsest_step_s));
    for (int i = 0; i < halvings_max; ++i, steps *= 2) {
      const End end = run(scheme(), steps);
      best_.evaluations += last_;
      const double h = options_.duration_s / static_cast<double>(steps);
      if (!accept(end, fmt::format("{} at {:.3g} s", name(), h)) ||
          !affordable(2.0 * static_cast<double>(last_)))
        return;
    }
  }

  const model::Model& model_;
  const Options& options_;
  const Settings& settings_;
  Refined best_;
  long last_ = 0;  // evaluations of the last run
};

}  // namespace

Reference find_reference(const model::Model& model, const Options& options) {
  std::vector<Refined> found;
  Reference reference;
  for (const auto& settings : preferred) {
    if (found.size() == 2) break;
    if (integration::find_scheme(settings.integrator) == nullptr) continue;
    const Refinement refinement(model, options, settings);
    reference.evaluations += refinement.best().evaluations;
    if (refinement.best().end.reached) found.push_back(refinement.best());
  }
  if (found.size() < 2)
    throw Error(ErrorCode::usage, fmt::format("{}: no two schemes reach {} s within the cost limit "
                                              "of a reference, expected a shorter duration or "
                                              "--no-reference",
                                              options.name, options.duration_s));
  const bool first_is_finer = found[0].error <= found[1].error;
  const Refined &finer = found[first_is_finer ? 0 : 1], &other = found[first_is_finer ? 1 : 0];
  reference.q = finer.end.q;
  reference.v = finer.end.v;
  reference.scheme = finer.description;
  reference.check = other.description;
  // docs/theory.md (13.4)
  reference.error_q = distance(finer.end.q, other.end.q);
  reference.error_v = distance(finer.end.v, other.end.v);
  return reference;
}

}  // namespace hamelin::accuracy
