#include "hamelin/scene/distance_field.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/scene/kernel/distance_transform.hpp"
#include "voxel_boxes.hpp"

namespace hamelin::scene {

namespace kernel {
HAMELIN_SELECT_KERNELS(TransformKernels, transform_kernels)
}  // namespace kernel

namespace {

constexpr int cap = DistanceField::cap_voxels;
constexpr double unit_voxels = cap / 65535.0;  // of stored distances
constexpr double bound_rounding = 1e-9;        // in voxels
constexpr std::size_t padding = 2;             // values behind the last one, for wide loads

bool same(const VoxelBox& a, const VoxelBox& b) {
  return a.lo == b.lo && a.hi == b.hi;
}

VoxelBox widened(const VoxelBox& box, std::int32_t by) {
  VoxelBox out = box;
  for (std::size_t i = 0; i < 3; ++i) {
    out.lo[i] -= by;
    out.hi[i] += by;
  }
  return out;
}

// The nodes that are corners of voxels.
VoxelBox corners(const VoxelBox& voxels) {
  VoxelBox out = voxels;
  for (std::int32_t& hi : out.hi) ++hi;
  return out;
}

VoxelBox nodes_around(const VoxelBox& used) {
  return corners(widened(used, DistanceField::pad_voxels));
}

double volume(const VoxelBox& box) {
  double product = 1.0;
  for (std::size_t i = 0; i < 3; ++i)
    product *= static_cast<double>(box.hi[i]) - static_cast<double>(box.lo[i]);
  return product;
}

bool fits(const VoxelBox& used) {
  const double voxels = volume(nodes_around(used));
  return voxels * (sizeof(std::uint16_t) + 0.25) <= static_cast<double>(DistanceField::bytes_max);
}

VoxelBox hull_of(std::span<const VoxelBox> boxes) {
  VoxelBox out;
  for (const VoxelBox& box : boxes) out = hull(out, box);
  return out;
}

/// Squares of distances to the nearest set node along a row, and the stored value of a square.
struct Tables {
  std::array<std::int16_t, 2 * cap + 1> square{};  ///< of |i − cap|
  std::array<std::uint16_t, cap * cap + 1> value{};
  Tables() {
    for (int i = 0; i <= 2 * cap; ++i)
      square[static_cast<std::size_t>(i)] = static_cast<std::int16_t>((i - cap) * (i - cap));
    for (int i = 0; i <= cap * cap; ++i)
      value[static_cast<std::size_t>(i)] =
          static_cast<std::uint16_t>(std::floor(std::sqrt(static_cast<double>(i)) / unit_voxels));
  }
};

const Tables& tables() {
  static const Tables made;
  return made;
}

// Lowers the squares next to a set node to those of the distance from it, up to the next set one.
void write_gap(std::int16_t* row, std::int32_t from, std::int32_t to, bool left, bool right) {
  const auto& square = tables().square;
  const std::int32_t middle = left && right ? from + (to - from) / 2 : left ? to : from;
  for (std::int32_t x = from; x < std::min(middle, from + cap - 1); ++x)
    row[x] = square[static_cast<std::size_t>(cap + x - from + 1)];
  for (std::int32_t x = std::max(middle, to - cap + 1); x < to; ++x)
    row[x] = square[static_cast<std::size_t>(cap + to - x)];
}

/// Squared distances of the nodes of one box from the voxels whose corners are in another one
/// around it, by one pass along each axis: docs/theory.md (17.6).
class Transform {
 public:
  /// @param to at least 16 nodes along x
  Transform(const VoxelGrid& grid, const VoxelBox& from, const VoxelBox& to)
      : grid_(grid),
        from_(from),
        to_(to),
        nx_(extent(to, 0)),
        row_(static_cast<std::size_t>(extent(from, 0))),
        kernels_(kernel::select_transform_kernels(default_isa())) {}

  /// The squares of the nodes of `to`, x first; behind them there is other memory that was used.
  std::vector<std::int16_t> run() {
    const std::int32_t ny = extent(from_, 1), nz = extent(from_, 2), ny_to = extent(to_, 1);
    const std::ptrdiff_t row = nx_, plane = row * ny_to;
    std::vector<std::int16_t> out(static_cast<std::size_t>(plane * nz));
    std::vector<std::int16_t> strip(static_cast<std::size_t>(row * std::max(ny, nz)));
    for (std::int32_t z = 0; z < nz; ++z) {
      for (std::int32_t y = 0; y < ny; ++y)
        along_row(y, z, &strip[static_cast<std::size_t>(y * row)]);
      kernels_.add_axis(strip.data(), out.data() + z * plane, ny, first(1), ny_to, row, row, nx_,
                        cap);
    }
    for (std::int32_t y = 0; y < ny_to; ++y) {
      std::int16_t* const column = out.data() + y * row;
      for (std::int32_t z = 0; z < nz; ++z)
        std::copy_n(column + z * plane, nx_, &strip[static_cast<std::size_t>(z * row)]);
      kernels_.add_axis(strip.data(), column, nz, first(2), extent(to_, 2), row, plane, nx_, cap);
    }
    return out;
  }

