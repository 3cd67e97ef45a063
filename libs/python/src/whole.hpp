#pragma once
#include <pybind11/pybind11.h>

#include <cstddef>
#include <memory>
#include <utility>

namespace hamelin::python {

/// A base of all types that Python sees. pybind11 allocates an object that was made without
/// __init__, by Type.__new__(Type), when it is first used, and would pass memory without an object.
/// Here that raises TypeError; objects are made by std::make_shared, which does not ask.
struct Whole {
  static void* operator new(std::size_t /*size*/) {
    throw pybind11::type_error("the object was not initialised, expected one made by hamelin");
  }
  static void* operator new(std::size_t /*size*/, void* place) noexcept { return place; }
  static void operator delete(void* /*memory*/) noexcept {}
  static void operator delete(void* /*memory*/, void* /*place*/) noexcept {}
};

/// A value of the libraries as such a type.
template <class T>
struct Boxed : T, Whole {
  explicit Boxed(T value) : T(std::move(value)) {}
  using Whole::operator new;
  using Whole::operator delete;
};

template <class T>
[[nodiscard]] std::shared_ptr<Boxed<T>> boxed(T value) {
  return std::make_shared<Boxed<T>>(std::move(value));
}

}  // namespace hamelin::python
