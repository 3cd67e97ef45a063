#include "hamelin/sensing/mover_tracker.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

namespace hamelin::sensing {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

using CellKey = std::array<std::int32_t, 3>;

// Cells are joined with the neighbours that they touch.
class CellGroups {
 public:
  explicit CellGroups(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t find(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  // The group of the smaller index remains, so that groups come in the order of their first cells.
  void join(std::size_t a, std::size_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

// One coordinate of a neighbour after the other, from −1 to 1.
CellKey neighbour(const CellKey& cell, int n) {
  return {cell[0] + n % 3 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n / 9 - 1};
}

}  // namespace

std::vector<MoverTracker::Cluster> MoverTracker::clusters_of(
    const Eigen::Matrix3d& axes, const Eigen::Ref<const Eigen::Matrix3Xf>& points,
    std::span<const std::uint8_t> loose) const {
  std::map<CellKey, std::vector<Index>> cells;
  for (Index i = 0; i < points.cols(); ++i) {
    if (loose[static_cast<std::size_t>(i)] == 0) continue;
    CellKey key;
    for (std::size_t a = 0; a < 3; ++a)
      key[a] = static_cast<std::int32_t>(
          std::floor(static_cast<double>(points(static_cast<Index>(a), i)) / options_.apart_m));
    cells[key].push_back(i);
  }
  std::map<CellKey, std::size_t> index;
  for (const auto& cell : cells) index.emplace(cell.first, index.size());
  CellGroups groups(index.size());
  constexpr int neighbours = 27;
  for (const auto& [key, at] : index)
    for (int n = 0; n < neighbours; ++n)
      if (const auto other = index.find(neighbour(key, n)); other != index.end())
        groups.join(at, other->second);
  std::map<std::size_t, Cluster> clusters;
  for (const auto& [key, members] : cells) {
    auto& all = clusters[groups.find(index.at(key))].points;
    all.insert(all.end(), members.begin(), members.end());
  }
  std::vector<Cluster> out;
  for (auto& [group, cluster] : clusters) {
    if (cluster.points.size() < options_.points_min) continue;
    cluster.low.setConstant(std::numeric_limits<double>::infinity());
    cluster.high = -cluster.low;
    for (const Index i : cluster.points) {
      const Vector3d p = axes.transpose() * points.col(i).cast<double>();
      cluster.low = cluster.low.cwiseMin(p);
      cluster.high = cluster.high.cwiseMax(p);
    }
    // what is hidden behind it
    const Vector3d seen = cluster.high - cluster.low;
    cluster.high.z() = cluster.low.z() + std::max(seen.z(), std::min(seen.x(), seen.y()));
    if ((cluster.high - cluster.low).maxCoeff() <= options_.size_max_m)
      out.push_back(std::move(cluster));
  }
  return out;
}

MoverTracker::Track* MoverTracker::nearest(const Vector3d& center, double time_s,
                                           std::span<const std::uint8_t> assigned) {
  Track* found = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < assigned.size(); ++k) {
    Track& track = tracks_[k];
    const double elapsed_s = time_s - track.seen_s;
    const double distance = (center - track.center - elapsed_s * track.velocity).norm();
    if (assigned[k] != 0 || distance >= least ||
        (center - track.center).norm() > options_.speed_max_m_s * elapsed_s)
      continue;
    found = &track;
    least = distance;
  }
  return found;
}

void MoverTracker::follow(Track& track, double time_s, const Vector3d& center) const {
  constexpr double fresh_share = 0.5;
  const Vector3d velocity = (center - track.center) / (time_s - track.seen_s);
  track.velocity = track.frames == 1
                       ? velocity
                       : Vector3d(track.velocity + fresh_share * (velocity - track.velocity));
  track.center = center;
  track.seen_s = time_s;
  ++track.frames;
  if ((center - track.anchor).norm() < options_.moved_min_m) return;
  track.anchor = center;
  track.anchored_s = time_s;
  track.moves = track.moves || track.frames >= options_.frames_min;
}

// docs/theory.md (20.5)
MoverTracker::Update MoverTracker::update(double time_s, const geometry::SE3& sensor,
                                          const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                          std::span<const std::uint8_t> loose) {
  Update out;
  out.taken.assign(static_cast<std::size_t>(points.cols()), 0);
  std::vector<std::uint8_t> assigned(tracks_.size(), 0);
  const Eigen::Matrix3d& axes = sensor.R();
  for (const Cluster& cluster : clusters_of(axes, points, loose)) {
    const Vector3d center = axes * (0.5 * (cluster.low + cluster.high)),
                   size = cluster.high - cluster.low;
    Track* const track = nearest(center, time_s, assigned);
    if (track == nullptr) {
      tracks_.push_back(
          {next_id_++, false, 1, axes, center, Vector3d::Zero(), size, center, time_s, time_s});
      continue;
    }
    assigned[static_cast<std::size_t>(track - tracks_.data())] = 1;
    const bool moved = track->moves;
    follow(*track, time_s, center);
    track->size = moved ? Vector3d(track->size.cwiseMax(size)) : size;
    if (!moved) track->axes = axes;
    if (!track->moves) continue;
    for (const Index i : cluster.points) out.taken[static_cast<std::size_t>(i)] = 1;
    out.movers.push_back({track->id, {track->axes, track->center}, track->size, track->velocity});
  }
  std::erase_if(tracks_, [&](const Track& track) {
    const bool gone =
        time_s - track.seen_s > options_.lost_s || time_s - track.anchored_s > options_.still_s;
    if (gone && track.moves) out.gone.push_back(track.id);
    return gone;
  });
  return out;
}

void MoverTracker::forget(std::int32_t id) {
  std::erase_if(tracks_, [&](const Track& track) { return track.id == id; });
}

}  // namespace hamelin::sensing
