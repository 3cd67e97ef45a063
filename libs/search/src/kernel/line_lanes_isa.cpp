// Compiled once for each instruction set, without fused multiply-add: all instruction sets give the
// same bits.
#include "line_lanes.hpp"

#include "frames.hpp"

namespace hamelin::search::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

namespace {

/// Frame of a link, its angular velocity w per unit of s, and the velocity v of its point at the
/// origin.
struct Pose : Frame {
  Point w, v;
};
static_assert(sizeof(Pose) == sizeof(float) * Scratch::pose_floats);

HAMELIN_INLINE Reals speed(const Pose& f, const Point& p) {
  return sqrt(square(f.v + cross(f.w, p)));
}

// Poses of all links at q = start + s step, with their velocities: (17.10).
void place_links(const Chain& chain, const Line& line, const Batch& batch, Scratch& scratch) {
  const Reals s = load(batch.s);
  const float zero[3] = {};
  Pose f{root_frame(chain), splat(zero), splat(zero)};
  for (int j = 0; j < chain.dof; ++j) {
    const Joint& joint = chain.joints[j];
    const float step = line.step[j];
    const Point axis = next_frame(f, joint, s * step + line.start[j]);
    if (joint.turn == 0.0F) {
      f.v = f.v + axis * step;
    } else {
      f.w = f.w + axis * step;
      f.v = f.v + cross(f.p, axis) * step;
    }
    __builtin_memcpy(scratch.poses[j], &f, sizeof f);
  }
}

/// A position in a field, in nodes, moved into the box of the nodes, and what its nearest node
/// says.
struct Cell {
  Reals f[3];
  Reals node;  ///< distance of the nearest node from the map [m]
};

HAMELIN_INLINE Ints index(const Field& field, const Reals& x, const Reals& y, const Reals& z) {
  const Ints a = to_int(x), b = to_int(y), c = to_int(z);
  Ints out;
  HAMELIN_EACH(out, (c.v[i] * field.count[1] + b.v[i]) * field.count[0] + a.v[i]);
  return out;
}

HAMELIN_INLINE Reals look_up(const Field& field, const Ints& at) {
  alignas(64) std::int32_t index[lanes];
  __builtin_memcpy(index, &at, sizeof index);
  Ints out;
  alignas(64) std::int32_t values[lanes];
  for (int l = 0; l < lanes; ++l) values[l] = field.values[index[l]];
  __builtin_memcpy(&out, values, sizeof out);
  return to_real(out);
}

// The values at a node and at the next one along x.
HAMELIN_INLINE void look_up_two(const Field& field, const Ints& at, Reals& first, Reals& second) {
  alignas(64) std::int32_t index[lanes];
  __builtin_memcpy(index, &at, sizeof index);
  alignas(64) std::uint32_t values[lanes];
  for (int l = 0; l < lanes; ++l)
    __builtin_memcpy(&values[l], field.values + index[l], sizeof values[l]);
  Ints both, low, high;
  __builtin_memcpy(&both, values, sizeof both);
  HAMELIN_EACH(low, both.v[i] & 0xffff);
  HAMELIN_EACH(high, (both.v[i] >> 16) & 0xffff);
  first = to_real(low);
  second = to_real(high);
}

// (17.7), (17.9)
HAMELIN_INLINE Reals bound_by_node(const Field& field, const Point& p, Cell& cell) {
  const Reals* const at[3] = {&p.x, &p.y, &p.z};
  Reals nearest[3], apart = splat(0.0F);
  for (int k = 0; k < 3; ++k) {
    cell.f[k] = clamp(*at[k] * field.inverse + field.offset[k], 0.0F,
                      static_cast<float>(field.count[k] - 1));
    nearest[k] = round(cell.f[k]);
    const Reals t = cell.f[k] - nearest[k];
    apart = apart + t * t;
  }
  cell.node = look_up(field, index(field, nearest[0], nearest[1], nearest[2])) * field.unit;
  return cell.node - sqrt(apart) * field.resolution;
}

// Of p itself, which may be outside of the box of the nodes, from the nearest node [m].
HAMELIN_INLINE Reals distance_from_node(const Field& field, const Point& p, const Cell& cell) {
  const Reals* const at[3] = {&p.x, &p.y, &p.z};
  Reals apart = splat(0.0F);
  for (int k = 0; k < 3; ++k) {
    const Reals t = *at[k] * field.inverse + field.offset[k] - round(cell.f[k]);
    apart = apart + t * t;
  }
  return sqrt(apart) * field.resolution;
}

// (17.8), or −1 where a voxel is too near
HAMELIN_INLINE Reals bound_by_cell(const Field& field, const Cell& cell) {
  Reals low[3], t[3], bend = splat(0.0F);
  for (int k = 0; k < 3; ++k) {
    low[k] = min(floor(cell.f[k]), splat(static_cast<float>(field.count[k] - 2)));
    t[k] = cell.f[k] - low[k];
    bend = bend + t[k] * (splat(1.0F) - t[k]);
  }
  const Ints base = index(field, low[0], low[1], low[2]);
  Reals least = splat(65535.0F);
  const auto along_x = [&](int offset) __attribute__((always_inline)) {
    Ints at;
    HAMELIN_EACH(at, base.v[i] + offset);
    Reals first, second;
    look_up_two(field, at, first, second);
    least = min(least, min(first, second));
    return first + t[0] * (second - first);
  };
  const int row = field.count[0], plane = row * field.count[1];
  const Reals a = along_x(0), b = along_x(row), c = along_x(plane), d = along_x(plane + row);
  const Reals front = a + t[1] * (b - a), back = c + t[1] * (d - c);
  const Reals interpolated = (front + t[2] * (back - front)) * field.unit;
  const float half_diagonal = 0.8660255F * field.resolution;
  const float least_delta = 0.3F * field.resolution;
  const Reals delta = least * field.unit - half_diagonal;
  const Reals bound = interpolated - bend * (0.5F * field.resolution * field.resolution) /
                                         max(delta, splat(least_delta));
  Reals out;
  HAMELIN_EACH(out, delta.v[i] < least_delta ? Native{} - 1.0F : bound.v[i]);
  return out;
}

// Distance from an obstacle, negative or zero inside of it.
HAMELIN_INLINE Reals distance(const Primitive& primitive, const Point& p) {
  const Point off = p - splat(primitive.center);
  Reals local[3];
  for (int k = 0; k < 3; ++k)
    local[k] =
        off.x * primitive.axes[k][0] + off.y * primitive.axes[k][1] + off.z * primitive.axes[k][2];
  const Reals zero = splat(0.0F);
  Reals sum = zero;
  if (primitive.cylinder) {
    const Reals across =
        max(sqrt(local[0] * local[0] + local[1] * local[1]) - primitive.half[0], zero);
    const Reals along = max(magnitude(local[2]) - primitive.half[2], zero);
    sum = across * across + along * along;
  } else {
    for (int k = 0; k < 3; ++k) {
      const Reals out = max(magnitude(local[k]) - primitive.half[k], zero);
      sum = sum + out * out;
    }
  }
  return sqrt(sum) - primitive.radius;
}

/// One batch of pieces.
class Check {
 public:
  HAMELIN_INLINE Check(const Arm& arm, const World& world, const Line& line, const Batch& batch,
                       Scratch& scratch)
      : arm_(arm), world_(world), line_(line), batch_(batch), scratch_(scratch) {}

