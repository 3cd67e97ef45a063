#include "arguments.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>
#include <cstring>

#include "hamelin/core/error.hpp"

namespace hamelin::python {

namespace {

constexpr int npy_double = py::detail::npy_api::NPY_DOUBLE_;

// The number of dimensions and the elements per dimension of numpy's arrays are bounded, so that
// no size overflows.
py::array as_array(std::string_view function, std::string_view argument, py::handle given) {
  const auto wrong_type = [&] {
    return py::type_error(
        fmt::format("{}: {}: {}, expected an array of real numbers", function, argument,
                    py::str(py::type::of(given).attr("__name__")).cast<std::string>()));
  };
  if (given.is_none() || PyUnicode_Check(given.ptr()) != 0 || PyBytes_Check(given.ptr()) != 0)
    throw wrong_type();
  py::array array = py::array::ensure(given);
  if (!array) throw wrong_type();
  const char kind = array.dtype().kind();
  if (kind != 'f' && kind != 'i' && kind != 'u') throw wrong_type();
  return array;
}

}  // namespace

void refuse(std::string_view function, std::string_view argument, const std::string& wrong) {
  throw Error(ErrorCode::usage, fmt::format("{}: {}: {}", function, argument, wrong));
}

std::string describe_shape(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t i = 0; i < array.ndim(); ++i)
    text += fmt::format("{}{}", i > 0 ? ", " : "", array.shape(i));
  return text + (array.ndim() == 1 ? ",)" : ")");
}

Numbers::Numbers(std::string_view function, std::string_view argument, py::handle given,
                 Layout layout)
    : function_(function), argument_(argument) {
  if (take(given, layout)) return;
  const py::array array = as_array(function, argument, given);
  const auto copy = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!copy) throw py::error_already_set();
  if (!take(copy, layout))
    refuse(function, argument, "its memory is not aligned, expected an array of float64");
}

bool Numbers::take(py::handle given, Layout layout) {
  const auto& api = py::detail::npy_api::get();
  if (!api.PyArray_Check_(given.ptr())) return false;
  const auto* array = py::detail::array_proxy(given.ptr());
  const auto* type = py::detail::array_descriptor_proxy(array->descr);
  if (type->type_num != npy_double || type->byteorder == '>') return false;
  const bool rows = (array->flags & py::detail::npy_api::NPY_ARRAY_C_CONTIGUOUS_) != 0;
  const bool columns = (array->flags & py::detail::npy_api::NPY_ARRAY_F_CONTIGUOUS_) != 0;
  if ((array->flags & py::detail::npy_api::NPY_ARRAY_ALIGNED_) == 0) return false;
  if (!rows && (layout != Layout::rows_or_columns || !columns)) return false;
  owner_ = py::reinterpret_borrow<py::object>(given);
  data_ = reinterpret_cast<const double*>(array->data);
  dimensions_ = array->nd;
  shape_ = array->dimensions;
  by_columns_ = !rows;
  return true;
}

py::ssize_t Numbers::size() const noexcept {
  py::ssize_t count = 1;
  for (py::ssize_t i = 0; i < dimensions_; ++i) count *= shape_[i];
  return count;
}

const Numbers& Numbers::require_vector(py::ssize_t expected) const {
  if (dimensions_ != 1 || shape_[0] != expected)
    refuse(function_, argument_,
           fmt::format("shape {}, expected ({},)", describe_shape(array()), expected));
  return *this;
}

const Numbers& Numbers::require_rows(py::ssize_t columns) const {
  if (dimensions_ != 2 || shape_[1] != columns)
    refuse(function_, argument_,
           fmt::format("shape {}, expected (N, {})", describe_shape(array()), columns));
  return *this;
}

FiniteRows::FiniteRows(std::string_view function, std::string_view argument, py::handle given,
                       py::ssize_t columns)
    : numbers_(function, argument, given), columns_(columns) {
  if (single())
    numbers_.require_vector(columns);
  else
    numbers_.require_rows(columns);
  if (!numbers_.vector().allFinite()) refuse(function, argument, "is not finite");
}

