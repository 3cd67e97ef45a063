#include "hamelin/sensing/occupancy_grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/sensing/kernel/ray_walk.hpp"
#include "ray.hpp"

namespace hamelin::sensing {

namespace kernel {
HAMELIN_SELECT_KERNELS(WalkKernels, walk_kernels)
}  // namespace kernel

namespace {

// So many rays fit into a cache.
constexpr std::size_t rays_together = 512;

constexpr std::int64_t voxels_max = std::int64_t{1} << 32;

// The log-odds of a voxel that no frame has told about.
constexpr float not_measured = std::numeric_limits<float>::quiet_NaN();

[[noreturn]] void refuse(const std::string& what) {
  throw Error(ErrorCode::invalid, "occupancy grid: " + what);
}

float log_odds_of(const char* name, double p) {
  if (!(p > 0.0 && p < 1.0))
    refuse(
        fmt::format("a probability `{}` of {} given, expected a number between 0 and 1", name, p));
  return static_cast<float>(std::log(p / (1.0 - p)));
}

}  // namespace

// The log-odds of voxels, as many along y and z as fit a page or two; x is a row of bits.
struct OccupancyGrid::Block {
  static constexpr std::int32_t edge = 8, row = 64;
  std::array<float, static_cast<std::size_t>(edge* edge* row)> values;
  Block() { values.fill(not_measured); }
  float* at(std::int32_t y, std::int32_t z) {
    return values.data() + (z % edge * edge + y % edge) * row;
  }
};

// The voxels of a frame's points, each once, in the order of the points: a table with open
// addresses.
class OccupancyGrid::EndPoints {
 public:
  void begin(std::size_t points) {
    const std::size_t size = std::bit_ceil(std::max<std::size_t>(64, 2 * points));
    if (slots_.size() < size) slots_.resize(size);
    std::fill(slots_.begin(), slots_.end(), empty);
  }
  /// @return whether it is new
  bool add(const Voxel& voxel) {
    const auto part = [&](std::size_t i) {
      return static_cast<std::uint64_t>(static_cast<std::uint32_t>(voxel[i] + key_limit));
    };
    const std::uint64_t key = part(0) | part(1) << 16U | part(2) << 32U;
    constexpr std::uint64_t golden = 0x9e3779b97f4a7c15;
    std::size_t i = static_cast<std::size_t>((key * golden) >> 20U) & (slots_.size() - 1);
    for (; slots_[i] != empty; i = (i + 1) & (slots_.size() - 1))
      if (slots_[i] == key) return false;
    slots_[i] = key;
    return true;
  }

