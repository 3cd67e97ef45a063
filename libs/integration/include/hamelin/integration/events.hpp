#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "hamelin/integration/dense_output.hpp"

namespace hamelin::integration {

/// A function of time, positions and velocities whose change of sign is an event.
struct Event {
  std::function<double(double time_s, const VectorXd& q, const VectorXd& v)> value;
  /// 1: only from negative to positive; −1: only from positive to negative; 0: both.
  int direction = 0;
};

struct EventSettings {
  int samples = 8;  ///< per step; signs that change twice between two of them are not seen
  /// By how much the state may be later than the event [s]; at least the rounding of time.
  double tolerance_s = 1e-12;
};

struct EventStep {
  StepReport step;  ///< of the step that was kept
  int event = -1;   ///< index of the event at which the step ended; −1: none
};

/// Steps that end at events. Where the sign of an event changes within a step is found on the
/// step's DenseOutput; then the scheme itself steps there from the node before, until two steps
/// whose lengths differ by at most the tolerance have different signs, docs/theory.md (7.18). The
/// state at an event is thus one of the scheme, as exact as any other, just after the change: the
/// next step does not find the event again. An object belongs to one thread; it allocates nothing
/// after its first step.
class EventFinder {
 public:
  /// @param integrator must outlive this
  /// @throws Error usage for an event without a function or with another direction than −1, 0 and
  ///         1, fewer than one sample, or a tolerance that is not positive and finite
  EventFinder(Integrator& integrator, std::vector<Event> events, const EventSettings& settings);
  EventFinder(Integrator& integrator, std::vector<Event> events)
      : EventFinder(integrator, std::move(events), EventSettings()) {}
  ~EventFinder();
  EventFinder(const EventFinder&) = delete;
  EventFinder& operator=(const EventFinder&) = delete;

  /// Advances by h, or to the first event within h. If the report has converged = false, the state
  /// is unchanged.
  /// @throws Error usage as Integrator::step; invalid if an event's value is not finite. What an
  ///         event throws passes through. The state is then unchanged.
  [[nodiscard]] EventStep step(State& state, const Channels& channels, double h);
  /// The motion of the last step, up to the event.
  [[nodiscard]] const DenseOutput& motion() const noexcept;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace hamelin::integration