Eigen::VectorXd vector_of(std::string_view function, std::string_view argument, py::handle given,
                          py::ssize_t size) {
  return Numbers(function, argument, given).require_vector(size).vector();
}

Eigen::VectorXd optional_vector(std::string_view function, std::string_view argument,
                                py::handle given, py::ssize_t size) {
  if (given.is_none()) return {};
  return vector_of(function, argument, given, size);
}

Eigen::Vector3d vector3_of(std::string_view function, std::string_view argument, py::handle given) {
  return vector_of(function, argument, given, 3);
}

geometry::SE3 pose_of(std::string_view function, std::string_view argument, py::handle given) {
  if (given.is_none()) return {};
  const Numbers numbers(function, argument, given);
  if (numbers.dimensions() != 2 || numbers.extent(0) != 4 || numbers.extent(1) != 4)
    refuse(function, argument,
           fmt::format("shape {}, expected a homogeneous matrix (4, 4)",
                       describe_shape(numbers.array())));
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  const Eigen::Vector3d p = matrix.topRightCorner<3, 1>();
  const bool is_rotation = matrix.allFinite() &&
                           (R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < 1e-9 &&
                           R.determinant() > 0.0;
  if (!is_rotation || matrix.row(3) != Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0))
    refuse(function, argument, "is not a pose, expected [[R, p], [0, 1]] with a rotation R");
  return {R, p};
}

py::array_t<double> new_array(std::span<const py::ssize_t> shape) {
  const auto& api = py::detail::npy_api::get();
  PyObject* const array = api.PyArray_NewFromDescr_(
      api.PyArray_Type_, api.PyArray_DescrFromType_(npy_double), static_cast<int>(shape.size()),
      shape.data(), nullptr, nullptr, 0, nullptr);
  if (array == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::array_t<double>>(array);
}

py::array_t<double> to_array(const Eigen::VectorXd& x) {
  auto array = new_array({x.size()});
  if (x.size() > 0)
    std::memcpy(array.mutable_data(), x.data(),
                sizeof(double) * static_cast<std::size_t>(x.size()));
  return array;
}

py::array_t<double> to_array(const Eigen::Vector3d& x) {
  auto array = new_array({3});
  std::memcpy(array.mutable_data(), x.data(), 3 * sizeof(double));
  return array;
}

py::array_t<double> to_array(const Eigen::MatrixXd& x) {
  auto array = new_array({x.rows(), x.cols()});
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      array.mutable_data(), x.rows(), x.cols()) = x;
  return array;
}

py::array_t<double> to_array(const geometry::SE3& pose) {
  return to_array(Eigen::MatrixXd(pose.matrix()));
}

py::object number_or_array(bool single, const py::array_t<double>& numbers) {
  if (single) return py::float_(*numbers.data());
  return numbers;
}

py::object to_python(const Json& json) {
  switch (json.type()) {
    case Json::value_t::object: {
      py::dict out;
      for (const auto& [key, value] : json.items()) out[py::str(key)] = to_python(value);
      return out;
    }
    case Json::value_t::array: {
      py::list out(json.size());
      for (std::size_t i = 0; i < json.size(); ++i) out[i] = to_python(json[i]);
      return out;
    }
    case Json::value_t::string: {
      const auto& text = json.get_ref<const std::string&>();
      PyObject* const decoded =
          PyUnicode_DecodeUTF8(text.data(), static_cast<py::ssize_t>(text.size()), "replace");
      if (decoded == nullptr) throw py::error_already_set();
      return py::reinterpret_steal<py::object>(decoded);
    }
    case Json::value_t::boolean:
      return py::bool_(json.get<bool>());
    case Json::value_t::number_integer:
      return py::int_(json.get<std::int64_t>());
    case Json::value_t::number_unsigned:
      return py::int_(json.get<std::uint64_t>());
    case Json::value_t::number_float:
      return py::float_(json.get<double>());
    default:
      return py::none();
  }
}