  HAMELIN_INLINE bool run() {
    ++scratch_.batch;
    scratch_.open_count = 0;
    place_links(arm_.chain, line_, batch_, scratch_);
    set_margins();
    if (all() && !check_hot()) return false;
    for (int part = 0; part < arm_.part_count && arm_.parts[part].link >= 0; ++part)
      if (!check_part(part)) return false;
    for (int pair = 0; pair < arm_.pair_count; ++pair)
      if (!check_pair(pair)) return false;
    collect();
    return true;
  }

 private:
  [[nodiscard]] HAMELIN_INLINE bool all() const { return batch_.pieces[0] == nullptr; }
  [[nodiscard]] HAMELIN_INLINE const Pose& pose(int link) const {
    return *reinterpret_cast<const Pose*>(scratch_.poses[link]);
  }
  HAMELIN_INLINE Point* centers(int sphere) {
    return reinterpret_cast<Point*>(scratch_.centers[sphere]);
  }
  [[nodiscard]] HAMELIN_INLINE float bend(int part) const {
    return 0.125F * batch_.width * batch_.width * line_.kappa[part];
  }
  // Lanes for which a sphere or pair is to be proved.
  HAMELIN_INLINE unsigned needed(int index, bool pair) const {
    if (all()) return batch_.active;
    unsigned out = 0;
    for (unsigned piece = 0; piece < 4; ++piece) {
      const Open& open = *batch_.pieces[piece];
      const std::uint64_t word = (pair ? open.pairs : open.spheres)[index / 64];
      if ((word >> (static_cast<unsigned>(index) % 64U) & 1U) != 0) out |= 0xfU << (4U * piece);
    }
    return out & batch_.active;
  }

