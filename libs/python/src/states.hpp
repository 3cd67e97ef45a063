#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "bound_model.hpp"

/// Joint vectors of one state or of many, as arguments of calls.
namespace hamelin::python {

/// States per pass through the SIMD kernels where arrays are transposed: the block stays in the
/// cache.
inline constexpr py::ssize_t block_states = 128;
/// From so many states on, a call releases Python's lock.
inline constexpr py::ssize_t states_without_lock = 16;

/// Releases Python's lock during long calls.
class Unlocked {
 public:
  explicit Unlocked(py::ssize_t states) {
    if (states >= states_without_lock) release_.emplace();
  }

 private:
  std::optional<py::gil_scoped_release> release_;
};

/// Joint vectors of one call: a single state, or one state per row.
class States {
 public:
  States(const char* function, py::ssize_t dof) : function_(function), dof_(dof) {}

  const Numbers& add(const char* argument, py::handle given) {
    Numbers& numbers =
        all_[count_].emplace(function_, argument, given, Numbers::Layout::rows_or_columns);
    const Numbers& first = *all_[0];
    const bool fits = (numbers.dimensions() == 1 || numbers.dimensions() == 2) &&
                      numbers.extent(numbers.dimensions() - 1) == dof_;
    if (!fits)
      refuse(function_, argument,
             fmt::format("shape {}, expected ({},) or (N, {})", describe_shape(numbers.array()),
                         dof_, dof_));
    if (count_ > 0 &&
        (numbers.dimensions() != first.dimensions() || numbers.extent(0) != first.extent(0)))
      refuse(function_, argument,
             fmt::format("shape {}, expected {}, as of the first argument",
                         describe_shape(numbers.array()), describe_shape(first.array())));
    ++count_;
    return numbers;
  }
  [[nodiscard]] const Numbers& operator[](std::size_t i) const { return *all_[i]; }
  [[nodiscard]] bool single() const { return all_[0]->dimensions() == 1; }
  [[nodiscard]] py::ssize_t count() const { return single() ? 1 : all_[0]->extent(0); }
  [[nodiscard]] py::ssize_t dof() const noexcept { return dof_; }
  /// Whether all arguments have one joint after the other, as the kernels want them.
  [[nodiscard]] bool by_columns() const {
    return std::all_of(all_.begin(), all_.begin() + static_cast<std::ptrdiff_t>(count_),
                       [](const auto& x) { return x->by_columns(); });
  }
  /// The state of a row; numbers that are not adjacent are copied to the scratch memory.
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> row(std::size_t argument, py::ssize_t i,
                                                      Eigen::VectorXd& scratch) const {
    const Numbers& x = *all_[argument];
    if (!x.by_columns()) return {x.data() + i * dof_, dof_};
    for (py::ssize_t j = 0; j < dof_; ++j) scratch[j] = x.data()[j * count() + i];
    return {scratch.data(), dof_};
  }
  /// Writes states [first, first + count) of an argument to a block, dof x states.
  void gather(std::size_t argument, py::ssize_t first, py::ssize_t states,
              dynamics::StatesXd& out) const {
    const Numbers& x = *all_[argument];
    if (x.by_columns()) {
      for (py::ssize_t j = 0; j < dof_; ++j)
        std::copy_n(x.data() + j * count() + first, states, out.data() + j * block_states);
      return;
    }
    for (py::ssize_t j = 0; j < dof_; ++j) {
      const double* const from = x.data() + first * dof_ + j;
      double* const to = out.data() + j * block_states;
      for (py::ssize_t i = 0; i < states; ++i) to[i] = from[i * dof_];
    }
  }

 private:
  const char* function_;
  py::ssize_t dof_;
  std::array<std::optional<Numbers>, 3> all_;
  std::size_t count_ = 0;
};

/// Calls f(ws, i, out) for each state, where `out` is the memory of its result of these extents.
template <class F>
py::array_t<double> for_each_state(BoundModel& bound, const States& in,
                                   std::vector<py::ssize_t> extents, F f) {
  py::ssize_t size = 1;
  for (const auto extent : extents) size *= extent;
  if (!in.single()) extents.insert(extents.begin(), in.count());
  py::array_t<double> out(extents);
  double* const y = out.mutable_data();
  const py::ssize_t count = in.count();
  if (count < states_without_lock) {
    for (py::ssize_t i = 0; i < count; ++i) f(bound.ws, i, y + i * size);
    return out;
  }
  const py::gil_scoped_release unlocked;
  dynamics::Workspace ws(bound.model);
  for (py::ssize_t i = 0; i < count; ++i) f(ws, i, y + i * size);
  return out;
}

/// The same for three joint vectors: f(ws, x, y, z, out).
template <class F>
py::array_t<double> for_each_three(BoundModel& bound, const States& in,
                                   std::vector<py::ssize_t> extents, F f) {
  std::array<Eigen::VectorXd, 3> x;
  for (auto& each : x) each.resize(in.dof());
  return for_each_state(bound, in, std::move(extents),
                        [&, x](auto& ws, py::ssize_t i, double* y) mutable {
                          f(ws, in.row(0, i, x[0]), in.row(1, i, x[1]), in.row(2, i, x[2]), y);
                        });
}

/// Calls f(ws, out) for each configuration, the first argument, of which ws has the poses.
template <class F>
py::array_t<double> for_each_posture(BoundModel& bound, const States& in,
                                     std::vector<py::ssize_t> extents, F f) {
  return for_each_state(
      bound, in, std::move(extents),
      [&, x = Eigen::VectorXd(in.dof())](auto& ws, py::ssize_t i, double* y) mutable {
        dynamics::forward_kinematics(bound.model, ws, in.row(0, i, x));
        f(ws, y);
      });
}

}  // namespace hamelin::python
