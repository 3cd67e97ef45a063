#pragma once
#include <Eigen/Core>
#include <type_traits>

#include "hamelin/geometry/eigen_alignment.hpp"

namespace hamelin::dynamics {

namespace detail {

template <class Derived>
inline constexpr bool has_memory = (static_cast<unsigned>(Derived::Flags) & Eigen::DirectAccessBit) != 0;

/// Whether Eigen::Ref<const Plain> would copy it, though it lies in memory: its numbers are not side by side as Plain's
/// are, as in a row of a column-major matrix.
template <class Derived, class Plain>
inline constexpr bool is_strided = has_memory<Derived> &&
                                   (Derived::InnerStrideAtCompileTime != 1 ||
                                    (!Plain::IsVectorAtCompileTime &&
                                     static_cast<bool>(Derived::IsRowMajor) != static_cast<bool>(Plain::IsRowMajor)));

template <class Derived, class Plain>
inline constexpr bool fits = std::is_same_v<typename Derived::Scalar, typename Plain::Scalar> &&
                             (static_cast<int>(Derived::ColsAtCompileTime) ==
                                  static_cast<int>(Plain::ColsAtCompileTime) ||
                              !Plain::IsVectorAtCompileTime);

}  // namespace detail

/// An argument that is read. Vectors, segments, maps and columns are taken where they lie, without a copy; an
/// expression such as `q + h * v` is evaluated first, as for `const VectorXd&`. What Eigen::Ref would copy silently (a
/// row of a column-major matrix, a map with a stride) does not compile: write `.eval()`, so that the copy is seen.
template <class Plain>
class ConstRef : public Eigen::Ref<const Plain> {
 public:
  template <class Derived>
  requires(detail::fits<Derived, Plain> && !detail::is_strided<Derived, Plain>)
      ConstRef(const Eigen::DenseBase<Derived>& x)  // NOLINT(google-explicit-constructor)
      : Eigen::Ref<const Plain>(x.derived()) {}

  /// Strided: write `.eval()`.
  template <class Derived>
  requires(detail::fits<Derived, Plain>&& detail::is_strided<Derived, Plain>)
      ConstRef(const Eigen::DenseBase<Derived>& x)
  = delete;
};

/// A joint vector that is read.
using ConstVectorRef = ConstRef<Eigen::VectorXd>;
/// A joint vector that is written: a vector, segment, map or column of the right size; it is never resized.
using VectorRef = Eigen::Ref<Eigen::VectorXd>;

}  // namespace hamelin::dynamics