 private:
  // Bits of 64 nodes of a row that are corners of occupied voxels.
  [[nodiscard]] std::uint64_t set_nodes(std::int32_t word, std::int32_t y, std::int32_t z) const {
    const auto voxels = [&](std::int32_t w) {
      return grid_.word(w, y, z) | grid_.word(w, y - 1, z) | grid_.word(w, y, z - 1) |
             grid_.word(w, y - 1, z - 1);
    };
    const std::uint64_t here = voxels(word);
    return here | (here << 1U) | (voxels(word - 1) >> 63U);
  }

  void along_row(std::int32_t y, std::int32_t z, std::int16_t* out) {
    const auto count = static_cast<std::int32_t>(row_.size());
    std::int16_t* const row = row_.data();
    std::fill_n(row, count, static_cast<std::int16_t>(cap * cap));
    const std::int32_t shift = from_.lo[0] - grid_.box().lo[0];  // of the row against the grid
    std::int32_t last = -1;                                      // set node
    for (std::int32_t word = shift >> 6; word <= (shift + count - 1) >> 6; ++word)
      for (std::uint64_t bits = set_nodes(word, from_.lo[1] + y, from_.lo[2] + z); bits != 0;
           bits &= bits - 1U) {
        const std::int32_t x = 64 * word + std::countr_zero(bits) - shift;
        if (x < 0 || x >= count) continue;
        write_gap(row, last + 1, x, last >= 0, true);
        row[x] = 0;
        last = x;
      }
    if (last >= 0) write_gap(row, last + 1, count, true, false);
    std::copy_n(row + first(0), nx_, out);
  }

  static std::int32_t extent(const VoxelBox& box, std::size_t axis) {
    return box.hi[axis] - box.lo[axis];
  }
  [[nodiscard]] std::int32_t first(std::size_t axis) const { return to_.lo[axis] - from_.lo[axis]; }