 private:
  static constexpr std::uint64_t empty = ~std::uint64_t{0};
  std::vector<std::uint64_t> slots_;
};

OccupancyGrid::OccupancyGrid(double resolution_m, const scene::VoxelBox& box,
                             const SensorModel& model)
    : resolution_(resolution_m),
      box_(box),
      model_{log_odds_of("hit", model.hit), log_odds_of("miss", model.miss),
             log_odds_of("least", model.least), log_odds_of("most", model.most),
             log_odds_of("occupied", model.occupied)},
      ends_(std::make_unique<EndPoints>()) {
  if (!(resolution_m > 0.0) || !std::isfinite(resolution_m))
    refuse(fmt::format("a resolution of {} m given, expected a positive number", resolution_m));
  if (!(model.miss <= 0.5 && model.hit >= 0.5 && model.least <= model.occupied &&
        model.occupied <= model.most))
    refuse("expected miss ≤ 0.5 ≤ hit and least ≤ occupied ≤ most");
  std::array<std::int64_t, 3> size{};
  for (std::size_t i = 0; i < 3; ++i) {
    size[i] = std::int64_t{box.hi[i]} - box.lo[i];
    if (size[i] < 1 || box.lo[i] < -key_limit || box.hi[i] > key_limit)
      refuse(fmt::format("voxels {} to {} along an axis given, expected some within {} to {}",
                         box.lo[i], box.hi[i], -key_limit, key_limit));
  }
  words_ = static_cast<std::int32_t>((size[0] + 63) / 64);
  if (size[1] * size[2] > voxels_max / (64 * words_))
    refuse(fmt::format("{} × {} × {} voxels given, expected at most {}", size[0], size[1], size[2],
                       voxels_max));
  stride_ = {1, 64 * std::int64_t{words_}, 64 * words_ * size[1]};
  const auto words = static_cast<std::size_t>(words_ * size[1] * size[2]);
  for (Bits* bits : {&known_, &occupied_, &least_, &passed_, &hit_}) bits->words.assign(words, 0);
  const auto blocks = [](std::int64_t n) {
    return static_cast<std::size_t>((n + Block::edge - 1) / Block::edge);
  };
  block_count_ = {static_cast<std::size_t>(words_), blocks(size[1]), blocks(size[2])};
  blocks_.resize(block_count_[0] * block_count_[1] * block_count_[2]);
}

OccupancyGrid::~OccupancyGrid() = default;
OccupancyGrid::OccupancyGrid(OccupancyGrid&&) noexcept = default;
OccupancyGrid& OccupancyGrid::operator=(OccupancyGrid&&) noexcept = default;

bool OccupancyGrid::contains(const Voxel& voxel) const noexcept {
  for (std::size_t i = 0; i < 3; ++i)
    if (voxel[i] < box_.lo[i] || voxel[i] >= box_.hi[i]) return false;
  return true;
}

std::int64_t OccupancyGrid::bit_of(const Voxel& voxel) const noexcept {
  std::int64_t bit = 0;
  for (std::size_t i = 0; i < 3; ++i) bit += stride_[i] * (voxel[i] - box_.lo[i]);
  return bit;
}

OccupancyGrid::Voxel OccupancyGrid::first_of(std::size_t word) const noexcept {
  const auto row = static_cast<std::int32_t>(word / static_cast<std::size_t>(words_)),
             rows = box_.hi[1] - box_.lo[1];
  return {box_.lo[0] + 64 * static_cast<std::int32_t>(word % static_cast<std::size_t>(words_)),
          box_.lo[1] + row % rows, box_.lo[2] + row / rows};
}

std::size_t OccupancyGrid::block_of(const Voxel& first) const noexcept {
  const auto at = [&](std::size_t i, std::int32_t edge) {
    return static_cast<std::size_t>((first[i] - box_.lo[i]) / edge);
  };
  return (at(2, Block::edge) * block_count_[1] + at(1, Block::edge)) * block_count_[0] +
         at(0, Block::row);
}

void OccupancyGrid::free_along(const Eigen::Vector3f& origin, const Eigen::Vector3f& end) {
  Ray ray(origin, end, resolution_);
  while (!ray.done() && !contains(ray.voxel())) ray.advance();
  if (ray.done()) return;
  kernel::BoxRay out{ray.next(), ray.apart(), ray.length(), bit_of(ray.voxel()), {}, -1, 0, {}};
  std::array<std::int64_t, 3> left{};
  for (std::size_t i = 0; i < 3; ++i) {
    out.bit_step[i] = stride_[i] * ray.step(i);
    // a ray that has left the box does not return
    left[i] = ray.step(i) > 0 ? box_.hi[i] - 1 - ray.voxel()[i] : ray.voxel()[i] - box_.lo[i];
  }
  using Packed = kernel::BoxRay;
  out.left = Packed::packed(left[0], left[1], left[2]);
  out.left_step = {Packed::packed(1, 0, 0), Packed::packed(0, 1, 0), Packed::packed(0, 0, 1)};
  if (contains(ray.end())) out.end_bit = bit_of(ray.end());
  rays_.push_back(out);
  if (rays_.size() == rays_together) walk_rays();
}

void OccupancyGrid::walk_rays() {
  kernel::select_walk_kernels(default_isa()).walk(rays_.data(), rays_.size(), passed_.words.data());
  rays_.clear();
}

void OccupancyGrid::mark(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                         const Eigen::Vector3f& origin, double range_m) {
  const double voxels_per_m = 1.0 / resolution_;
  ends_->begin(static_cast<std::size_t>(points.cols()));
  rays_.clear();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3f point = points.col(i);
    if (!has_key(point, voxels_per_m)) continue;
    Voxel voxel;
    Eigen::Vector3f centre;
    for (int j = 0; j < 3; ++j) {
      voxel[static_cast<std::size_t>(j)] = voxel_at(static_cast<double>(point[j]), voxels_per_m);
      centre[j] = static_cast<float>(centre_of(voxel[static_cast<std::size_t>(j)], resolution_));
    }
    if (!ends_->add(voxel)) continue;
    const Eigen::Vector3f way = centre - origin;
    const float squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
    const double distance = std::sqrt(static_cast<double>(squared));
    if (distance <= range_m) {
      free_along(origin, centre);
      if (contains(voxel)) hit_.set(bit_of(voxel));
    } else {
      const Eigen::Vector3f end =
          origin + way / static_cast<float>(distance) * static_cast<float>(range_m);
      if (has_key(end, voxels_per_m)) free_along(origin, end);
    }
  }
  walk_rays();
}

