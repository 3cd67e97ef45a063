#pragma once
#include <pybind11/pybind11.h>

#include <atomic>
#include <optional>

namespace hamelin::python {

namespace py = pybind11;

/// Looks for Ctrl-C during a call that has released Python's lock.
class InterruptCheck {
 public:
  /// @return whether Python has a pending signal whose handler raised; then `stop` is set, and
  /// rethrow() raises the exception
  bool check() {
    if (stop.load(std::memory_order_relaxed)) return true;
    const py::gil_scoped_acquire locked;
    if (PyErr_CheckSignals() == 0) return false;
    error_.emplace();
    stop.store(true, std::memory_order_relaxed);
    return true;
  }
  /// Keeps the exception that a callback raised. The caller holds Python's lock.
  void keep(py::error_already_set& error) {
    if (!error_) error_.emplace(error);
    stop.store(true, std::memory_order_relaxed);
  }
  /// Raises the exception, if there is one. The caller holds Python's lock.
  void rethrow() {
    if (error_) throw py::error_already_set(*error_);
  }
  /// check(), and raises at once.
  void raise() {
    if (check()) {
      const py::gil_scoped_acquire locked;
      throw py::error_already_set(*error_);
    }
  }
  ~InterruptCheck() {
    if (!error_) return;
    const py::gil_scoped_acquire locked;
    error_.reset();
  }

  std::atomic<bool> stop{false};

 private:
  std::optional<py::error_already_set> error_;
};

/// Makes a check known to planners in Python that the same thread calls: Ctrl-C during a tick is an
/// exception there, and ends the run instead of the planner.
class InterruptScope {
 public:
  explicit InterruptScope(InterruptCheck& check) : before_(current_) { current_ = &check; }
  InterruptScope(const InterruptScope&) = delete;
  InterruptScope& operator=(const InterruptScope&) = delete;
  ~InterruptScope() { current_ = before_; }
  /// Null outside of a run.
  [[nodiscard]] static InterruptCheck* current() noexcept { return current_; }

 private:
  static inline thread_local InterruptCheck* current_ = nullptr;  // NOLINT: a member
  InterruptCheck* before_;
};

}  // namespace hamelin::python