  const VoxelGrid& grid_;
  VoxelBox from_, to_;
  std::int32_t nx_;
  std::vector<std::int16_t> row_;
  const kernel::TransformKernels& kernels_;
};

}  // namespace

VoxelGrid::VoxelGrid(const VoxelBox& box) : box_(box), words_((box.hi[0] - box.lo[0] + 63) / 64) {
  bits_.resize(static_cast<std::size_t>(words_) * static_cast<std::size_t>(box.hi[1] - box.lo[1]) *
               static_cast<std::size_t>(box.hi[2] - box.lo[2]));
}

std::pair<std::int32_t, std::int32_t> VoxelGrid::words_of(const VoxelBox& inside) const {
  return {(inside.lo[0] - box_.lo[0]) / 64, (inside.hi[0] - 1 - box_.lo[0]) / 64};
}

std::uint64_t VoxelGrid::bits_of(const VoxelBox& inside, std::int32_t word) const {
  const std::int32_t from = box_.lo[0] + 64 * word;
  const auto before = static_cast<unsigned>(std::max(0, inside.lo[0] - from)),
             behind = static_cast<unsigned>(std::max(0, from + 64 - inside.hi[0]));
  return (~std::uint64_t{0} << before) & (~std::uint64_t{0} >> behind);
}

template <class Changed>
void VoxelGrid::set(const VoxelBox& voxels, bool occupied, const Changed& changed) {
  const VoxelBox inside = common(voxels, box_);
  if (is_empty(inside)) return;
  const auto [first, last] = words_of(inside);
  for (std::int32_t z = inside.lo[2]; z < inside.hi[2]; ++z)
    for (std::int32_t y = inside.lo[1]; y < inside.hi[1]; ++y)
      for (std::int32_t word = first; word <= last; ++word) {
        const std::uint64_t mask = bits_of(inside, word);
        std::uint64_t& bits = bits_[row(y, z) + static_cast<std::size_t>(word)];
        const std::uint64_t different = (occupied ? ~bits : bits) & mask;
        if (different == 0) continue;
        bits ^= different;
        changed(y, z, word, different);
      }
}

void VoxelGrid::set(const VoxelBox& voxels) {
  set(voxels, true, [](std::int32_t, std::int32_t, std::int32_t, std::uint64_t) {});
}

void VoxelGrid::clear(const VoxelBox& voxels) {
  set(voxels, false, [](std::int32_t, std::int32_t, std::int32_t, std::uint64_t) {});
}

bool VoxelGrid::any(const VoxelBox& voxels) const {
  const VoxelBox inside = common(voxels, box_);
  if (is_empty(inside)) return false;
  const auto [first, last] = words_of(inside);
  for (std::int32_t z = inside.lo[2]; z < inside.hi[2]; ++z)
    for (std::int32_t y = inside.lo[1]; y < inside.hi[1]; ++y)
      for (std::int32_t word = first; word <= last; ++word)
        if ((bits_[row(y, z) + static_cast<std::size_t>(word)] & bits_of(inside, word)) != 0)
          return true;
  return false;
}

void VoxelGrid::copy(const VoxelGrid& other) {
  const VoxelBox& from = other.box_;
  for (std::int32_t z = from.lo[2]; z < from.hi[2]; ++z)
    for (std::int32_t y = from.lo[1]; y < from.hi[1]; ++y)
      for (std::int32_t word = 0; word < other.words_; ++word)
        for (std::uint64_t bits = other.word(word, y, z); bits != 0;) {
          const std::int32_t begin = std::countr_zero(bits);
          const std::int32_t count = std::countr_one(bits >> static_cast<unsigned>(begin));
          const std::int32_t x = from.lo[0] + 64 * word + begin;
          set({{x, y, z}, {x + count, y + 1, z + 1}});
          if (begin + count == 64) break;
          bits &= ~std::uint64_t{0} << static_cast<unsigned>(begin + count);
        }
}

std::uint64_t VoxelGrid::word(std::int32_t word, std::int32_t y, std::int32_t z) const {
  const bool inside = word >= 0 && word < words_ && y >= box_.lo[1] && y < box_.hi[1] &&
                      z >= box_.lo[2] && z < box_.hi[2];
  return inside ? bits_[row(y, z) + static_cast<std::size_t>(word)] : 0;
}

VoxelBox VoxelGrid::bounds() const {
  constexpr std::int32_t most = std::numeric_limits<std::int32_t>::max();
  VoxelBox out{{most, most, most}, {-most, -most, -most}};
  for (std::int32_t z = box_.lo[2]; z < box_.hi[2]; ++z)
    for (std::int32_t y = box_.lo[1]; y < box_.hi[1]; ++y)
      for (std::int32_t at = 0; at < words_; ++at) {
        const std::uint64_t bits = bits_[row(y, z) + static_cast<std::size_t>(at)];
        if (bits == 0) continue;
        const std::int32_t x = box_.lo[0] + 64 * at;
        out.lo = {std::min(out.lo[0], x + std::countr_zero(bits)), std::min(out.lo[1], y),
                  std::min(out.lo[2], z)};
        out.hi = {std::max(out.hi[0], x + 64 - std::countl_zero(bits)), std::max(out.hi[1], y + 1),
                  std::max(out.hi[2], z + 1)};
      }
  return out.lo[0] < out.hi[0] ? out : VoxelBox{};
}

/// Where voxels changed: the boxes of the changes in each tile of the grid, since changes may be
/// far from each other.
class DistanceField::Dirty {
 public:
  void add(const VoxelGrid& grid, std::int32_t y, std::int32_t z, std::int32_t word,
           std::uint64_t bits) {
    const std::int32_t x = grid.box().lo[0] + 64 * word;
    const VoxelBox row{{x + std::countr_zero(bits), y, z},
                       {x + 64 - std::countl_zero(bits), y + 1, z + 1}};
    const std::array<std::int32_t, 3> tile{word, y >> 6, z >> 6};
    const auto at = std::find_if(tiles_.rbegin(), tiles_.rend(),
                                 [&](const Tile& other) { return other.number == tile; });
    if (at == tiles_.rend())
      tiles_.push_back({tile, row});
    else
      at->box = hull(at->box, row);
  }
  [[nodiscard]] bool empty() const noexcept { return tiles_.empty(); }
  /// Boxes that hold all changes; joined where computing them together takes less.
  [[nodiscard]] std::vector<VoxelBox> boxes() const {
    std::vector<VoxelBox> out;
    for (const Tile& tile : tiles_) {
      VoxelBox box = tile.box;
      for (std::size_t i = 0; i < out.size();) {
        const VoxelBox both = hull(out[i], box);
        if (work(both) > work(out[i]) + work(box)) {
          ++i;
          continue;
        }
        box = both;
        out[i] = out.back();
        out.pop_back();
        i = 0;
      }
      out.push_back(box);
    }
    return out;
  }
  [[nodiscard]] static double work(const VoxelBox& box) { return volume(widened(box, 2 * cap)); }

