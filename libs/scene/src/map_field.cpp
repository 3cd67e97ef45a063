#include "hamelin/scene/map_field.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/numbers.hpp"
#include "map_surface.hpp"

namespace hamelin::scene {

namespace {

constexpr double cone_cosine = 0.86602540378443865;  // 30°

std::vector<Box> in_metres(const std::vector<VoxelBox>& voxels, double resolution) {
  std::vector<Box> boxes;
  boxes.reserve(voxels.size());
  for (const VoxelBox& box : voxels) boxes.push_back(to_metres(box, resolution));
  return boxes;
}

}  // namespace

MapField::MapField(const std::vector<Cell>& cells, double resolution, const Eigen::Vector3d& origin)
    : resolution_(resolution),
      boxes_(in_metres(merge(cells), resolution), origin),
      surface_(std::make_unique<MapSurface>(resolution)) {}

MapField::MapField(const MapField& other)
    : resolution_(other.resolution_),
      boxes_(other.boxes_),
      surface_(std::make_unique<MapSurface>(other.resolution_)) {}

MapField::MapField() = default;
MapField::MapField(MapField&&) noexcept = default;
MapField& MapField::operator=(MapField&&) noexcept = default;
MapField::~MapField() = default;

void MapField::prepare() const {
  if (!empty()) surface_->prepare(boxes_);
}

MapField::Changed MapField::change(const std::vector<VoxelBox>& add,
                                   const std::vector<VoxelBox>& remove) {
  Changed changed;
  const std::size_t first_added = boxes_.first_added();
  const auto voxels_of = [&](std::int32_t box) {
    return to_voxels(boxes_.boxes()[static_cast<std::size_t>(box)], resolution_);
  };
  // For each box that is cut: the boxes to subtract from it, and the pieces that remain.
  std::vector<std::int32_t> near, cut;
  std::vector<std::pair<std::int32_t, const VoxelBox*>> cuts;
  for (const VoxelBox& hole : remove) {
    boxes_.overlapping(to_metres(hole, resolution_), near);
    for (const std::int32_t box : near) cuts.emplace_back(box, &hole);
  }
  std::stable_sort(cuts.begin(), cuts.end(),
                   [](const auto& x, const auto& y) { return x.first < y.first; });
  std::vector<std::vector<VoxelBox>> rest;
  std::vector<VoxelBox> holes;
  for (std::size_t i = 0; i < cuts.size();) {
    const std::int32_t box = cuts[i].first;
    holes.clear();
    for (; i < cuts.size() && cuts[i].first == box; ++i) holes.push_back(*cuts[i].second);
    cut.push_back(box);
    changed.removed += voxels_in({voxels_of(box)});
    rest.push_back(without(voxels_of(box), holes));
  }
  for (const auto& pieces : rest) changed.removed -= voxels_in(pieces);
  // The second tree gets the boxes of earlier additions that were not cut, the remaining pieces,
  // and the new boxes.
  std::vector<VoxelBox> added;
  for (std::size_t box = first_added; box < boxes_.boxes().size(); ++box)
    if (!std::binary_search(cut.begin(), cut.end(), static_cast<std::int32_t>(box)))
      added.push_back(voxels_of(static_cast<std::int32_t>(box)));
  for (const auto& pieces : rest) added.insert(added.end(), pieces.begin(), pieces.end());
  for (const VoxelBox& box : add) {
    std::vector<VoxelBox> pieces{box};
    boxes_.overlapping(to_metres(box, resolution_), near);
    for (const std::int32_t other : near) {
      const auto at = std::lower_bound(cut.begin(), cut.end(), other);
      if (at == cut.end() || *at != other) {
        subtract(pieces, voxels_of(other));
        continue;
      }
      for (const VoxelBox& piece : rest[static_cast<std::size_t>(at - cut.begin())])
        subtract(pieces, piece);
    }
    changed.added += voxels_in(pieces);
    added.insert(added.end(), pieces.begin(), pieces.end());
  }
  if (changed.added == 0 && changed.removed == 0) return changed;
  join(added);
  cut.erase(std::lower_bound(cut.begin(), cut.end(), static_cast<std::int32_t>(first_added)),
            cut.end());
  boxes_.change(cut, in_metres(added, resolution_));
  surface_ = std::make_unique<MapSurface>(resolution_);
  return changed;
}

// docs/theory.md (11.5)
void MapField::find_exit(const Eigen::Vector3d& p, BoxHit& hit) const {
  const MapSurface::Nearest nearest = surface_->nearest(boxes_, p);
  if (nearest.distance == infinity) return;
  hit.distance = -nearest.distance;
  hit.point = nearest.point;
  hit.direction = -nearest.direction;
  constexpr double on_surface = 1e-9;
  if (nearest.distance > on_surface) return;
  // the normal of the rectangle, towards the side that is not in the union half a voxel farther on
  int axis = 0;
  (nearest.face.hi - nearest.face.lo).minCoeff(&axis);
  const Eigen::Vector3d normal = Eigen::Vector3d::Unit(axis);
  BoxHit beyond;
  const bool up = !boxes_.nearest(nearest.point + 0.5 * resolution_ * normal, 0.0, beyond);
  hit.direction = up ? normal : Eigen::Vector3d(-normal);
}

void MapField::find_deepest(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            SegmentHit& hit) const {
  // Branch and bound for the greatest depth: docs/theory.md (11.12)–(11.14). The interval with the
  // greatest bound is divided where its chords cross.
  struct Sample {
    double t, depth;
    Box face;
  };
  struct Interval {
    Sample left, right;
    double bound, cut;  // greatest depth there can be, and where to divide
  };
  constexpr double tolerance = 1e-10;
  constexpr int samples_max = 500;
  constexpr std::size_t intervals_max = 64;
  const auto at = [&](double t) { return Eigen::Vector3d(a + t * (b - a)); };
  const auto sample = [&](double t) {
    BoxHit inside;
    const MapSurface::Nearest nearest = surface_->nearest(boxes_, at(t));
    const double depth = boxes_.nearest(at(t), 0.0, inside) ? nearest.distance : -nearest.distance;
    return Sample{t, depth, nearest.face};
  };
  const auto interval = [&](const Sample& left, const Sample& right) {
    const auto distance = [&](const Sample& of, const Sample& to) {
      return std::abs(closest_on_box(at(to.t), of.face).distance);
    };
    const double a0 = std::abs(left.depth), a1 = distance(left, right), b0 = distance(right, left),
                 b1 = std::abs(right.depth);
    // where the chords a0..a1 and b0..b1 cross; b0 ≥ a0 and a1 ≥ b1, because each face is the
    // nearest at its own end
    const double apart = (b0 - a0) + (a1 - b1);
    const double share = apart > 0.0 ? (b0 - a0) / apart : 0.5;
    Interval out{left, right, a0 + share * (a1 - a0), left.t + share * (right.t - left.t)};
    out.bound = std::max({out.bound, a0, b1});
    const double width = right.t - left.t;
    // the depth changes no faster than the position
    out.bound = std::min(out.bound, 0.5 * (left.depth + right.depth + width * (b - a).norm()));
    // outside of the union the chords are loose bounds, and halving is faster
    const bool entered = left.depth >= 0.0 && right.depth >= 0.0;
    out.cut = entered ? std::clamp(out.cut, left.t + 0.05 * width, right.t - 0.05 * width)
                      : left.t + 0.5 * width;
    return out;
  };
  Sample best = sample(hit.along);
  std::array<Interval, intervals_max> waiting;
  std::size_t count = 0;
  const std::array<double, 3> starts{0.0, hit.along, 1.0};
  Sample last = sample(0.0);
  for (const double t : starts) {
    const Sample next = sample(t);
    if (next.depth > best.depth) best = next;
    if (next.t > last.t) waiting[count++] = interval(last, next);
    last = next;
  }
  for (int samples = 0; samples < samples_max && count > 0 && count < intervals_max; ++samples) {
    auto* const widest =
        std::max_element(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(count),
                         [](const Interval& x, const Interval& y) { return x.bound < y.bound; });
    if (widest->bound <= best.depth + tolerance) break;
    const Interval open = *widest;
    *widest = waiting[--count];
    const Sample middle = sample(open.cut);
    if (middle.depth > best.depth) best = middle;
    if (!(middle.t > open.left.t && middle.t < open.right.t)) continue;
    waiting[count++] = interval(open.left, middle);
    waiting[count++] = interval(middle, open.right);
  }
  hit.along = best.t;
  hit.axis_point = at(best.t);
  find_exit(hit.axis_point, hit);
}

bool MapField::nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit,
                       std::int32_t hint) const {
  if (!boxes_.nearest(p, limit, hit, hint)) return false;
  if (hit.distance <= 0.0) find_exit(p, hit);
  return true;
}

