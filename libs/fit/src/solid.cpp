#include "hamelin/fit/solid.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"

namespace hamelin::fit {

namespace {

using Eigen::Vector3d;

constexpr int leaf_triangles = 4;

// Nearest point of a triangle with an area (Ericson, Real-Time Collision Detection, 2005, 5.1.5).
Vector3d closest_on_triangle(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                             const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return a;
  const Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return a + d1 / (d1 - d3) * ab;
  const Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0)
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const double sum = va + vb + vc;
  return a + vb / sum * ab + vc / sum * ac;
}

double box_distance2(const Vector3d& p, const Vector3d& low, const Vector3d& high) {
  return (low - p).cwiseMax(p - high).cwiseMax(0.0).squaredNorm();
}

Vector3d area_vector(const Mesh& mesh, std::size_t t) {
  return 0.5 * (mesh.corner(t, 1) - mesh.corner(t, 0)).cross(mesh.corner(t, 2) - mesh.corner(t, 0));
}

}  // namespace

Solid::Solid(Mesh mesh, std::size_t nodes) : mesh_(std::move(mesh)), outer_(mesh_) {
  constexpr int reach = 3;  // grid steps within which a point searches for a clear one
  for (int k = -reach; k <= reach; ++k)
    for (int j = -reach; j <= reach; ++j)
      for (int i = -reach; i <= reach; ++i) offsets_.emplace_back(i, j, k);
  std::stable_sort(offsets_.begin(), offsets_.end(),
                   [](const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
                     return a.squaredNorm() < b.squaredNorm();
                   });
  find_closed();
  build_tree();
  fill_grid(nodes);
  if (remove_hidden_triangles()) {
    build_tree();
    fill_grid(nodes);
  }
}

void Solid::build_tree() {
  order_.clear();
  tree_.clear();
  for (std::size_t t = 0; t < outer_.triangles.size(); ++t) {
    const Vector3d a = outer_.corner(t, 0), b = outer_.corner(t, 1), c = outer_.corner(t, 2);
    const double longest2 =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    // A triangle without height has no area, and its edges belong to its neighbours.
    if (area_vector(outer_, t).norm() > 1e-9 * longest2)
      order_.push_back(static_cast<std::int32_t>(t));
  }
  if (order_.empty())
    throw Error(ErrorCode::invalid, "no triangle of its meshes has an area, expected at least one");
  tree_.reserve(order_.size());
  (void)build(0, order_.size());
  area_ = 0.0;
  for (const std::int32_t t : order_)
    area_ += area_vector(outer_, static_cast<std::size_t>(t)).norm();
}