 private:
  struct Tile {
    std::array<std::int32_t, 3> number;
    VoxelBox box;
  };
  std::vector<Tile> tiles_;
};

DistanceField::DistanceField(VoxelGrid grid, const VoxelBox& used, double resolution_m)
    : resolution_(resolution_m), grid_(std::move(grid)), used_(used) {
  compute_all();
}

std::optional<DistanceField> DistanceField::make(std::span<const VoxelBox> occupied,
                                                 double resolution_m) {
  const VoxelBox used = hull_of(occupied);
  if (!fits(used)) return std::nullopt;
  VoxelGrid grid(used);
  for (const VoxelBox& box : occupied) grid.set(box);
  return DistanceField(std::move(grid), used, resolution_m);
}

void DistanceField::compute_all() {
  values_.clear();
  if (is_empty(used_)) return;
  nodes_ = nodes_around(used_);
  const std::vector<std::int16_t> squares = Transform(grid_, nodes_, nodes_).run();
  const auto& value = tables().value;
  values_.resize(squares.size() + padding);
  for (std::size_t i = 0; i < squares.size(); ++i)
    values_[i] = value[static_cast<std::size_t>(squares[i])];
}

// Where the voxels' bounds changed, the nodes are others: those that were there before keep their
// values, and the others get theirs.
void DistanceField::move_nodes() {
  const VoxelBox before = std::exchange(nodes_, nodes_around(used_));
  const VoxelBox kept = common(before, nodes_);
  const std::vector<std::uint16_t> values = std::exchange(
      values_, std::vector<std::uint16_t>(static_cast<std::size_t>(volume(nodes_)) + padding));
  const std::ptrdiff_t row = before.hi[0] - before.lo[0];
  const std::ptrdiff_t plane = row * (before.hi[1] - before.lo[1]);
  for (std::int32_t z = kept.lo[2]; z < kept.hi[2]; ++z)
    for (std::int32_t y = kept.lo[1]; y < kept.hi[1]; ++y)
      std::copy_n(values.data() + (z - before.lo[2]) * plane + (y - before.lo[1]) * row +
                      (kept.lo[0] - before.lo[0]),
                  kept.hi[0] - kept.lo[0], &values_[index(kept.lo[0], y, z)]);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    VoxelBox below = nodes_, above = nodes_;
    below.hi[axis] = kept.lo[axis];
    above.lo[axis] = kept.hi[axis];
    for (const VoxelBox& beside : {below, above})
      if (!is_empty(beside)) compute(beside);
  }
}

void DistanceField::compute(VoxelBox to) {
  constexpr std::int32_t row_least = 16;
  const std::int32_t lack = std::max(0, row_least - (to.hi[0] - to.lo[0]));
  to.lo[0] = std::max(nodes_.lo[0], to.lo[0] - lack);
  to.hi[0] = std::max(to.hi[0], std::min(nodes_.hi[0], to.lo[0] + row_least));
  const VoxelBox from = common(widened(to, cap), nodes_);
  const std::vector<std::int16_t> squares = Transform(grid_, from, to).run();
  const auto& value = tables().value;
  const std::int16_t* square = squares.data();
  for (std::int32_t z = to.lo[2]; z < to.hi[2]; ++z)
    for (std::int32_t y = to.lo[1]; y < to.hi[1]; ++y) {
      std::uint16_t* const out = &values_[index(to.lo[0], y, z)];
      for (std::int32_t x = 0; x < to.hi[0] - to.lo[0]; ++x)
        out[x] = value[static_cast<std::size_t>(*square++)];
    }
}

bool DistanceField::grow(std::span<const VoxelBox> occupied) {
  const VoxelBox all = hull(grid_.box(), hull_of(occupied));
  if (same(all, grid_.box()) || is_empty(all)) return true;
  const VoxelBox used = hull(grid_.bounds(), hull_of(occupied));
  if (!fits(used)) return false;
  VoxelGrid wider(used);
  wider.copy(grid_);
  grid_ = std::move(wider);
  return true;
}