namespace {

Json json_of(py::handle object, int depth);

std::string text_of(py::handle object) {
  py::ssize_t size = 0;
  const char* const text = PyUnicode_AsUTF8AndSize(object.ptr(), &size);
  if (text == nullptr) throw py::error_already_set();
  return {text, static_cast<std::size_t>(size)};
}

Json integer(py::handle object) {
  int overflow = 0;
  const long long value = PyLong_AsLongLongAndOverflow(object.ptr(), &overflow);
  if (overflow == 0) {
    if (value == -1 && PyErr_Occurred() != nullptr) throw py::error_already_set();
    return value < 0 ? Json(value) : Json(static_cast<std::uint64_t>(value));
  }
  const unsigned long long large = PyLong_AsUnsignedLongLong(object.ptr());
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  return Json(large);
}

// A value without JSON; its place is completed on the way up.
struct NoJson {
  bool wrong_type;
  std::string text, place;
};

// Calls f, whose exceptions get the place `key`.
template <class F>
Json at_place(const F& f, const std::string& key) {
  try {
    return f();
  } catch (NoJson& e) {
    e.place.insert(0, "/" + key);
    throw;
  }
}

Json sequence(py::handle object, int depth) {
  Json out = Json::array();
  for (const auto& item : py::reinterpret_borrow<py::object>(object))
    out.push_back(at_place([&] { return json_of(item, depth); }, fmt::format("{}", out.size())));
  return out;
}

Json json_of(py::handle object, int depth) {
  if (depth > 100) throw Error(ErrorCode::usage, "JSON: nested deeper than 100 levels");
  if (object.is_none()) return nullptr;
  if (PyBool_Check(object.ptr()) != 0) return object.ptr() == Py_True;
  if (PyUnicode_Check(object.ptr()) != 0) return text_of(object);
  if (PyLong_Check(object.ptr()) != 0) return integer(object);
  if (PyFloat_Check(object.ptr()) != 0) {
    const double value = PyFloat_AsDouble(object.ptr());
    if (!std::isfinite(value))
      throw NoJson{false, fmt::format("{}, expected a finite number", value), ""};
    return value;
  }
  if (PyDict_Check(object.ptr()) != 0) {
    Json out = Json::object();
    for (const auto& [key, value] : py::reinterpret_borrow<py::dict>(object)) {
      if (PyUnicode_Check(key.ptr()) == 0) throw py::type_error("JSON: a key is not a str");
      const std::string name = text_of(key);
      out[name] = at_place([&, &member = value] { return json_of(member, depth + 1); }, name);
    }
    return out;
  }
  if (PyList_Check(object.ptr()) != 0 || PyTuple_Check(object.ptr()) != 0)
    return sequence(object, depth + 1);
  if (py::hasattr(object, "tolist")) return json_of(object.attr("tolist")(), depth + 1);
  if (py::hasattr(object, "__fspath__")) return text_of(object.attr("__fspath__")());
  throw NoJson{true,
               fmt::format("{}, expected dict, list, str, float, int, bool, None or an array",
                           py::str(py::type::of(object).attr("__name__")).cast<std::string>()),
               ""};
}

}  // namespace

Json to_json(py::handle object) {
  try {
    return json_of(object, 0);
  } catch (const NoJson& e) {
    const std::string text = fmt::format("{}: {}", e.place.empty() ? "/" : e.place, e.text);
    if (e.wrong_type) throw py::type_error(text);
    throw Error(ErrorCode::usage, text);
  }
}

std::filesystem::path path_of(py::handle given) {
  PyObject* bytes = nullptr;
  if (PyUnicode_FSConverter(given.ptr(), &bytes) == 0) throw py::error_already_set();
  const auto owner = py::reinterpret_steal<py::object>(bytes);
  return std::string(PyBytes_AsString(bytes), static_cast<std::size_t>(PyBytes_Size(bytes)));
}

std::optional<std::filesystem::path> optional_path(py::handle given) {
  if (given.is_none()) return std::nullopt;
  return path_of(given);
}

std::vector<std::filesystem::path> paths_of(py::handle given) {
  if (given.is_none()) return {};
  if (PyList_Check(given.ptr()) == 0 && PyTuple_Check(given.ptr()) == 0) return {path_of(given)};
  std::vector<std::filesystem::path> paths;
  for (const auto& item : given) paths.push_back(path_of(item));
  return paths;
}

}  // namespace hamelin::python