  // (17.1) in the middle of each piece, and the largest on it, (17.12)
  void set_margins() {
    margin_ = largest_margin_ = splat(line_.full_margin);
    const Reals s = load(batch_.s);
    const float half = 0.5F * batch_.width * line_.weighted_length + line_.distance_slack;
    for (int k = 0; k < line_.place_count; ++k) {
      const Place& place = line_.places[k];
      Reals sum = splat(0.0F);
      for (int j = 0; j < arm_.chain.dof; ++j) {
        const Reals x = s * line_.weighted_step[j] + place.apart[j];
        sum = sum + x * x;
      }
      const Reals distance = sqrt(sum);
      const float rise = line_.full_margin - place.margin;
      const auto margin = [&](const Reals& at) __attribute__((always_inline)) {
        return clamp((at - place.near) * place.inverse_range, 0.0F, 1.0F) * rise + place.margin;
      };
      margin_ = min(margin_, margin(distance));
      largest_margin_ = min(largest_margin_, margin(distance + half));
    }
  }

  HAMELIN_INLINE void mark(std::uint64_t (&words)[lanes][sphere_words], int index, unsigned bits) {
    any_open_ |= bits;
    for (; bits != 0; bits &= bits - 1U)
      words[__builtin_ctz(bits)][index / 64] |= std::uint64_t{1}
                                                << (static_cast<unsigned>(index) % 64U);
  }

  HAMELIN_INLINE bool reject(int part, int sphere) {
    int at = Scratch::hot_count - 1;
    for (int i = 0; i < Scratch::hot_count; ++i)
      if (scratch_.hot[i].sphere == sphere) {
        at = i;
        break;
      }
    for (; at > 0; --at) scratch_.hot[at] = scratch_.hot[at - 1];
    scratch_.hot[0] = {part, sphere};
    return false;
  }

  bool check_hot() {
    for (int i = 0; i < Scratch::hot_count; ++i) {
      const Hot hot = scratch_.hot[i];
      if (hot.part < 0) break;
      const Pose& f = pose(arm_.parts[hot.part].link);
      if (!check_sphere(hot.part, hot.sphere, transform(f, arm_.spheres[hot.sphere].center),
                        batch_.active, true))
        return false;
    }
    return true;
  }
  HAMELIN_INLINE bool is_hot(int sphere) const {
    for (int i = 0; i < Scratch::hot_count; ++i)
      if (scratch_.hot[i].sphere == sphere) return true;
    return false;
  }