bool DistanceField::change(std::span<const VoxelBox> free, std::span<const VoxelBox> occupied) {
  Dirty dirty;
  const auto mark = [&](std::int32_t y, std::int32_t z, std::int32_t word, std::uint64_t bits) {
    dirty.add(grid_, y, z, word, bits);
  };
  for (const VoxelBox& box : free) grid_.set(box, false, mark);
  if (!grow(occupied)) return false;
  for (const VoxelBox& box : occupied) grid_.set(box, true, mark);
  if (dirty.empty()) return true;
  const VoxelBox before = used_;
  used_ = grid_.bounds();
  const std::vector<VoxelBox> changed = dirty.boxes();
  double work = 0.0;
  for (const VoxelBox& box : changed) work += Dirty::work(box);
  if (!fits(used_)) return false;
  if (is_empty(before) || is_empty(used_) || is_empty(common(before, used_)) ||
      work > volume(nodes_)) {
    compute_all();
    return true;
  }
  if (!same(before, used_)) move_nodes();
  for (const VoxelBox& box : changed) {
    const VoxelBox near = common(corners(widened(box, cap)), nodes_);
    if (!is_empty(near)) compute(near);
  }
  return true;
}

DistanceField::View DistanceField::view() const noexcept {
  View out;
  out.resolution_m = resolution_;
  out.unit_m = resolution_ * unit_voxels;
  if (empty()) return out;
  out.values = values_.data();
  out.lo = nodes_.lo;
  for (std::size_t i = 0; i < 3; ++i) out.count[i] = nodes_.hi[i] - nodes_.lo[i];
  return out;
}

// docs/theory.md (17.7)–(17.9)
// The place of a point among the nodes, moved into their box: (17.9).
struct DistanceField::Place {
  std::array<std::int32_t, 3> low{};  ///< the cell's first node
  std::array<double, 3> t{};          ///< coordinates in the cell
};

DistanceField::Place DistanceField::place(const Eigen::Vector3d& p) const noexcept {
  Place out;
  for (std::size_t i = 0; i < 3; ++i) {
    const double last = nodes_.hi[i] - 1 - nodes_.lo[i];
    const double at =
        std::clamp(p[static_cast<Eigen::Index>(i)] / resolution_ - nodes_.lo[i], 0.0, last);
    const auto low = static_cast<std::int32_t>(std::min(at, last - 1.0));
    out.low[i] = nodes_.lo[i] + low;
    out.t[i] = at - low;
  }
  return out;
}

// (17.7) in voxels
double DistanceField::bound_by_node(const Place& at) const noexcept {
  std::array<std::int32_t, 3> node{};
  double apart = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const bool next = at.t[i] >= 0.5;
    node[i] = at.low[i] + (next ? 1 : 0);
    const double off = next ? 1.0 - at.t[i] : at.t[i];
    apart += off * off;
  }
  return unit_voxels * static_cast<double>(values_[index(node[0], node[1], node[2])]) -
         std::sqrt(apart);
}

// (17.8) in voxels, or −1 where a voxel is too near
double DistanceField::bound_by_cell(const Place& at) const noexcept {
  const auto& t = at.t;
  double least = cap, interpolated = 0.0;
  for (std::int32_t corner = 0; corner < 8; ++corner) {
    const std::int32_t x = corner & 1, y = (corner >> 1) & 1, z = corner >> 2;
    const double value =
        unit_voxels *
        static_cast<double>(values_[index(at.low[0] + x, at.low[1] + y, at.low[2] + z)]);
    least = std::min(least, value);
    interpolated += value * (x != 0 ? t[0] : 1.0 - t[0]) * (y != 0 ? t[1] : 1.0 - t[1]) *
                    (z != 0 ? t[2] : 1.0 - t[2]);
  }
  constexpr double half_diagonal = 0.8660254037844388, least_delta = 0.3;
  const double delta = least - half_diagonal;
  if (!(delta > least_delta)) return -1.0;
  const double bend = t[0] * (1.0 - t[0]) + t[1] * (1.0 - t[1]) + t[2] * (1.0 - t[2]);
  return interpolated - 0.5 * bend / delta;
}

double DistanceField::lower_bound(const Eigen::Vector3d& p) const {
  if (empty()) return resolution_ > 0.0 ? cap_m() : std::numeric_limits<double>::infinity();
  const Place at = place(p);
  return std::max(0.0, std::max(bound_by_node(at), bound_by_cell(at)) - bound_rounding) *
         resolution_;
}

bool DistanceField::is_farther(const Eigen::Vector3d& p, double limit_m) const {
  if (empty()) return lower_bound(p) > limit_m;
  const double limit = limit_m / resolution_ + 2.0 * bound_rounding;
  if (limit >= cap) return false;
  const Place at = place(p);
  return bound_by_node(at) > limit || bound_by_cell(at) > limit;
}

}  // namespace hamelin::scene