bool MapField::nearest(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit,
                       SegmentHit& hit, std::int32_t hint) const {
  if (!boxes_.nearest(a, b, limit, hit, hint)) return false;
  if (hit.distance <= 0.0) find_deepest(a, b, hit);
  return true;
}

double MapField::distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit,
                          std::int32_t& hint) const {
  if (empty()) return limit;
  SegmentHit hit;
  if (!boxes_.nearest(a, b, limit, hit, hint)) return limit;
  hint = hit.box;
  return std::max(0.0, hit.distance);
}

std::size_t MapField::nearest_distinct(const Eigen::Vector3d& p, double limit, Scratch& scratch,
                                       std::span<BoxHit, points_max> out,
                                       BoxField::Vicinity* vicinity) const {
  const std::size_t count =
      boxes_.nearest_distinct(p, limit, cone_cosine, scratch.boxes_, out, vicinity);
  if (count == 0 || out[0].distance > 0.0) return count;
  find_exit(p, out[0]);
  return 1;
}

std::size_t MapField::nearest_distinct(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                       double limit, Scratch& scratch,
                                       std::span<SegmentHit, points_max> out,
                                       BoxField::Vicinity* vicinity) const {
  const std::size_t count =
      boxes_.nearest_distinct(a, b, limit, cone_cosine, scratch.boxes_, out, vicinity);
  if (count == 0 || out[0].distance > 0.0) return count;
  find_deepest(a, b, out[0]);
  return 1;
}

}  // namespace hamelin::scene