std::uint64_t OccupancyGrid::update(std::size_t word, std::uint64_t free, std::uint64_t occupied) {
  const Voxel first = first_of(word);
  std::unique_ptr<Block>& block = blocks_[block_of(first)];
  if (!block) block = std::make_unique<Block>();
  float* const values = block->at(first[1] - box_.lo[1], first[2] - box_.lo[2]);
  std::uint64_t now = occupied_.words[word];
  for (std::uint64_t left = free | occupied; left != 0; left &= left - 1) {
    const int i = std::countr_zero(left);
    const std::uint64_t bit = std::uint64_t{1} << i;
    float& value = values[i];
    const float before = std::isnan(value) ? value_of(word, bit) : value;
    value = std::clamp(before + ((occupied & bit) != 0 ? model_.hit : model_.miss), model_.least,
                       model_.most);
    now = value >= model_.occupied ? now | bit : now & ~bit;
    least_.words[word] =
        value <= model_.least ? least_.words[word] | bit : least_.words[word] & ~bit;
  }
  return now;
}

// docs/theory.md (20.1). A voxel that a point is in is not freed by the rays to others.
void OccupancyGrid::apply() {
  rows_.clear();
  for (std::size_t word = 0; word < passed_.words.size(); ++word) {
    // another miss changes nothing of a voxel that is as free as it can be
    const std::uint64_t hit = hit_.words[word],
                        passed = passed_.words[word] & ~hit & ~least_.words[word];
    hit_.words[word] = passed_.words[word] = 0;
    if ((hit | passed) == 0) continue;
    const std::uint64_t known = known_.words[word], before = occupied_.words[word],
                        now = update(word, passed, hit), learned = (hit | passed) & ~known;
    known_.words[word] = known | learned;
    occupied_.words[word] = now;
    const Row row{first_of(word), now & ~before, (before | learned) & ~now, learned};
    if ((row.occupied | row.freed) != 0) rows_.push_back(row);
  }
}

std::span<const OccupancyGrid::Row> OccupancyGrid::insert(
    const Eigen::Ref<const Eigen::Matrix3Xf>& points, const Eigen::Vector3f& origin,
    double range_m) {
  if (!origin.allFinite() || !has_key(origin, 1.0 / resolution_))
    refuse(fmt::format("points seen from ({}, {}, {}) given, expected a place within {} voxels",
                       origin[0], origin[1], origin[2], key_limit));
  if (!points.allFinite()) refuse("a point is not finite, expected finite numbers");
  if (!(range_m > 0.0)) refuse(fmt::format("a range of {} m given, expected more than 0", range_m));
  mark(points, origin, range_m);
  apply();
  return rows_;
}

std::uint64_t OccupancyGrid::free_in(std::int64_t word, std::int64_t y, std::int64_t z) const {
  if (word < 0 || word >= words_ || y < 0 || y >= box_.hi[1] - box_.lo[1] || z < 0 ||
      z >= box_.hi[2] - box_.lo[2])
    return 0;
  const auto at = static_cast<std::size_t>((y * stride_[1] + z * stride_[2]) / 64 + word);
  return known_.words[at] & ~occupied_.words[at];
}

// docs/theory.md (20.6)
std::uint64_t OccupancyGrid::gaps_in(std::int64_t word, std::int64_t y, std::int64_t z) const {
  const std::uint64_t here = free_in(word, y, z);
  const std::uint64_t x =
      (here << 1U | free_in(word - 1, y, z) >> 63U) & (here >> 1U | free_in(word + 1, y, z) << 63U);
  const std::uint64_t along_y = free_in(word, y - 1, z) & free_in(word, y + 1, z),
                      along_z = free_in(word, y, z - 1) & free_in(word, y, z + 1);
  const auto at = static_cast<std::size_t>((y * stride_[1] + z * stride_[2]) / 64 + word);
  return ~known_.words[at] & ((x & along_y) | (x & along_z) | (along_y & along_z));
}

