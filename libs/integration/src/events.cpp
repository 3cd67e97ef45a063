#include "hamelin/integration/events.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::integration {

namespace {

constexpr int polynomial_halvings = 60;  // down to the rounding of a share of the step

void check_events(const std::vector<Event>& events, const EventSettings& settings) {
  for (std::size_t i = 0; i < events.size(); ++i) {
    if (!events[i].value)
      throw Error(ErrorCode::usage, formatted("EventFinder: event {} has no function", i));
    if (events[i].direction < -1 || events[i].direction > 1)
      throw Error(ErrorCode::usage,
                  formatted("EventFinder: event {}: direction {} given, expected -1, 0 or 1", i,
                            events[i].direction));
  }
  if (settings.samples < 1)
    throw Error(ErrorCode::usage,
                formatted("EventFinder: {} samples given, expected at least 1", settings.samples));
  if (!(settings.tolerance_s > 0.0) || !std::isfinite(settings.tolerance_s))
    throw Error(ErrorCode::usage,
                formatted("EventFinder: a tolerance of {} s given, expected a positive number",
                          settings.tolerance_s));
}

// Whether values that follow each other are an event of this direction. A value of zero is on
// neither side, so the side that was left last counts.
bool changes(double before, double after, int direction) {
  return (before < 0.0 && after > 0.0 && direction >= 0) ||
         (before > 0.0 && after < 0.0 && direction <= 0);
}

// A change of sign between two samples of a step.
struct Change {
  double earlier = 0.0, later = 0.0;
  double found = 0.0;  // on the polynomial
  int event = -1;
};

}  // namespace

struct EventFinder::Data {
  Data(Integrator& of, std::vector<Event> given, const EventSettings& with)
      : integrator(of),
        events(std::move(given)),
        settings(with),
        motion(of.model()),
        q(VectorXd::Zero(of.model().dof())),
        v(q),
        side(events.size(), 0.0) {}

  EventStep step(State& state, const Channels& channels, double h);
  double value(std::size_t event, double time_s);
  double value_of(std::size_t event, const State& state);
  bool first_change(Change& first, const State& after);
  double on_polynomial(double earlier, double later, std::size_t event);
  double retake(const Channels& channels, double h, std::size_t event);
  bool bracket(const Channels& channels, const Change& change, std::size_t event);
  void narrow(const Channels& channels, double guess, std::size_t event);

  Integrator& integrator;
  std::vector<Event> events;
  EventSettings settings;
  DenseOutput motion;
  VectorXd q, v;
  std::vector<double> side;  ///< per event the last value that was not zero
  State before, trial, kept;
  StepReport report, kept_report;  ///< of the steps to `trial` and `kept`
  /// Lengths of steps before and after the change, and the values after them.
  double least = 0.0, most = 0.0, below = 0.0, above = 0.0;
};

EventFinder::EventFinder(Integrator& integrator, std::vector<Event> events,
                         const EventSettings& settings) {
  check_events(events, settings);
  data_ = std::make_unique<Data>(integrator, std::move(events), settings);
}
EventFinder::~EventFinder() = default;

const DenseOutput& EventFinder::motion() const noexcept {
  return data_->motion;
}

// The value at (time_s, q, v).
double EventFinder::Data::value(std::size_t event, double time_s) {
  const double x = events[event].value(time_s, q, v);
  if (!std::isfinite(x))
    throw Error(ErrorCode::invalid, formatted("EventFinder: event {} has the value {} at {} s, "
                                              "expected a finite number",
                                              event, x, time_s));
  return x;
}

double EventFinder::Data::value_of(std::size_t event, const State& state) {
  q = state.q;
  integrator.velocity(state, v);
  return value(event, state.time_s);
}

// The first two samples of the last step between which an event changes; of several events the one
// that changes first on the polynomial, and when it does.
bool EventFinder::Data::first_change(Change& first, const State& after) {
  const double start = motion.begin_s(), h = motion.end_s() - start;
  first.earlier = start;
  for (int k = 1; k <= settings.samples; ++k) {
    const bool last = k == settings.samples;
    first.later = last ? motion.end_s() : start + h * k / settings.samples;
    for (std::size_t i = 0; i < events.size(); ++i) {
      if (!last) motion.at(first.later, q, v);
      const double x = last ? value_of(i, after) : value(i, first.later);
      if (changes(side[i], x, events[i].direction)) {
        const double found = on_polynomial(first.earlier, first.later, i);
        if (first.event < 0 || found < first.found) {
          first.event = static_cast<int>(i);
          first.found = found;
        }
      } else if (x != 0.0) {
        side[i] = x;
      }
    }
    if (first.event >= 0) return true;
    first.earlier = first.later;
  }
  return false;
}

