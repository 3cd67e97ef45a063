#include "hamelin/fit/solid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "hamelin/core/numbers.hpp"

namespace hamelin::fit {

using Eigen::Vector3d;

namespace {

// Whether each edge is passed equally often in both directions by the triangles around it.
bool is_closed(const Mesh& mesh) {
  // Corners at the same place count as one, even if the file has several vertices there.
  std::vector<std::int32_t> by_place(mesh.vertices.size()), place(mesh.vertices.size());
  for (std::size_t i = 0; i < by_place.size(); ++i) by_place[i] = static_cast<std::int32_t>(i);
  const auto vertex = [&](std::int32_t i) -> const Vector3d& {
    return mesh.vertices[static_cast<std::size_t>(i)];
  };
  const auto before = [&](std::int32_t x, std::int32_t y) {
    const Vector3d &a = vertex(x), &b = vertex(y);
    if (a.x() != b.x()) return a.x() < b.x();
    return a.y() != b.y() ? a.y() < b.y() : a.z() < b.z();
  };
  std::sort(by_place.begin(), by_place.end(), before);
  for (std::size_t i = 0; i < by_place.size(); ++i) {
    const bool same = i > 0 && vertex(by_place[i]) == vertex(by_place[i - 1]);
    place[static_cast<std::size_t>(by_place[i])] =
        same ? place[static_cast<std::size_t>(by_place[i - 1])] : by_place[i];
  }
  std::vector<std::array<std::int32_t, 3>> edges;  // low end, high end, direction ±1
  edges.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int32_t a = place[static_cast<std::size_t>(t[k])];
      const std::int32_t b = place[static_cast<std::size_t>(t[(k + 1) % 3])];
      if (a != b) edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1});
    }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 0; i < edges.size();) {
    std::int32_t balance = 0;
    const auto edge = edges[i];
    for (; i < edges.size() && edges[i][0] == edge[0] && edges[i][1] == edge[1]; ++i)
      balance += edges[i][2];
    if (balance != 0) return false;
  }
  return true;
}

}  // namespace

Solid::Solid(Mesh mesh, std::size_t nodes)
    : mesh_(std::move(mesh)), outer_(mesh_), closed_(is_closed(mesh_)) {
  constexpr int reach = 3;  // grid steps within which a point searches for a clear one
  for (int k = -reach; k <= reach; ++k)
    for (int j = -reach; j <= reach; ++j)
      for (int i = -reach; i <= reach; ++i) offsets_.emplace_back(i, j, k);
  std::stable_sort(offsets_.begin(), offsets_.end(),
                   [](const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
                     return a.squaredNorm() < b.squaredNorm();
                   });
  fill_grid(nodes);
  if (std::optional<Mesh> visible = visible_part()) {
    outer_ = TriangleTree(std::move(*visible));
    fill_grid(nodes);
  }
}

Vector3d Solid::at(int i, int j, int k) const {
  return origin_ + spacing_ * Vector3d(i, j, k);
}

std::size_t Solid::index(int i, int j, int k) const {
  return static_cast<std::size_t>(i) +
         static_cast<std::size_t>(size_.x()) *
             (static_cast<std::size_t>(j) +
              static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(k));
}

// From one end of the grid to the other, as its arrays are ordered.
template <class F>
void Solid::each_point(const F& f) const {
  for (int k = 0; k < size_.z(); ++k)
    for (int j = 0; j < size_.y(); ++j)
      for (int i = 0; i < size_.x(); ++i) f(i, j, k);
}

void Solid::fill_grid(std::size_t nodes) {
  place_grid(nodes);
  const std::vector<Vector3d> nearest = measure_distances();
  find_outside();
  each_point([&](int i, int j, int k) {
    if (const std::size_t self = index(i, j, k); inside(at(i, j, k), nearest[self]))
      field_[self] = -field_[self];
  });
}

void Solid::place_grid(std::size_t nodes) {
  constexpr int margin = 2;  // points outside the surface's box: they connect the outside
  const Vector3d extent = outer_.high() - outer_.low();
  const auto points_at = [&](double h) {
    return (extent / h + Vector3d::Constant(2.0 * margin + 1.0)).prod();
  };
  double low = extent.maxCoeff() / 1000.0, high = extent.maxCoeff();
  for (int i = 0; i < 60; ++i) {
    const double h = 0.5 * (low + high);
    (points_at(h) > static_cast<double>(nodes) ? low : high) = h;
  }
  spacing_ = high;
  size_ = (extent / spacing_).array().ceil().cast<int>() + 2 * margin + 1;
  origin_ = 0.5 * (outer_.low() + outer_.high()) -
            0.5 * spacing_ * (size_ - Eigen::Vector3i::Ones()).cast<double>();
}