std::span<const OccupancyGrid::Row> OccupancyGrid::gaps() {
  // words with a neighbour of what was freed, each once
  std::vector<std::size_t> near;
  const std::array<std::int64_t, 3> step{1, stride_[1] / 64, stride_[2] / 64};
  const std::array<std::int64_t, 3> count{words_, box_.hi[1] - box_.lo[1], box_.hi[2] - box_.lo[2]};
  for (const Row& row : rows_) {
    if ((row.freed & row.learned) == 0) continue;
    const std::array<std::int64_t, 3> at{(row.first[0] - box_.lo[0]) / 64,
                                         row.first[1] - box_.lo[1], row.first[2] - box_.lo[2]};
    const std::int64_t word = at[0] + at[1] * step[1] + at[2] * step[2];
    near.push_back(static_cast<std::size_t>(word));
    for (std::size_t i = 0; i < 3; ++i) {
      if (at[i] > 0) near.push_back(static_cast<std::size_t>(word - step[i]));
      if (at[i] + 1 < count[i]) near.push_back(static_cast<std::size_t>(word + step[i]));
    }
  }
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  gaps_.clear();
  for (const std::size_t word : near) {
    const Voxel first = first_of(word);
    const std::uint64_t gaps =
        gaps_in((first[0] - box_.lo[0]) / 64, first[1] - box_.lo[1], first[2] - box_.lo[2]);
    if (gaps != 0) gaps_.push_back({first, 0, gaps, gaps});
  }
  return gaps_;
}

float OccupancyGrid::value_of(std::size_t word, std::uint64_t bit) const noexcept {
  if ((known_.words[word] & bit) == 0) return 0.0F;
  return (occupied_.words[word] & bit) != 0 ? model_.most : model_.least;
}

void OccupancyGrid::set(std::size_t word, std::uint64_t mask, State state) {
  const auto change = [&](Bits& bits, bool on) {
    bits.words[word] = on ? bits.words[word] | mask : bits.words[word] & ~mask;
  };
  change(known_, state != State::unknown);
  change(occupied_, state == State::occupied);
  change(least_, state == State::free);
  const Voxel first = first_of(word);
  Block* const block = blocks_[block_of(first)].get();
  if (block == nullptr) return;
  float* const values = block->at(first[1] - box_.lo[1], first[2] - box_.lo[2]);
  for (std::uint64_t left = mask; left != 0; left &= left - 1)
    values[std::countr_zero(left)] = not_measured;
}

void OccupancyGrid::set(const scene::VoxelBox& box, State state) {
  scene::VoxelBox part;
  for (std::size_t i = 0; i < 3; ++i) {
    part.lo[i] = std::max(box.lo[i], box_.lo[i]);
    part.hi[i] = std::min(box.hi[i], box_.hi[i]);
    if (part.lo[i] >= part.hi[i]) return;
  }
  for (std::int32_t z = part.lo[2]; z < part.hi[2]; ++z)
    for (std::int32_t y = part.lo[1]; y < part.hi[1]; ++y) {
      const auto row = static_cast<std::size_t>(bit_of({box_.lo[0], y, z}) / 64);
      for (std::int32_t x = part.lo[0] - box_.lo[0], last = part.hi[0] - box_.lo[0]; x < last;) {
        const std::int32_t first = x % 64, count = std::min(64 - first, last - x);
        set(row + static_cast<std::size_t>(x / 64), (~std::uint64_t{0} >> (64 - count)) << first,
            state);
        x += count;
      }
    }
}

OccupancyGrid::Voxel OccupancyGrid::voxel_of(const Eigen::Vector3d& p) const noexcept {
  const double voxels_per_m = 1.0 / resolution_;
  return {voxel_at(p[0], voxels_per_m), voxel_at(p[1], voxels_per_m), voxel_at(p[2], voxels_per_m)};
}

OccupancyGrid::State OccupancyGrid::state(const Voxel& voxel) const {
  if (!contains(voxel)) return State::unknown;
  const auto bit = static_cast<std::size_t>(bit_of(voxel));
  const auto has = [&](const Bits& bits) { return (bits.words[bit / 64] >> (bit % 64) & 1U) != 0; };
  return !has(known_) ? State::unknown : has(occupied_) ? State::occupied : State::free;
}

float OccupancyGrid::log_odds(const Voxel& voxel) const {
  if (state(voxel) == State::unknown) return std::numeric_limits<float>::quiet_NaN();
  const auto bit = static_cast<std::size_t>(bit_of(voxel));
  const Voxel first = first_of(bit / 64);
  Block* const block = blocks_[block_of(first)].get();
  const float value = block == nullptr
                          ? not_measured
                          : block->at(first[1] - box_.lo[1], first[2] - box_.lo[2])[bit % 64];
  return std::isnan(value) ? value_of(bit / 64, std::uint64_t{1} << (bit % 64)) : value;
}

std::size_t OccupancyGrid::bytes() const noexcept {
  std::size_t sum = 5 * known_.words.size() * sizeof(std::uint64_t);
  for (const auto& block : blocks_)
    if (block) sum += sizeof(Block);
  return sum;
}

}  // namespace hamelin::sensing
