#include "hamelin/fit/triangle_tree.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
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

TriangleTree::TriangleTree(Mesh mesh) : mesh_(std::move(mesh)) {
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
    const Vector3d a = mesh_.corner(t, 0), b = mesh_.corner(t, 1), c = mesh_.corner(t, 2);
    const double longest2 =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    // A triangle without height has no area, and its edges belong to its neighbours.
    if (area_vector(mesh_, t).norm() > 1e-9 * longest2)
      order_.push_back(static_cast<std::int32_t>(t));
  }
  if (order_.empty())
    throw Error(ErrorCode::invalid, "no triangle of its meshes has an area, expected at least one");
  nodes_.reserve(order_.size());
  (void)build(0, order_.size());
  for (const std::int32_t t : order_)
    area_ += area_vector(mesh_, static_cast<std::size_t>(t)).norm();
}

std::int32_t TriangleTree::build(std::size_t first, std::size_t last) {
  const auto self = nodes_.size();
  nodes_.emplace_back();
  Node node;
  node.low.setConstant(infinity);
  node.high.setConstant(-infinity);
  node.center.setZero();
  node.normal.setZero();
  Vector3d low_center = node.low, high_center = node.high;
  double area = 0.0;
  const auto center_of = [&](std::int32_t triangle) {
    const auto t = static_cast<std::size_t>(triangle);
    return Vector3d((mesh_.corner(t, 0) + mesh_.corner(t, 1) + mesh_.corner(t, 2)) / 3.0);
  };
  for (std::size_t i = first; i < last; ++i) {
    const auto t = static_cast<std::size_t>(order_[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      node.low = node.low.cwiseMin(mesh_.corner(t, k));
      node.high = node.high.cwiseMax(mesh_.corner(t, k));
    }
    const Vector3d center = center_of(order_[i]), normal = area_vector(mesh_, t);
    low_center = low_center.cwiseMin(center);
    high_center = high_center.cwiseMax(center);
    node.center += normal.norm() * center;
    node.normal += normal;
    area += normal.norm();
  }
  node.center /= area;
  for (std::size_t i = first; i < last; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      node.radius = std::max(
          node.radius, (mesh_.corner(static_cast<std::size_t>(order_[i]), k) - node.center).norm());
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
  nodes_[self] = node;
  return static_cast<std::int32_t>(self);
}

Vector3d TriangleTree::closest(const Vector3d& p, double within) const {
  double best2 = within * within;
  Vector3d best = Vector3d::Constant(infinity);
  std::array<std::pair<std::int32_t, double>, 64> stack;
  std::size_t top = 0;
  stack[top++] = {0, box_distance2(p, nodes_[0].low, nodes_[0].high)};
  while (top > 0) {
    const auto [at_node, node2] = stack[--top];
    if (node2 > best2) continue;
    const Node& node = nodes_[static_cast<std::size_t>(at_node)];
    if (node.count > 0) {
      for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
        const auto t = static_cast<std::size_t>(order_[static_cast<std::size_t>(i)]);
        const Vector3d c =
            closest_on_triangle(p, mesh_.corner(t, 0), mesh_.corner(t, 1), mesh_.corner(t, 2));
        const double d2 = (p - c).squaredNorm();
        if (d2 <= best2) {
          best2 = d2;
          best = c;
        }
      }
      continue;
    }
    const std::int32_t left = at_node + 1, right = node.right;
    const Node &l = nodes_[static_cast<std::size_t>(left)],
               &r = nodes_[static_cast<std::size_t>(right)];
    const double l2 = box_distance2(p, l.low, l.high), r2 = box_distance2(p, r.low, r.high);
    const bool left_first = l2 <= r2;
    stack[top++] = left_first ? std::pair{right, r2} : std::pair{left, l2};
    stack[top++] = left_first ? std::pair{left, l2} : std::pair{right, r2};
  }
  return best;
}

double TriangleTree::winding(const Vector3d& p) const {
  // docs/theory.md (13.28)–(13.30): solid angles; a far part counts as one dipole.
  constexpr double far = 2.5;
  double angle = 0.0;
  std::array<std::int32_t, 64> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::int32_t at_node = stack[--top];
    const Node& node = nodes_[static_cast<std::size_t>(at_node)];
    const Vector3d out = node.center - p;
    const double away = out.norm();
    if (away > far * node.radius) {
      angle += out.dot(node.normal) / (away * away * away);
    } else if (node.count > 0) {
      for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
        const auto t = static_cast<std::size_t>(order_[static_cast<std::size_t>(i)]);
        const Vector3d a = mesh_.corner(t, 0) - p, b = mesh_.corner(t, 1) - p,
                       c = mesh_.corner(t, 2) - p;
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

bool TriangleTree::blocked(const Vector3d& from, const Vector3d& to) const {
  // Möller, Trumbore 1997, doi:10.1080/10867651.1997.10487468. `from` may lie on the surface.
  constexpr double begin = 1e-3;
  const Vector3d way = to - from;
  std::array<std::int32_t, 64> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::int32_t at_node = stack[--top];
    const Node& node = nodes_[static_cast<std::size_t>(at_node)];
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
      const Vector3d a = mesh_.corner(t, 0), ab = mesh_.corner(t, 1) - a,
                     ac = mesh_.corner(t, 2) - a;
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

}  // namespace hamelin::fit
