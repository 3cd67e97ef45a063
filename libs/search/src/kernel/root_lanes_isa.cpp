// Compiled once for each instruction set, without fused multiply-add: all instruction sets give the
// same bits.
#include "root_lanes.hpp"

#include "frames.hpp"

namespace hamelin::search::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

namespace {

constexpr float rotation_length = 0.25F;  // makes a rotation comparable with a displacement [m]
constexpr float root_damping = 1e-4F;     // added to J Jᵀ [m²]
constexpr float largest_step = 0.3F;      // of any joint [rad or m]
constexpr float tiny = 1e-20F;            // keeps roots and quotients finite

HAMELIN_INLINE Reals dot(const Point& a, const Point& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
HAMELIN_INLINE Point point(const float (&from)[3][lanes]) {
  return {load(from[0]), load(from[1]), load(from[2])};
}
HAMELIN_INLINE Reals choose(unsigned bits, const Reals& a, const Reals& b) {
  alignas(64) float x[lanes], y[lanes];
  store(a, x);
  store(b, y);
  for (unsigned l = 0; l < lanes; ++l)
    if ((bits >> l & 1U) == 0) x[l] = y[l];
  return load(x);
}

class Solve {
 public:
  HAMELIN_INLINE Solve(const Chain& chain, const RootTargets& targets, RootPostures& postures)
      : chain_(chain), targets_(targets), postures_(postures) {}

  unsigned run(int steps) {
    for (int i = 0;; ++i) {
      place();
      const unsigned near = measure();
      if (near == all_lanes || i == steps) return near;
      set_jacobian();
      set_weights();
      move(near);
    }
  }

 private:
  // Directions and origins of the joints, and the frame of the tip.
  void place() {
    Frame f = root_frame(chain_);
    for (int j = 0; j <= targets_.tip_link; ++j) {
      axes_[j] = next_frame(f, chain_.joints[j], load(postures_.q[j]));
      origins_[j] = f.p;
    }
    tip_ = {combine(f, targets_.tip_x), combine(f, targets_.tip_y), combine(f, targets_.tip_z),
            transform(f, targets_.tip_p)};
  }

  // The error y of (15.16). Beyond 90° a rotation counts as one of 1.7 rad: steps are short anyway.
  unsigned measure() {
    const Point way = point(targets_.p) - tip_.p;
    error_[3] = way.x;
    error_[4] = way.y;
    error_[5] = way.z;
    const unsigned near = below(square(way), splat(targets_.reach_m * targets_.reach_m));
    if (!targets_.turns) {
      error_[0] = error_[1] = error_[2] = splat(0.0F);
      return near;
    }
    const Point x = point(targets_.x), y = point(targets_.y), z = point(targets_.z);
    const Point twice = cross(tip_.x, x) + cross(tip_.y, y) + cross(tip_.z, z);  // 2 sin · axis
    const Reals cosine = (dot(tip_.x, x) + dot(tip_.y, y) + dot(tip_.z, z) - 1.0F) * 0.5F,
                sine = sqrt(square(twice) + tiny) * 0.5F;
    const unsigned beyond = below(cosine, splat(0.0F));
    const Reals angle_of_sine =
        choose(beyond, splat(0.85F) / max(sine, splat(0.05F)), sine * sine * 0.15F + 0.5F) *
        rotation_length;
    error_[0] = twice.x * angle_of_sine;
    error_[1] = twice.y * angle_of_sine;
    error_[2] = twice.z * angle_of_sine;
    return near & below(sine, splat(targets_.reach_sine)) & ~beyond;
  }

  void set_jacobian() {
    const float length = targets_.turns ? rotation_length : 0.0F;
    const Point none{splat(0.0F), splat(0.0F), splat(0.0F)};
    for (int j = 0; j <= targets_.tip_link; ++j) {
      const bool slides = chain_.joints[j].turn == 0.0F;
      const Point turn = slides ? none : axes_[j] * length;
      const Point way = slides ? axes_[j] : cross(axes_[j], tip_.p - origins_[j]);
      const Reals* const rows[6] = {&turn.x, &turn.y, &turn.z, &way.x, &way.y, &way.z};
      for (int i = 0; i < 6; ++i) jacobian_[i][j] = *rows[i];
    }
  }

  // (J Jᵀ + damping)⁻¹ y by Cholesky's method. The diagonal of the factor is kept inverted.
  void set_weights() {
    Reals factor[6][6];
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k <= i; ++k) {
        Reals sum = splat(i == k ? root_damping : 0.0F);
        for (int j = 0; j <= targets_.tip_link; ++j) sum = sum + jacobian_[i][j] * jacobian_[k][j];
        for (int m = 0; m < k; ++m) sum = sum - factor[i][m] * factor[k][m];
        factor[i][k] =
            i == k ? splat(1.0F) / sqrt(max(sum, splat(0.1F * root_damping))) : sum * factor[k][k];
      }
    for (int i = 0; i < 6; ++i) {
      Reals sum = error_[i];
      for (int m = 0; m < i; ++m) sum = sum - factor[i][m] * weights_[m];
      weights_[i] = sum * factor[i][i];
    }
    for (int i = 5; i >= 0; --i) {
      Reals sum = weights_[i];
      for (int m = i + 1; m < 6; ++m) sum = sum - factor[m][i] * weights_[m];
      weights_[i] = sum * factor[i][i];
    }
  }

  // Lanes that are near enough stay.
  void move(unsigned near) {
    Reals steps[joints_max], largest = splat(tiny);
    for (int j = 0; j <= targets_.tip_link; ++j) {
      steps[j] = splat(0.0F);
      for (int i = 0; i < 6; ++i) steps[j] = steps[j] + jacobian_[i][j] * weights_[i];
      largest = max(largest, magnitude(steps[j]));
    }
    const Reals share = choose(near, splat(0.0F), min(splat(1.0F), splat(largest_step) / largest));
    for (int j = 0; j <= targets_.tip_link; ++j)
      store(clamp(load(postures_.q[j]) + steps[j] * share, postures_.lower[j], postures_.upper[j]),
            postures_.q[j]);
  }

  const Chain& chain_;
  const RootTargets& targets_;
  RootPostures& postures_;
  Point axes_[joints_max], origins_[joints_max];
  Frame tip_;
  Reals error_[6], weights_[6], jacobian_[6][joints_max];
};

unsigned advance(const Chain& chain, const RootTargets& targets, RootPostures& postures,
                 int steps) noexcept {
  return Solve(chain, targets, postures).run(steps);
}

}  // namespace

extern const RootKernels root_kernels;
constexpr RootKernels root_kernels{advance};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::search::kernel