std::int32_t Solid::build(std::size_t first, std::size_t last) {
  const auto self = tree_.size();
  tree_.emplace_back();
  Node node;
  node.low.setConstant(infinity);
  node.high.setConstant(-infinity);
  node.center.setZero();
  node.normal.setZero();
  Vector3d low_center = node.low, high_center = node.high;
  double area = 0.0;
  const auto center_of = [&](std::int32_t triangle) {
    const auto t = static_cast<std::size_t>(triangle);
    return Vector3d((outer_.corner(t, 0) + outer_.corner(t, 1) + outer_.corner(t, 2)) / 3.0);
  };
  for (std::size_t i = first; i < last; ++i) {
    const auto t = static_cast<std::size_t>(order_[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      node.low = node.low.cwiseMin(outer_.corner(t, k));
      node.high = node.high.cwiseMax(outer_.corner(t, k));
    }
    const Vector3d center = center_of(order_[i]), normal = area_vector(outer_, t);
    low_center = low_center.cwiseMin(center);
    high_center = high_center.cwiseMax(center);
    node.center += normal.norm() * center;
    node.normal += normal;
    area += normal.norm();
  }
  node.center /= area;
  for (std::size_t i = first; i < last; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      node.radius =
          std::max(node.radius,
                   (outer_.corner(static_cast<std::size_t>(order_[i]), k) - node.center).norm());
  node.first = static_cast<std::int32_t>(first);
  if (last - first <= leaf_triangles) {
    node.count = static_cast<std::int32_t>(last - first);
  } else {
    Eigen::Index axis = 0;
    (high_center - low_center).maxCoeff(&axis);
    const auto middle = first + (last - first) / 2;
    const auto begin = order_.begin();
    std::nth_element(
        begin + static_cast<std::ptrdiff_t>(first), begin + static_cast<std::ptrdiff_t>(middle),
        begin + static_cast<std::ptrdiff_t>(last), [&](std::int32_t x, std::int32_t y) {
          const double cx = center_of(x)[axis], cy = center_of(y)[axis];
          return cx != cy ? cx < cy : x < y;
        });
    (void)build(first, middle);
    node.right = build(middle, last);
  }
  tree_[self] = node;
  return static_cast<std::int32_t>(self);
}

void Solid::find_closed() {
  // Corners at the same place count as one, even if the file has several vertices there.
  std::vector<std::int32_t> by_place(mesh_.vertices.size()), place(mesh_.vertices.size());
  for (std::size_t i = 0; i < by_place.size(); ++i) by_place[i] = static_cast<std::int32_t>(i);
  const auto vertex = [&](std::int32_t i) -> const Vector3d& {
    return mesh_.vertices[static_cast<std::size_t>(i)];
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
  edges.reserve(3 * mesh_.triangles.size());
  for (const auto& t : mesh_.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int32_t a = place[static_cast<std::size_t>(t[k])];
      const std::int32_t b = place[static_cast<std::size_t>(t[(k + 1) % 3])];
      if (a != b) edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1});
    }
  std::sort(edges.begin(), edges.end());
  closed_ = true;
  for (std::size_t i = 0; i < edges.size() && closed_;) {
    std::int32_t balance = 0;
    const auto edge = edges[i];
    for (; i < edges.size() && edges[i][0] == edge[0] && edges[i][1] == edge[1]; ++i)
      balance += edges[i][2];
    closed_ = balance == 0;
  }
}

Vector3d Solid::closest(const Vector3d& p, double within) const {
  double best2 = within * within;
  Vector3d best = Vector3d::Constant(infinity);
  std::array<std::pair<std::int32_t, double>, 64> stack;
  std::size_t top = 0;
  stack[top++] = {0, box_distance2(p, tree_[0].low, tree_[0].high)};
  while (top > 0) {
    const auto [at_node, node2] = stack[--top];
    if (node2 > best2) continue;
    const Node& node = tree_[static_cast<std::size_t>(at_node)];
    if (node.count > 0) {
      for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
        const auto t = static_cast<std::size_t>(order_[static_cast<std::size_t>(i)]);
        const Vector3d c =
            closest_on_triangle(p, outer_.corner(t, 0), outer_.corner(t, 1), outer_.corner(t, 2));
        const double d2 = (p - c).squaredNorm();
        if (d2 <= best2) {
          best2 = d2;
          best = c;
        }
      }
      continue;
    }
    const std::int32_t left = at_node + 1, right = node.right;
    const Node &l = tree_[static_cast<std::size_t>(left)],
               &r = tree_[static_cast<std::size_t>(right)];
    const double l2 = box_distance2(p, l.low, l.high), r2 = box_distance2(p, r.low, r.high);
    const bool left_first = l2 <= r2;
    stack[top++] = left_first ? std::pair{right, r2} : std::pair{left, l2};
    stack[top++] = left_first ? std::pair{left, l2} : std::pair{right, r2};
  }
  return best;
}

double Solid::distance(const Vector3d& p) const {
  return (closest(p, infinity) - p).norm();
}

double Solid::winding(const Vector3d& p) const {
  // docs/theory.md (13.28)–(13.30): solid angles; a far part counts as one dipole.
  constexpr double far = 2.5;
  double angle = 0.0;
  std::array<std::int32_t, 64> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::int32_t at_node = stack[--top];
    const Node& node = tree_[static_cast<std::size_t>(at_node)];
    const Vector3d out = node.center - p;
    const double away = out.norm();
    if (away > far * node.radius) {
      angle += out.dot(node.normal) / (away * away * away);
    } else if (node.count > 0) {
      for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
        const auto t = static_cast<std::size_t>(order_[static_cast<std::size_t>(i)]);
        const Vector3d a = outer_.corner(t, 0) - p, b = outer_.corner(t, 1) - p,
                       c = outer_.corner(t, 2) - p;
        const double la = a.norm(), lb = b.norm(), lc = c.norm();
        angle += 2.0 * std::atan2(a.dot(b.cross(c)),
                                  la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
      }
    } else {
      stack[top++] = at_node + 1;
      stack[top++] = node.right;
    }
  }
  return std::abs(angle) / (4.0 * std::numbers::pi);
}