// The change on the polynomial, by bisection; the last node is not one of it.
double EventFinder::Data::on_polynomial(double earlier, double later, std::size_t event) {
  for (int k = 0; k < polynomial_halvings && earlier < later; ++k) {
    const double middle = 0.5 * (earlier + later);
    if (middle <= earlier || middle >= later) break;
    motion.at(middle, q, v);
    (changes(side[event], value(event, middle), events[event].direction) ? later : earlier) =
        middle;
  }
  return later;
}

// A step of length h from the node before, into `trial`, and the value there; not a number if the
// step has failed.
double EventFinder::Data::retake(const Channels& channels, double h, std::size_t event) {
  trial = before;
  report = integrator.step(trial, channels, h);
  return report.converged ? value_of(event, trial) : std::nan("");
}

// Steps of the scheme that have the change between them. `kept` and `most` are those of the whole
// step. False if only the polynomial changes.
bool EventFinder::Data::bracket(const Channels& channels, const Change& change, std::size_t event) {
  const double start = motion.begin_s(), sample = (motion.end_s() - start) / settings.samples;
  const int direction = events[event].direction;
  if (change.later < motion.end_s()) {
    const double x = retake(channels, change.later - start, event);
    if (!changes(side[event], x, direction)) return false;
    std::swap(kept, trial);
    kept_report = report;
    most = change.later - start;
    above = x;
  } else {
    above = value_of(event, kept);
  }
  least = change.earlier - start;
  below = side[event];
  while (least > 0.0) {
    const double x = retake(channels, least, event);
    if (!std::isfinite(x)) return false;
    if (!changes(side[event], x, direction)) {
      below = x;
      break;
    }
    least = least > 1.5 * sample ? least - sample : 0.0;
  }
  return true;
}

// docs/theory.md (7.18)
void EventFinder::Data::narrow(const Channels& channels, double guess, std::size_t event) {
  const double rounding = 4.0 * std::numeric_limits<double>::epsilon(),
               tolerance =
                   std::max(settings.tolerance_s, rounding * (std::abs(before.time_s) + most));
  int moved = 0;  // the end that moved last
  for (double h = guess; most - least > tolerance;) {
    h = std::clamp(h, least + 0.5 * tolerance, most - 0.5 * tolerance);
    const double x = retake(channels, h, event);
    if (!std::isfinite(x)) return;
    if (changes(side[event], x, events[event].direction)) {
      most = h;
      above = x;
      std::swap(kept, trial);
      kept_report = report;
      if (moved > 0) below *= 0.5;
      moved = 1;
    } else {
      least = h;
      below = x;
      if (moved < 0) above *= 0.5;
      moved = -1;
    }
    h = above != below ? most - (most - least) * above / (above - below) : 0.5 * (least + most);
  }
}

EventStep EventFinder::Data::step(State& state, const Channels& channels, double h) {
  for (std::size_t i = 0; i < events.size(); ++i) side[i] = value_of(i, state);
  motion.begin(integrator, state, channels);
  EventStep out{integrator.step(state, channels, h)};
  if (!out.step.converged) return out;
  motion.end(integrator, state, channels);
  Change change;
  if (!first_change(change, state)) return out;
  const auto event = static_cast<std::size_t>(change.event);
  kept = state;
  kept_report = out.step;
  most = out.step.step_s;
  if (!bracket(channels, change, event)) return out;
  narrow(channels, change.found - before.time_s, event);
  state = kept;
  motion.end(integrator, state, channels);
  return {kept_report, change.event};
}

EventStep EventFinder::step(State& state, const Channels& channels, double h) {
  data_->before = state;
  try {
    return data_->step(state, channels, h);
  } catch (...) {
    state = data_->before;
    throw;
  }
}

}  // namespace hamelin::integration
