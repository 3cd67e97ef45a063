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
/// cache, and its rows are no power of two apart, where they would displace each other.
inline constexpr py::ssize_t block_states = 136;
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
  [[nodiscard]] std::size_t arguments() const noexcept { return count_; }
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
    scratch.resize(dof_);
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

/// An array with a matrix per state, in Fortran order if the states are, else in C order.
class Blocks {
 public:
  Blocks(const States& in, py::ssize_t rows, py::ssize_t columns)
      : count_(in.count()),
        rows_(rows),
        columns_(columns),
        by_columns_(in.by_columns()),
        array_(by_columns_ ? array_by_columns() : new_array({count_, rows, columns})),
        data_(array_.mutable_data()) {}
  [[nodiscard]] const py::array_t<double>& array() const noexcept { return array_; }
  [[nodiscard]] double* data() noexcept { return data_; }
  [[nodiscard]] py::ssize_t entries() const noexcept { return rows_ * columns_; }
  /// Entry (row, column) of `states` states from `first` on.
  void write(py::ssize_t first, py::ssize_t states, py::ssize_t row, py::ssize_t column,
             const double* numbers) {
    if (by_columns_) {
      std::copy_n(numbers, states, data_ + first + count_ * (row + rows_ * column));
      return;
    }
    double* const to = data_ + first * entries() + row * columns_ + column;
    for (py::ssize_t i = 0; i < states; ++i) to[i * entries()] = numbers[i];
  }
  /// All entries, from column-major matrices with one state per column; in C order.
  void write(py::ssize_t first, py::ssize_t states, const dynamics::StatesXd& numbers) {
    double* to = data_ + first * entries();
    for (py::ssize_t state = 0; state < states; ++state)
      for (py::ssize_t row = 0; row < rows_; ++row) {
        const double* from = numbers.data() + row * numbers.cols() + state;
        for (py::ssize_t column = 0; column < columns_; ++column, from += rows_ * numbers.cols())
          *to++ = *from;
      }
  }

 private:
  [[nodiscard]] py::array_t<double> array_by_columns() const {
    constexpr py::ssize_t size = sizeof(double);
    return py::array_t<double>(
        py::array::ShapeContainer{count_, rows_, columns_},
        py::array::StridesContainer{size, size * count_, size * count_ * rows_});
  }

  py::ssize_t count_, rows_, columns_;
  bool by_columns_;
  py::array_t<double> array_;
  double* data_;
};

/// Calls f(given, results) for blocks of states, where given(i) and results(i) are the numbers of
/// the arguments and of `out` as the libraries take them, one row after the other. Arrays in
/// Fortran order are used in place.
template <std::size_t Count, class F>
void evaluate_in_blocks(const States& in, std::array<Blocks, Count>& out, const F& f) {
  using Rows = Eigen::OuterStride<>;
  using Given = Eigen::Map<const dynamics::StatesXd, 0, Rows>;
  using Result = Eigen::Map<dynamics::StatesXd, 0, Rows>;
  const Unlocked unlocked(in.count());
  if (in.by_columns()) {
    const py::ssize_t count = in.count();
    f([&](std::size_t i) { return Given(in[i].data(), in.dof(), count, Rows(count)); },
      [&](std::size_t i) { return Result(out[i].data(), out[i].entries(), count, Rows(count)); });
    return;
  }
  std::array<dynamics::StatesXd, 3> given;
  std::array<dynamics::StatesXd, Count> results;
  for (std::size_t i = 0; i < in.arguments(); ++i) given[i].resize(in.dof(), block_states);
  for (std::size_t i = 0; i < Count; ++i) results[i].resize(out[i].entries(), block_states);
  for (py::ssize_t first = 0; first < in.count(); first += block_states) {
    const py::ssize_t states = std::min(block_states, in.count() - first);
    for (std::size_t i = 0; i < in.arguments(); ++i) in.gather(i, first, states, given[i]);
    f([&](std::size_t i) { return Given(given[i].data(), in.dof(), states, Rows(block_states)); },
      [&](std::size_t i) {
        return Result(results[i].data(), out[i].entries(), states, Rows(block_states));
      });
    for (std::size_t i = 0; i < Count; ++i) out[i].write(first, states, results[i]);
  }
}

/// Calls f(ws, i, out) for each state, where `out` is the memory of its result of these extents.
template <class F>
py::array_t<double> for_each_state(BoundModel& bound, const States& in,
                                   std::vector<py::ssize_t> extents, F f) {
  py::ssize_t size = 1;
  for (const auto extent : extents) size *= extent;
  if (!in.single()) extents.insert(extents.begin(), in.count());
  auto out = new_array(extents);
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
  return for_each_state(
      bound, in, std::move(extents),
      [&, x = std::array<Eigen::VectorXd, 3>()](auto& ws, py::ssize_t i, double* y) mutable {
        f(ws, in.row(0, i, x[0]), in.row(1, i, x[1]), in.row(2, i, x[2]), y);
      });
}

/// Calls f(ws, out) for each configuration, the first argument, of which ws has the poses.
template <class F>
py::array_t<double> for_each_posture(BoundModel& bound, const States& in,
                                     std::vector<py::ssize_t> extents, F f) {
  return for_each_state(bound, in, std::move(extents),
                        [&, x = Eigen::VectorXd()](auto& ws, py::ssize_t i, double* y) mutable {
                          dynamics::forward_kinematics(bound.model, ws, in.row(0, i, x));
                          f(ws, y);
                        });
}

}  // namespace hamelin::python
