#include "hamelin/accuracy/accuracy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "poll.hpp"

namespace hamelin::accuracy {

using Eigen::VectorXd;
using integration::Integrator;

namespace {

constexpr double samples_max = 131072.0;
constexpr double steps_max = 1e10;
// A run under step control that needs more steps makes them ever shorter.
constexpr long controlled_steps_max = 20'000'000;
constexpr int repeats_max = 1000;
constexpr double first_step_s = 1e-3;  // under step control, which adapts it in a few steps

double thread_cpu_s() {
  std::timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

[[noreturn]] void refuse(const std::string& text) {
  throw Error(ErrorCode::usage, text);
}

long step_count(double duration_s, double step_s) {
  const double steps = duration_s / step_s, rounded = std::round(steps);
  if (!(step_s > 0.0) || !std::isfinite(steps))
    refuse(fmt::format("--steps: {} s is not a step, expected positive numbers", step_s));
  if (rounded > steps_max)
    refuse(fmt::format("--steps: {:.3g} steps of {} s are too many, expected at most 1e10", rounded,
                       step_s));
  if (std::abs(steps - rounded) > 1e-9 * std::max(1.0, rounded) || rounded < 1.0)
    refuse(fmt::format(
        "--steps: the duration {} s is not an integer multiple of the step {} s (ratio {})",
        duration_s, step_s, steps));
  return static_cast<long>(rounded);
}

// Settings of one row, and its integrator.
struct Job {
  Row row;
  long steps = 0;  // 0: step control
  std::unique_ptr<Integrator> integrator;
};

Job make_job(const model::Model& model, const Scheme& scheme,
             const integration::Parameters& options, long steps, double step_s) {
  Job job;
  job.integrator = integration::make_integrator(scheme.integrator, model, options);
  job.steps = steps;
  Row& row = job.row;
  row.integrator = scheme.integrator;
  row.order = job.integrator->order();
  row.order_asked = scheme.order > 0;
  if (options.step_control()) {
    row.rtol = options.rtol;
    row.atol = options.atol;
  } else {
    row.step_s = step_s;
  }
  if (integration::find_scheme(scheme.integrator)->iterates && !options.step_control())
    row.tolerance = job.integrator->tolerance();
  row.isa = name_of(job.integrator->isa());
  row.mode = job.integrator->mode();
  return job;
}

std::vector<Job> make_jobs(const model::Model& model, const Options& options) {
  const auto sized = [&](const VectorXd& x, const char* what) {
    if (x.size() != model.dof() || !x.allFinite())
      refuse(
          fmt::format("{}: {} values given, expected {} finite ones", what, x.size(), model.dof()));
  };
  const auto positive = [](double x, const char* what) {
    if (!(x > 0.0) || !std::isfinite(x))
      refuse(fmt::format("{}: {} given, expected positive numbers", what, x));
  };
  sized(options.q0, "--q0");
  sized(options.v0, "--v0");
  positive(options.duration_s, "--duration");
  for (const double rtol : options.rtols) positive(rtol, "--rtol");
  for (const double tolerance : options.tolerances) positive(tolerance, "--tolerance");
  if (options.atol) positive(*options.atol, "--atol");
  if (options.schemes.empty())
    refuse("--integrators: is empty, expected a list such as hamel-variational,gauss:8,dop853");
  if (options.steps_s.empty() && options.rtols.empty())
    refuse("neither --steps nor --rtol is given, expected one of them");

  std::vector<Job> jobs;
  for (const auto& scheme : options.schemes) {
    integration::Parameters base;
    if (scheme.order > 0) base.order = scheme.order;
    const auto* known = integration::find_scheme(scheme.integrator);
    if (known == nullptr) {
      // Throws and names the known ones.
      (void)integration::make_integrator(scheme.integrator, model, base);
      continue;
    }
    if (options.steps_s.empty() && !known->step_control)
      refuse(
          fmt::format("integrator '{}' has no step control, expected --steps", scheme.integrator));
    auto tolerances = options.tolerances;
    if (tolerances.empty() || !known->iterates) tolerances = {0.0};
    for (const double tolerance : tolerances)
      for (const double step_s : options.steps_s) {
        integration::Parameters fixed = base;
        if (tolerance > 0.0) fixed.tolerance = fixed.feedback_tolerance = tolerance;
        jobs.push_back(
            make_job(model, scheme, fixed, step_count(options.duration_s, step_s), step_s));
      }
    if (!known->step_control) continue;
    for (const double rtol : options.rtols) {
      integration::Parameters controlled = base;
      controlled.rtol = rtol;
      controlled.atol = options.atol.value_or(rtol);
      jobs.push_back(make_job(model, scheme, controlled, 0, 0.0));
    }
  }
  return jobs;
}

template <class AfterStep>
std::optional<std::string> integrate(Integrator& integrator, integration::State& state,
                                     const Options& options, long steps, const AfterStep& after) {
  const integration::Channels& channels = options.channels;
  const double duration_s = options.duration_s;
  if (steps > 0) {
    const double h = duration_s / static_cast<double>(steps);
    for (long k = 0; k < steps; ++k) {
      poll(options, k);
      const auto report = integrator.advance(state, channels, h);
      after(report, k + 1 == steps);
      if (!report.converged) return fmt::format("step {} of {} s found no solution", k + 1, h);
    }
  } else {
    state.step_next = std::min(first_step_s, duration_s);
    double left = duration_s;
    for (long k = 0; left > 0.0; ++k) {
      if (k == controlled_steps_max)
        return fmt::format("took more than {} steps", controlled_steps_max);
      poll(options, k);
      const auto report = integrator.advance(state, channels, left);
      left = report.step_s == left ? 0.0 : left - report.step_s;
      after(report, left == 0.0);
      if (!report.converged)
        return fmt::format("step {} at {:.6g} s found no solution", k + 1, duration_s - left);
    }
  }
  if (!state.q.allFinite()) return "the joint positions are no longer finite";
  return std::nullopt;
}

double largest_difference(const VectorXd& a, const VectorXd& b) {
  return (a - b).lpNorm<Eigen::Infinity>();
}

// The pass that measures energy, counts and the error at the end: docs/theory.md (13.1), (13.8).
void observe(Job& job, const Options& options, const std::optional<Reference>& reference) {
  Row& row = job.row;
  Integrator& integrator = *job.integrator;
  integration::State state = integrator.start(options.q0, options.v0);
  const double energy_before = integrator.energy(state).total();
  const long every =
      job.steps == 0 ? 1
      : options.every > 0
          ? options.every
          : static_cast<long>(std::ceil(static_cast<double>(job.steps) / samples_max));
  Drift drift;
  drift.add(0.0, 0.0);
  double largest = 0.0, dissipated = 0.0;
  const auto cause = integrate(
      integrator, state, options, job.steps, [&](const integration::StepReport& report, bool last) {
        row.evaluations += report.evaluations;
        row.factorizations += report.factorizations;
        row.rejected += report.rejected;
        row.halvings += report.halvings;
        if (!report.converged) return;
        ++row.steps;
        dissipated += report.dissipated_J;
        if (row.steps % every != 0 && !last) return;
        const double error = integrator.energy(state).total() - energy_before + dissipated;
        largest = std::isfinite(error) ? std::max(largest, std::abs(error)) : error;
        drift.add(state.time_s, error);
      });
  VectorXd v(state.q.size());
  if (!cause) integrator.velocity(state, v);
  row.completed = !cause && v.allFinite() && std::isfinite(largest);
  if (!row.completed) {
    row.cause = cause.value_or("the energy is no longer finite");
    return;
  }
  row.energy_error_max_J = largest;
  row.energy_samples = drift.samples();
  if (const auto slope = drift.slope()) {
    row.drift_J_per_s = slope->value;
    row.drift_ci_J_per_s = slope->half_width;
  }
  if (!reference) return;
  row.error_q = largest_difference(state.q, reference->q);
  row.error_v = largest_difference(v, reference->v);
  row.reference_error = reference->error_q;
  row.reference_error_v = reference->error_v;
  row.reference_limited = *row.error_q <= reference->error_q;
}

// Passes that only start and step. The least time is that of the pass that was disturbed least.
void time(Job& job, const Options& options) {
  double spent_s = 0.0, least_s = 0.0;
  for (int repeat = 0; repeat < repeats_max; ++repeat) {
    const double begin_s = thread_cpu_s();
    integration::State state = job.integrator->start(options.q0, options.v0);
    (void)integrate(*job.integrator, state, options, job.steps,
                    [](const integration::StepReport&, bool) {});
    const double took_s = thread_cpu_s() - begin_s;
    least_s = repeat == 0 ? took_s : std::min(least_s, took_s);
    spent_s += took_s;
    if (spent_s >= options.timing_s && (repeat > 0 || took_s > 1.0)) break;
  }
  job.row.cpu_us = 1e6 * least_s;
}

}  // namespace

std::vector<Scheme> read_schemes(const std::string& text) {
  std::vector<Scheme> schemes;
  for (std::size_t begin = 0; begin <= text.size();) {
    const auto end = std::min(text.find(',', begin), text.size());
    const std::string entry = text.substr(begin, end - begin);
    integration::SchemeName parsed;
    try {
      parsed = integration::parse_scheme_name(entry);
    } catch (const Error& error) {
      refuse(fmt::format("--integrators: {}", error.what()));
    }
    const Scheme scheme{parsed.name, parsed.order.value_or(0)};
    if (scheme.integrator.empty())
      refuse(
          fmt::format("--integrators: '{}' has an empty entry, expected a list such as "
                      "hamel-variational,gauss:8",
                      text));
    for (const auto& other : schemes)
      if (other.integrator == scheme.integrator && other.order == scheme.order)
        refuse(
            fmt::format("--integrators: '{}' is given twice, expected different entries", entry));
    schemes.push_back(scheme);
    begin = end + 1;
  }
  return schemes;
}

Measurement measure(const model::Model& model, const Options& options) {
  auto jobs = make_jobs(model, options);
  Measurement measurement;
  measurement.name = options.name;
  measurement.dof = model.dof();
  measurement.planar = model.planar();
  measurement.duration_s = options.duration_s;
  if (options.reference) measurement.reference = find_reference(model, options);
  for (auto& job : jobs) {
    observe(job, options, measurement.reference);
    if (job.row.completed) time(job, options);
    measurement.rows.push_back(job.row);
    job.integrator.reset();
    if (options.progress) options.progress(measurement.rows.size(), jobs.size());
  }
  const auto limited = std::count_if(measurement.rows.begin(), measurement.rows.end(),
                                     [](const Row& row) { return row.reference_limited; });
  if (limited > 0)
    measurement.notes.push_back(
        fmt::format("{} row(s) differ from the reference by at most its own error ({:.1e}): their "
                    "errors are upper bounds",
                    limited, measurement.reference->error_q));
  return measurement;
}

}  // namespace hamelin::accuracy