std::vector<Vector3d> Solid::measure_distances() {
  const auto count = static_cast<std::size_t>(size_.x()) * static_cast<std::size_t>(size_.y()) *
                     static_cast<std::size_t>(size_.z());
  field_.resize(count);
  side_.assign(count, Side::near);
  std::vector<Vector3d> nearest(count);
  const double half_diagonal = 0.5 * std::sqrt(3.0) * spacing_ * (1.0 + 1e-6);
  each_point([&](int i, int j, int k) {
    const Vector3d p = at(i, j, k);
    const std::size_t self = index(i, j, k);
    const double within =
        i > 0 ? static_cast<double>(field_[self - 1]) * (1.0 + 1e-6) + 1.01 * spacing_ : infinity;
    nearest[self] = outer_.closest(p, within);
    field_[self] = static_cast<float>((nearest[self] - p).norm());
    // docs/theory.md (13.27): no triangle enters the cube about such a point.
    if (static_cast<double>(field_[self]) > half_diagonal) side_[self] = Side::inside;
  });
  return nearest;
}

void Solid::find_outside() {
  // The outside grows from a corner through cubes without triangles. The rest is inside.
  std::vector<Eigen::Vector3i> stack{Eigen::Vector3i::Zero()};
  side_[0] = Side::outside;
  while (!stack.empty()) {
    const Eigen::Vector3i from = stack.back();
    stack.pop_back();
    for (int axis = 0; axis < 3; ++axis)
      for (const int step : {-1, 1}) {
        Eigen::Vector3i to = from;
        to[axis] += step;
        if (to[axis] < 0 || to[axis] >= size_[axis]) continue;
        Side& side = side_[index(to.x(), to.y(), to.z())];
        if (side != Side::inside) continue;
        side = Side::outside;
        stack.push_back(to);
      }
  }
  if (closed_) return;
  each_point([&](int i, int j, int k) {
    Side& side = side_[index(i, j, k)];
    if (side == Side::outside && outer_.winding(at(i, j, k)) > 0.5) side = Side::inside;
  });
}

bool Solid::inside(const Vector3d& p, const Vector3d& nearest) const {
  const auto side = [&](const Vector3d& q) {
    const Eigen::Vector3i cell = ((q - origin_) / spacing_).array().round().cast<int>();
    if ((cell.array() < 0).any() || (cell.array() >= size_.array()).any()) return Side::outside;
    return side_[index(cell.x(), cell.y(), cell.z())];
  };
  const Side here = side(p);
  if (here != Side::near) return here == Side::inside;
  // Go straight away from the surface to the first clear grid point, else to any that is visible.
  const double away = (p - nearest).norm();
  if (!(away > 0.0)) return false;
  const Vector3d step = 0.5 * spacing_ / away * (p - nearest);
  for (int i = 1; i <= 6; ++i) {
    const Vector3d there = p + i * step;
    const Side found = side(there);
    if (found == Side::near) continue;
    if (!outer_.blocked(p, there)) return found == Side::inside;
    break;
  }
  return visible_side(p, false) != Side::outside;
}

Solid::Side Solid::visible_side(const Vector3d& p, bool outside_only) const {
  constexpr int rays = 16;  // grid points that are tried at most
  const Eigen::Vector3i cell = ((p - origin_) / spacing_).array().round().cast<int>();
  int tried = 0;
  for (const Eigen::Vector3i& shift : offsets_) {
    const Eigen::Vector3i to = cell + shift;
    if ((to.array() < 0).any() || (to.array() >= size_.array()).any()) continue;
    const Side side = side_[index(to.x(), to.y(), to.z())];
    if (side == Side::near || (outside_only && side != Side::outside)) continue;
    if (!outer_.blocked(p, at(to.x(), to.y(), to.z()))) return side;
    if (++tried == rays) break;
  }
  return Side::near;
}

