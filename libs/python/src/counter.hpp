#pragma once
#include <pybind11/pybind11.h>

#include "interrupts.hpp"

namespace hamelin::python {

/// Shows the progress of work that is counted, and looks for Ctrl-C. The caller has released
/// Python's lock, and calls interrupts.rethrow() afterwards.
class Counter {
 public:
  /// @param progress a function of what is done and of all, or None
  explicit Counter(py::object progress) : progress_(std::move(progress)) {}
  void show(std::size_t done, std::size_t all) {
    if (interrupts.check() || progress_.is_none()) return;
    const py::gil_scoped_acquire locked;
    try {
      progress_(done, all);
    } catch (py::error_already_set& error) {
      interrupts.keep(error);
    }
  }
  InterruptCheck interrupts;

 private:
  py::object progress_;
};

}  // namespace hamelin::python
