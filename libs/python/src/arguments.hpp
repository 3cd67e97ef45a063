#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/io/json.hpp"

/// Arguments and results of Python calls: arrays of numpy, JSON, paths and poses.
namespace hamelin::python {

namespace py = pybind11;

/// @throws Error usage, "function: argument: what is wrong, expected …"
[[noreturn]] void refuse(std::string_view function, std::string_view argument,
                         const std::string& wrong);

/// The shape as Python writes it: "(3, 7)".
[[nodiscard]] std::string describe_shape(const py::array& array);

/// The numbers of an argument. An array of float64 is read in place if its layout is accepted; any
/// other array or sequence of real numbers is copied.
class Numbers {
 public:
  /// Which layouts are read in place.
  enum class Layout : std::int32_t {
    rows,            ///< C order
    rows_or_columns  ///< C or Fortran order
  };

  /// @throws py::type_error if it has no real numbers
  Numbers(std::string_view function, std::string_view argument, py::handle given,
          Layout layout = Layout::rows);

  [[nodiscard]] const double* data() const noexcept { return data_; }
  [[nodiscard]] py::ssize_t dimensions() const noexcept { return dimensions_; }
  [[nodiscard]] py::ssize_t extent(py::ssize_t axis) const noexcept { return shape_[axis]; }
  [[nodiscard]] py::ssize_t size() const noexcept;
  /// Whether numbers of a column are adjacent; false where both orders are the same.
  [[nodiscard]] bool by_columns() const noexcept { return by_columns_; }
  [[nodiscard]] py::array array() const { return py::reinterpret_borrow<py::array>(owner_); }

  /// @throws Error usage unless it is a vector of this size
  const Numbers& require_vector(py::ssize_t expected) const;
  /// @throws Error usage unless its rows have this size
  const Numbers& require_rows(py::ssize_t columns) const;
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> vector() const {
    return {data_, static_cast<Eigen::Index>(size())};
  }

 private:
  bool take(py::handle given, Layout layout);

  std::string_view function_, argument_;
  py::object owner_;  // the array; a py::array without one would make an empty one
  const double* data_ = nullptr;
  py::ssize_t dimensions_ = 0;
  const py::ssize_t* shape_ = nullptr;
  bool by_columns_ = false;
};

/// A vector of an argument, or several as the rows of an array, of finite numbers.
class FiniteRows {
 public:
  /// @throws as Numbers; Error usage for another shape, or a number that is not finite
  FiniteRows(std::string_view function, std::string_view argument, py::handle given,
             py::ssize_t columns);

  /// Whether it is one vector.
  [[nodiscard]] bool single() const noexcept { return numbers_.dimensions() == 1; }
  [[nodiscard]] py::ssize_t count() const noexcept { return single() ? 1 : numbers_.extent(0); }
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> operator[](py::ssize_t i) const {
    return {numbers_.data() + i * columns_, columns_};
  }
  /// One row after the other.
  [[nodiscard]] std::span<const double> all() const noexcept {
    return {numbers_.data(), static_cast<std::size_t>(numbers_.size())};
  }
  [[nodiscard]] py::array array() const { return numbers_.array(); }

 private:
  Numbers numbers_;
  py::ssize_t columns_;
};

/// A vector of an argument. @throws as Numbers and Numbers::require_vector
[[nodiscard]] Eigen::VectorXd vector_of(std::string_view function, std::string_view argument,
                                        py::handle given, py::ssize_t size);
/// None gives a vector of size zero.
[[nodiscard]] Eigen::VectorXd optional_vector(std::string_view function, std::string_view argument,
                                              py::handle given, py::ssize_t size);
[[nodiscard]] Eigen::Vector3d vector3_of(std::string_view function, std::string_view argument,
                                         py::handle given);
/// A pose as a homogeneous 4 x 4 matrix; None is the identity.
/// @throws Error usage if its rotation is not one within 1e-9
[[nodiscard]] geometry::SE3 pose_of(std::string_view function, std::string_view argument,
                                    py::handle given);

/// An array with its own memory, in C order.
[[nodiscard]] py::array_t<double> new_array(std::span<const py::ssize_t> shape);
[[nodiscard]] inline py::array_t<double> new_array(std::initializer_list<py::ssize_t> shape) {
  return new_array(std::span(shape.begin(), shape.size()));
}
[[nodiscard]] py::array_t<double> to_array(const Eigen::VectorXd& x);
[[nodiscard]] py::array_t<double> to_array(const Eigen::Vector3d& x);
/// In C order.
[[nodiscard]] py::array_t<double> to_array(const Eigen::MatrixXd& x);
[[nodiscard]] py::array_t<double> to_array(const geometry::SE3& pose);

/// The only number of an array if a single one was asked for, else the array.
[[nodiscard]] py::object number_or_array(bool single, const py::array_t<double>& numbers);

/// Python's dict, list, str, int, float, bool and None from JSON, and back. Numbers that are not
/// finite have no JSON, and arrays and numbers of numpy are accepted.
[[nodiscard]] py::object to_python(const Json& json);
/// @throws py::type_error for another type; Error usage for nesting deeper than 100
[[nodiscard]] Json to_json(py::handle object);

/// os.PathLike, str or bytes. @throws py::type_error
[[nodiscard]] std::filesystem::path path_of(py::handle given);
[[nodiscard]] std::optional<std::filesystem::path> optional_path(py::handle given);
/// One path, a sequence of them, or None.
[[nodiscard]] std::vector<std::filesystem::path> paths_of(py::handle given);

}  // namespace hamelin::python
