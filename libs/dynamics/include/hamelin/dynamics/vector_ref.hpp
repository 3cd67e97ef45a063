#pragma once
#include <Eigen/Core>
#include <type_traits>

#include "hamelin/geometry/eigen_alignment.hpp"

namespace hamelin::dynamics {

namespace detail {

template <class Derived>
inline constexpr bool has_memory = (static_cast<unsigned>(Derived::Flags) &
                                    Eigen::DirectAccessBit) != 0;

/// Whether Eigen::Ref<const Plain> would copy the argument although it is in memory, because its
/// numbers are not adjacent as those of Plain are. An example is a row of a column-major matrix.
template <class Derived, class Plain>
inline constexpr bool is_strided = has_memory<Derived> &&
                                   (Derived::InnerStrideAtCompileTime != 1 ||
                                    (!Plain::IsVectorAtCompileTime &&
                                     static_cast<bool>(Derived::IsRowMajor) !=
                                         static_cast<bool>(Plain::IsRowMajor)));

template <class Derived, class Plain>
inline constexpr bool fits = std::is_same_v<typename Derived::Scalar, typename Plain::Scalar> &&
                             (static_cast<int>(Derived::ColsAtCompileTime) ==
                                  static_cast<int>(Plain::ColsAtCompileTime) ||
                              !Plain::IsVectorAtCompileTime);

}  // namespace detail

/// An argument that is read. Vectors, segments, maps and columns are used in place, without a copy;
/// an expression such as `q + h * v` is evaluated first, as for `const VectorXd&`. Arguments that
/// Eigen::Ref would copy silently (a row of a column-major matrix, a map with a stride) do not
/// compile; write `.eval()` to make the copy visible.
template <class Plain>
class ConstRef : public Eigen::Ref<const Plain> {
 public:
  template <class Derived>
  requires(detail::fits<Derived, Plain> && !detail::is_strided<Derived, Plain>)
      ConstRef(const Eigen::DenseBase<Derived>& x)  // NOLINT(google-explicit-constructor)
      : Eigen::Ref<const Plain>(x.derived()) {}

  /// Deleted for strided arguments; write `.eval()`.
  template <class Derived>
  requires(detail::fits<Derived, Plain>&& detail::is_strided<Derived, Plain>)
      ConstRef(const Eigen::DenseBase<Derived>& x)
  = delete;
};

/// A joint vector that is read.
using ConstVectorRef = ConstRef<Eigen::VectorXd>;
/// A joint vector that is written: a vector, segment, map or column of the right size. It is not
/// resized.
using VectorRef = Eigen::Ref<Eigen::VectorXd>;

}  // namespace hamelin::dynamics