bool Solid::blocked(const Vector3d& from, const Vector3d& to) const {
  // Whether a triangle crosses the segment (Möller, Trumbore 1997,
  // doi:10.1080/10867651.1997.10487468). A triangle at its first thousandth does not count: `from`
  // may lie on the surface.
  constexpr double begin = 1e-3;
  const Vector3d way = to - from;
  std::array<std::int32_t, 64> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::int32_t at_node = stack[--top];
    const Node& node = tree_[static_cast<std::size_t>(at_node)];
    double first = 0.0, last = 1.0;
    for (int k = 0; k < 3; ++k) {
      if (std::abs(way[k]) < 1e-300) {
        if (from[k] < node.low[k] || from[k] > node.high[k]) last = -1.0;
        continue;
      }
      const double a = (node.low[k] - from[k]) / way[k], b = (node.high[k] - from[k]) / way[k];
      first = std::max(first, std::min(a, b) - 1e-9);
      last = std::min(last, std::max(a, b) + 1e-9);
    }
    if (first > last) continue;
    if (node.count == 0) {
      stack[top++] = at_node + 1;
      stack[top++] = node.right;
      continue;
    }
    for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
      const auto t = static_cast<std::size_t>(order_[static_cast<std::size_t>(i)]);
      const Vector3d a = outer_.corner(t, 0), ab = outer_.corner(t, 1) - a,
                     ac = outer_.corner(t, 2) - a;
      const Vector3d h = way.cross(ac);
      const double det = ab.dot(h);
      if (std::abs(det) < 1e-300) continue;
      const Vector3d out = from - a, q = out.cross(ab);
      const double u = out.dot(h) / det, v = way.dot(q) / det, where = ac.dot(q) / det;
      if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && where > begin && where <= 1.0) return true;
    }
  }
  return false;
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
    if (!blocked(p, at(to.x(), to.y(), to.z()))) return side;
    if (++tried == rays) break;
  }
  return Side::near;
}

bool Solid::remove_hidden_triangles() {
  const auto visible = [&](const Vector3d& p) { return visible_side(p, true) == Side::outside; };
  Mesh outer;
  bool hidden = false;
  std::vector<std::array<Vector3d, 3>> stack;
  for (const std::int32_t triangle : order_) {
    const auto t = static_cast<std::size_t>(triangle);
    stack.push_back({outer_.corner(t, 0), outer_.corner(t, 1), outer_.corner(t, 2)});
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
  if (!hidden || outer.triangles.empty()) return false;
  outer_ = std::move(outer);
  return true;
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

void Solid::fill_grid(std::size_t nodes) {
  constexpr int margin = 2;  // points outside the surface's box: they connect the outside
  const Node& all = tree_.front();
  const Vector3d extent = all.high - all.low;
  // The smallest spacing for which the points, margin included, are at most `nodes`.
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
  origin_ = 0.5 * (all.low + all.high) -
            0.5 * spacing_ * (size_ - Eigen::Vector3i::Ones()).cast<double>();

  const auto count = static_cast<std::size_t>(size_.x()) * static_cast<std::size_t>(size_.y()) *
                     static_cast<std::size_t>(size_.z());
  field_.resize(count);
  side_.assign(count, Side::near);
  std::vector<Vector3d> nearest(count);
  const double half_diagonal = 0.5 * std::sqrt(3.0) * spacing_ * (1.0 + 1e-6);
  for (int k = 0; k < size_.z(); ++k)
    for (int j = 0; j < size_.y(); ++j)
      for (int i = 0; i < size_.x(); ++i) {
        const Vector3d p = at(i, j, k);
        const std::size_t self = index(i, j, k);
        const double within =
            i > 0 ? static_cast<double>(field_[self - 1]) * (1.0 + 1e-6) + 1.01 * spacing_
                  : infinity;
        nearest[self] = closest(p, within);
        field_[self] = static_cast<float>((nearest[self] - p).norm());
        // docs/theory.md (13.27): no triangle enters the cube about such a point.
        if (static_cast<double>(field_[self]) > half_diagonal) side_[self] = Side::inside;
      }
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
  for (int k = 0; k < size_.z() && !closed_; ++k)
    for (int j = 0; j < size_.y(); ++j)
      for (int i = 0; i < size_.x(); ++i) {
        Side& side = side_[index(i, j, k)];
        if (side == Side::outside && winding(at(i, j, k)) > 0.5) side = Side::inside;
      }
  for (int k = 0; k < size_.z(); ++k)
    for (int j = 0; j < size_.y(); ++j)
      for (int i = 0; i < size_.x(); ++i)
        if (const std::size_t self = index(i, j, k); inside(at(i, j, k), nearest[self]))
          field_[self] = -field_[self];
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
    if (!blocked(p, there)) return found == Side::inside;
    break;
  }
  return visible_side(p, false) != Side::outside;
}

double Solid::signed_distance(const Vector3d& p) const {
  const Vector3d nearest = closest(p, infinity);
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
  for (int k = 0; k < size_.z(); ++k)
    for (int j = 0; j < size_.y(); ++j)
      for (int i = 0; i < size_.x(); ++i)
        if (static_cast<double>(field_[index(i, j, k)]) < spacing_) points.push_back(at(i, j, k));
  return points;
}

}  // namespace hamelin::fit
