#pragma once
#include <type_traits>

/// For functions that are compiled for several instruction sets in one program. Without forced
/// inlining, the linker could use the copy for one set in the code for another.
#define HAMELIN_INLINE inline __attribute__((always_inline))

/// Small value types for the recursive kernels. They hold scalars S only (a double, or one double
/// per lane of a SIMD register), so they stay in registers. Public interfaces use Eigen types
/// instead.
namespace hamelin::geometry {

template <class S>
struct Vec3 {
  S x, y, z;
};

template <class S>
constexpr HAMELIN_INLINE Vec3<S> operator+(const Vec3<S>& a, const Vec3<S>& b) noexcept {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class S>
constexpr HAMELIN_INLINE Vec3<S> operator-(const Vec3<S>& a, const Vec3<S>& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class S>
constexpr HAMELIN_INLINE Vec3<S> operator*(const Vec3<S>& a,
                                           const std::type_identity_t<S>& k) noexcept {
  return {a.x * k, a.y * k, a.z * k};
}
template <class S>
constexpr HAMELIN_INLINE S dot(const Vec3<S>& a, const Vec3<S>& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class S>
constexpr HAMELIN_INLINE Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Symmetric 3×3 matrix.
template <class S>
struct Sym3 {
  S xx, xy, xz, yy, yz, zz;
};

template <class S>
constexpr HAMELIN_INLINE Sym3<S> operator+(const Sym3<S>& a, const Sym3<S>& b) noexcept {
  return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
}
template <class S>
constexpr HAMELIN_INLINE Vec3<S> operator*(const Sym3<S>& a, const Vec3<S>& b) noexcept {
  return {a.xx * b.x + a.xy * b.y + a.xz * b.z, a.xy * b.x + a.yy * b.y + a.yz * b.z,
          a.xz * b.x + a.yz * b.y + a.zz * b.z};
}
/// a − k u uᵀ.
template <class S>
constexpr HAMELIN_INLINE Sym3<S> minus_outer(const Sym3<S>& a, const Vec3<S>& u,
                                             const std::type_identity_t<S>& k) noexcept {
  const Vec3<S> ku = u * k;
  return {a.xx - ku.x * u.x, a.xy - ku.x * u.y, a.xz - ku.x * u.z,
          a.yy - ku.y * u.y, a.yz - ku.y * u.z, a.zz - ku.z * u.z};
}

/// 3×3 matrix by rows.
template <class S>
struct Mat3 {
  Vec3<S> x, y, z;
};

template <class S>
constexpr HAMELIN_INLINE Mat3<S> operator+(const Mat3<S>& a, const Mat3<S>& b) noexcept {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class S>
constexpr HAMELIN_INLINE Mat3<S> operator-(const Mat3<S>& a, const Mat3<S>& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class S>
constexpr HAMELIN_INLINE Vec3<S> operator*(const Mat3<S>& a, const Vec3<S>& b) noexcept {
  return {dot(a.x, b), dot(a.y, b), dot(a.z, b)};
}
template <class S>
constexpr HAMELIN_INLINE Mat3<S> transpose(const Mat3<S>& a) noexcept {
  return {{a.x.x, a.y.x, a.z.x}, {a.x.y, a.y.y, a.z.y}, {a.x.z, a.y.z, a.z.z}};
}
/// aᵀ b.
template <class S>
constexpr HAMELIN_INLINE Vec3<S> transposed_times(const Mat3<S>& a, const Vec3<S>& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
/// a − u wᵀ.
template <class S>
constexpr HAMELIN_INLINE Mat3<S> minus_outer(const Mat3<S>& a, const Vec3<S>& u,
                                             const Vec3<S>& w) noexcept {
  return {a.x - w * u.x, a.y - w * u.y, a.z - w * u.z};
}
template <class S>
constexpr HAMELIN_INLINE Mat3<S> full(const Sym3<S>& a) noexcept {
  return {{a.xx, a.xy, a.xz}, {a.xy, a.yy, a.yz}, {a.xz, a.yz, a.zz}};
}
/// hat(p) a, with hat(p) x = p × x.
template <class S>
constexpr HAMELIN_INLINE Mat3<S> hat_times(const Vec3<S>& p, const Mat3<S>& a) noexcept {
  return {a.z * p.y - a.y * p.z, a.x * p.z - a.z * p.x, a.y * p.x - a.x * p.y};
}
/// a hat(p).
template <class S>
constexpr HAMELIN_INLINE Mat3<S> times_hat(const Mat3<S>& a, const Vec3<S>& p) noexcept {
  return {cross(a.x, p), cross(a.y, p), cross(a.z, p)};
}

}  // namespace hamelin::geometry