  // Whether the ball of a part is clear of the map, and which obstacles it may touch.
  HAMELIN_INLINE bool ball_clear(int index, std::uint64_t& obstacles) {
    const Part& part = arm_.parts[index];
    const Pose& f = pose(part.link);
    const Point c = transform(f, part.ball.center);
    const Reals stray = (speed(f, c) + sqrt(square(f.w)) * part.spread + 2.0F * line_.speed_slack) *
                            (0.5F * batch_.width) +
                        bend(index);
    const Reals keep = largest_margin_ + stray + part.ball.radius;
    obstacles = 0;
    for (int k = 0; k < world_.primitive_count; ++k) {
      const Primitive& primitive = world_.primitives[k];
      const Reals reach = keep + (primitive.ball + primitive.slack);
      if ((below(square(c - splat(primitive.center)), reach * reach) & batch_.active) != 0)
        obstacles |= std::uint64_t{1} << static_cast<unsigned>(k);
    }
    if (world_.field.count[0] == 0) return true;
    Cell cell;
    const Reals low = bound_by_node(world_.field, c, cell);
    return (below(low, keep + world_.map_slack) & batch_.active) == 0;
  }

  bool check_part(int index) {
    const Part& part = arm_.parts[index];
    std::uint64_t obstacles = ~std::uint64_t{0};
    bool map = true;
    if (all() && part.count > 1) {
      map = !ball_clear(index, obstacles);
      if (!map && obstacles == 0) return true;
    }
    obstacles_ = obstacles;
    const Pose& f = pose(part.link);
    for (int sphere = part.first; sphere < part.first + part.count; ++sphere) {
      const unsigned lanes_needed = needed(sphere, false);
      if (lanes_needed == 0 || (all() && is_hot(sphere))) continue;
      if (!check_sphere(index, sphere, transform(f, arm_.spheres[sphere].center), lanes_needed,
                        map))
        return false;
    }
    obstacles_ = ~std::uint64_t{0};
    return true;
  }

  // (17.11)
  bool check_sphere(int part, int index, const Point& c, unsigned need, bool map) {
    const Sphere& sphere = arm_.spheres[index];
    const Pose& f = pose(arm_.parts[part].link);
    const Reals stray = (speed(f, c) + line_.speed_slack) * (0.5F * batch_.width) + bend(part);
    const Reals keep = largest_margin_ + sphere.radius, touch = margin_ + sphere.inner;
    unsigned open = 0;
    for (int k = 0; k < world_.primitive_count; ++k) {
      if ((obstacles_ >> static_cast<unsigned>(k) & 1U) == 0) continue;
      const Reals d = distance(world_.primitives[k], c);
      const Reals all = keep + stray + world_.primitives[k].slack;
      const unsigned near = below(d, all) & need;
      if (near == 0) continue;
      if ((below(d, touch) & near) != 0) return reject(part, index);
      open |= near;
    }
    if (map && world_.field.count[0] != 0) {
      Cell cell;
      const Reals low = bound_by_node(world_.field, c, cell);
      const Reals keep_map = keep + world_.map_slack;
      const unsigned near = below(low, keep_map + stray) & need;
      if (near != 0 && !check_near(part, index, c, cell, low, keep_map, touch, stray, near, open))
        return false;
    }
    if (open != 0) mark(open_spheres_, index, open);
    return true;
  }

  // Where the nearest node does not prove a sphere: its cell, then the map itself.
  bool check_near(int part, int index, const Point& c, const Cell& cell, Reals low,
                  const Reals& keep, const Reals& touch, const Reals& stray, unsigned near,
                  unsigned& open) {
    const Reals high = cell.node + distance_from_node(world_.field, c, cell) + world_.field.unit;
    if ((below(high, touch) & near) != 0) return reject(part, index);
    low = max(low, bound_by_cell(world_.field, cell));
    const unsigned doubtful = below(low, keep) & near;
    if (doubtful != 0) {
      alignas(64) float x[lanes], y[lanes], z[lanes], d[lanes], limit[lanes], least[lanes];
      store(c.x, x);
      store(c.y, y);
      store(c.z, z);
      store(low, d);
      store(keep + stray, limit);
      store(touch, least);
      for (unsigned rest = doubtful; rest != 0; rest &= rest - 1U) {
        const int l = __builtin_ctz(rest);
        const float p[3] = {x[l], y[l], z[l]};
        const double exact =
            scratch_.exact(scratch_.context, index, p, static_cast<double>(limit[l]) * 1.000001);
        if (exact < static_cast<double>(least[l])) return reject(part, index);
        d[l] = static_cast<float>(exact) * 0.9999999F;
      }
      low = load(d);
    }
    open |= below(low, keep + stray) & near;
    return true;
  }