std::optional<Mesh> Solid::visible_part() const {
  const auto visible = [&](const Vector3d& p) { return visible_side(p, true) == Side::outside; };
  const Mesh& mesh = outer_.mesh();
  Mesh outer;
  bool hidden = false;
  std::vector<std::array<Vector3d, 3>> stack;
  for (const std::int32_t triangle : outer_.triangles()) {
    const auto t = static_cast<std::size_t>(triangle);
    stack.push_back({mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)});
    while (!stack.empty()) {
      const auto [a, b, c] = stack.back();
      stack.pop_back();
      std::array<Vector3d, 3> corners{a, b, c};
      std::size_t longest = 0;
      for (std::size_t k = 1; k < 3; ++k)
        if ((corners[(k + 1) % 3] - corners[k]).squaredNorm() >
            (corners[(longest + 1) % 3] - corners[longest]).squaredNorm())
          longest = k;
      const Vector3d &p = corners[longest], &q = corners[(longest + 1) % 3],
                     &r = corners[(longest + 2) % 3];
      if ((q - p).norm() > 2.0 * spacing_) {
        const Vector3d middle = 0.5 * (p + q);
        stack.push_back({p, middle, r});
        stack.push_back({middle, q, r});
        continue;
      }
      const Vector3d center = (p + q + r) / 3.0;
      if (!visible(center) && !visible(0.5 * (center + p)) && !visible(0.5 * (center + q)) &&
          !visible(0.5 * (center + r))) {
        hidden = true;
        continue;
      }
      const auto first = static_cast<std::int32_t>(outer.vertices.size());
      for (const Vector3d& corner : corners) outer.vertices.push_back(corner);
      outer.triangles.push_back({first, first + 1, first + 2});
    }
  }
  if (!hidden || outer.triangles.empty()) return std::nullopt;
  return outer;
}

double Solid::distance(const Vector3d& p) const {
  return (outer_.closest(p, infinity) - p).norm();
}

double Solid::signed_distance(const Vector3d& p) const {
  const Vector3d nearest = outer_.closest(p, infinity);
  const double d = (p - nearest).norm();
  return inside(p, nearest) ? -d : d;
}

double Solid::depth(const Vector3d& p) const {
  const Vector3d at_grid = (p - origin_) / spacing_;
  const Vector3d last = (size_ - Eigen::Vector3i::Ones()).cast<double>();
  const Vector3d clamped = at_grid.cwiseMax(0.0).cwiseMin(last);
  const double off_grid = spacing_ * (at_grid - clamped).norm();
  const Eigen::Vector3i cell = clamped.cast<int>().cwiseMin(size_ - Eigen::Vector3i::Constant(2));
  const Vector3d f = clamped - cell.cast<double>();
  const float* v = field_.data() + index(cell.x(), cell.y(), cell.z());
  const auto row = static_cast<std::size_t>(size_.x()),
             layer = row * static_cast<std::size_t>(size_.y());
  const auto mix = [](double t, double a, double b) { return a + t * (b - a); };
  const auto along = [&](std::size_t shift) {
    return mix(f.x(), static_cast<double>(v[shift]), static_cast<double>(v[shift + 1]));
  };
  const double value =
      mix(f.z(), mix(f.y(), along(0), along(row)), mix(f.y(), along(layer), along(layer + row)));
  return -(value + off_grid);
}

double Solid::depth(const Vector3d& from, const Vector3d& to) const {
  const int pieces = static_cast<int>(std::min(200.0, std::ceil((to - from).norm() / spacing_)));
  double least = depth(from);
  for (int i = 1; i <= pieces; ++i)
    least = std::min(least, depth(Vector3d(from + (to - from) * i / pieces)));
  return least;
}

double Solid::exact_depth(const Vector3d& from, const Vector3d& to) const {
  const int pieces = static_cast<int>(std::min(200.0, std::ceil((to - from).norm() / spacing_)));
  double most = signed_distance(from);
  for (int i = 1; i <= pieces; ++i)
    most = std::max(most, signed_distance(from + (to - from) * i / pieces));
  return -most;
}

double Solid::volume() const {
  double cells = 0.0;
  // docs/theory.md (13.39)
  for (const float d : field_)
    cells += std::clamp(0.5 - static_cast<double>(d) / spacing_, 0.0, 1.0);
  return cells * spacing_ * spacing_ * spacing_;
}

std::vector<Vector3d> Solid::inner_points() const {
  std::vector<Vector3d> points;
  each_point([&](int i, int j, int k) {
    if (static_cast<double>(field_[index(i, j, k)]) < spacing_) points.push_back(at(i, j, k));
  });
  return points;
}

}  // namespace hamelin::fit
