#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

/// Views of numbers and structs in C arrays, which own nothing.
namespace hamelin::planning {

using ConstVectorMap = Eigen::Map<const Eigen::VectorXd>;
using VectorMap = Eigen::Map<Eigen::VectorXd>;

/// Converts three numbers of a C struct to a vector.
[[nodiscard]] inline Eigen::Vector3d vec3(const double (&x)[3]) {
  return {x[0], x[1], x[2]};
}

/// An array of C structs whose elements lie `stride` bytes apart, which may be more or less than
/// sizeof(T) if the other side of the interface was built with another header. Fields that were
/// appended to T after version 4 need a check by has_field().
template <class T>
class StridedArray {
 public:
  StridedArray() = default;
  StridedArray(const T* first, std::size_t count, std::size_t stride)
      : first_(reinterpret_cast<const std::byte*>(first)), count_(count), stride_(stride) {}
  /// A view of this side's own array.
  StridedArray(std::span<const T> all)  // NOLINT(google-explicit-constructor): as std::span has
      : StridedArray(all.data(), all.size(), sizeof(T)) {}
  StridedArray(const std::vector<T>& all)  // NOLINT(google-explicit-constructor)
      : StridedArray(std::span<const T>(all)) {}

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept {
    return *reinterpret_cast<const T*>(first_ + i * stride_);
  }
  [[nodiscard]] const T& front() const noexcept { return (*this)[0]; }
  /// Whether the elements reach to the end of a field: has_field(offsetof(T, f), sizeof(T::f)).
  [[nodiscard]] bool has_field(std::size_t offset, std::size_t size) const noexcept {
    return stride_ >= offset + size;
  }

  class Iterator {
   public:
    using value_type = T;
    using difference_type = std::ptrdiff_t;
    Iterator() = default;
    Iterator(const std::byte* at, std::size_t stride) : at_(at), stride_(stride) {}
    const T& operator*() const { return *reinterpret_cast<const T*>(at_); }
    const T* operator->() const { return &**this; }
    Iterator& operator++() {
      at_ += stride_;
      return *this;
    }
    Iterator operator++(int) {
      const Iterator before = *this;
      ++*this;
      return before;
    }
    bool operator==(const Iterator& other) const { return at_ == other.at_; }

   private:
    const std::byte* at_ = nullptr;
    std::size_t stride_ = sizeof(T);
  };
  [[nodiscard]] Iterator begin() const { return {first_, stride_}; }
  [[nodiscard]] Iterator end() const { return {first_ + count_ * stride_, stride_}; }

 private:
  const std::byte* first_ = nullptr;
  std::size_t count_ = 0, stride_ = sizeof(T);
};

}  // namespace hamelin::planning