  HAMELIN_INLINE Point ball_center(const Part& part) const {
    return part.link < 0 ? splat(part.ball.center) : transform(pose(part.link), part.ball.center);
  }
  // Places the spheres of a part, once in a batch.
  void place(int index) {
    const Part& part = arm_.parts[index];
    if (scratch_.placed[index] == scratch_.batch) return;
    scratch_.placed[index] = scratch_.batch;
    for (int i = part.first; i < part.first + part.count; ++i)
      *centers(i) = part.link < 0 ? splat(arm_.spheres[i].center)
                                  : transform(pose(part.link), arm_.spheres[i].center);
  }

  // (17.4) in the lanes
  bool check_pair(int index) {
    unsigned need = needed(index, true);
    if (need == 0) return true;
    const Pair& pair = arm_.pairs[index];
    const Part &a = arm_.parts[pair.part_a], &b = arm_.parts[pair.part_b];
    const Reals most = splat(line_.self_most), margin = min(margin_, most);
    const Reals keep =
        min(largest_margin_, most) + (0.5F * batch_.width * line_.way[index] + world_.pair_slack);
    const Point ball_b = ball_center(b);
    const Reals both = keep + (a.ball.radius + b.ball.radius);
    need &= below(square(ball_center(a) - ball_b), both * both);
    if (need == 0) return true;
    place(pair.part_a);
    place(pair.part_b);
    unsigned open = 0;
    for (int i = a.first; i < a.first + a.count; ++i) {
      const Point c = *centers(i);
      const Sphere& sphere = arm_.spheres[i];
      const Reals reach = keep + (sphere.radius + b.ball.radius);
      const unsigned inside = below(square(c - ball_b), reach * reach) & need;
      if (inside == 0) continue;
      for (int j = b.first; j < b.first + b.count; ++j) {
        const Reals apart = square(c - *centers(j));
        const Reals far = keep + (sphere.radius + arm_.spheres[j].radius);
        const unsigned near = below(apart, far * far) & inside;
        if (near == 0) continue;
        const Reals touch = margin + (sphere.inner + arm_.spheres[j].inner);
        if ((below(apart, touch * touch) & near) != 0) return false;
        open |= near;
      }
    }
    if (open != 0) mark(open_pairs_, index, open);
    return true;
  }

  void collect() {
    if (any_open_ == 0) return;
    alignas(64) float margin[lanes];
    store(largest_margin_, margin);
    for (unsigned rest = any_open_; rest != 0; rest &= rest - 1U) {
      const int l = __builtin_ctz(rest);
      Open& open = scratch_.open[scratch_.open_count++];
      open.s = batch_.s[l];
      open.width = batch_.width;
      open.margin = margin[l];
      for (int i = 0; i < sphere_words; ++i) open.spheres[i] = open_spheres_[l][i];
      for (int i = 0; i < pair_words; ++i) open.pairs[i] = open_pairs_[l][i];
    }
  }

  const Arm& arm_;
  const World& world_;
  const Line& line_;
  const Batch& batch_;
  Scratch& scratch_;
  Reals margin_, largest_margin_;  // in the middle of each piece, and on it
  std::uint64_t obstacles_ = ~std::uint64_t{0};
  unsigned any_open_ = 0;
  std::uint64_t open_spheres_[lanes][sphere_words] = {}, open_pairs_[lanes][sphere_words] = {};
};

bool check(const Arm& arm, const World& world, const Line& line, const Batch& batch,
           Scratch& scratch) noexcept {
  return Check(arm, world, line, batch, scratch).run();
}

void sincos_of(const float* x, float* sine, float* cosine) noexcept {
  Reals s, c;
  sincos(load(x), s, c);
  store(s, sine);
  store(c, cosine);
}

}  // namespace

extern const LineKernels line_kernels;
constexpr LineKernels line_kernels{check, sincos_of};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::search::kernel
