#include "hamelin/fit/coverage.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "hamelin/core/numbers.hpp"

namespace hamelin::fit {

namespace {

using Eigen::Vector3d;

// Cutting stops at this number in any case; the bound then is what was reached.
constexpr std::size_t pieces_max = 40'000'000;
// Shorter pieces are cut only to reach the tolerance. Less than half the size that close_gaps
// leaves uncut.
constexpr double finest_m = 1e-4;

using Piece = std::array<Vector3d, 3>;

// Cuts a piece at the middle of its longest edge, into `one` and `other`. Returns that edge's
// length.
double cut(const Piece& piece, Piece& one, Piece& other) {
  std::size_t longest = 0;
  double length2 = -1.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double square = (piece[(k + 1) % 3] - piece[k]).squaredNorm();
    if (square > length2) {
      length2 = square;
      longest = k;
    }
  }
  const Vector3d &a = piece[longest], &b = piece[(longest + 1) % 3], &c = piece[(longest + 2) % 3];
  const Vector3d middle = 0.5 * (a + b);
  one = {a, middle, c};
  other = {middle, b, c};
  return std::sqrt(length2);
}

// The shape out of which a piece sticks least, and how far at most: docs/theory.md (13.34).
struct BestShape {
  double out = infinity;
  std::size_t shape = 0;
};

BestShape best_shape(const Piece& piece, std::span<const Shape> shapes, std::size_t guess) {
  const auto out_of = [&](std::size_t i) {
    return std::max({distance(shapes[i], piece[0]), distance(shapes[i], piece[1]),
                     distance(shapes[i], piece[2])});
  };
  BestShape best;
  if (guess < shapes.size()) best = {out_of(guess), guess};
  for (std::size_t i = 0; i < shapes.size() && best.out > 0.0; ++i)
    if (const double out = out_of(i); out < best.out) best = {out, i};
  return best;
}

}  // namespace

Gap coverage_gap(const Mesh& mesh, std::span<const Shape> shapes, double tolerance_m) {
  Gap gap;
  if (shapes.empty()) return {infinity, infinity, mesh.corner(0, 0)};
  std::size_t pieces = 0, guess = 0;
  const auto update_found = [&](const Vector3d& corner) {
    double least = infinity;
    for (const Shape& shape : shapes) least = std::min(least, distance(shape, corner));
    if (least > gap.found_m) {
      gap.found_m = least;
      gap.point = corner;
    }
  };
  // The mesh's own corners come first: a large gap found early saves cutting.
  for (const Vector3d& vertex : mesh.vertices) update_found(vertex);
  std::vector<std::pair<Piece, double>> stack;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    stack.push_back({{mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)}, infinity});
    while (!stack.empty()) {
      const auto [piece, before] = stack.back();
      stack.pop_back();
      const BestShape best = best_shape(piece, shapes, guess);
      guess = best.shape;
      const double out = std::min(before, best.out);
      if (out <= 0.0) continue;
      Piece one, other;
      const double longest = cut(piece, one, other);
      // Nothing found to stick out so far: cutting further may prove that nothing does.
      const bool may_be_covered = gap.found_m == 0.0 && longest > finest_m;
      if ((out <= gap.found_m + tolerance_m && !may_be_covered) || ++pieces > pieces_max) {
        gap.bound_m = std::max(gap.bound_m, out);
        continue;
      }
      update_found(one[1]);  // the middle of the edge
      stack.push_back({one, out});
      stack.push_back({other, out});
    }
  }
  return gap;
}

std::vector<Vector3d> close_gaps(const Mesh& mesh, std::span<const Shape> fixed,
                                 std::span<Shape> shapes, double piece_m) {
  std::vector<Vector3d> raised;
  if (shapes.empty()) return raised;
  std::vector<double> before;
  for (const Shape& shape : shapes) before.push_back(shape.radius_m);
  std::vector<Piece> stack;
  std::size_t guess = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    stack.push_back({mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)});
    while (!stack.empty()) {
      const Piece piece = stack.back();
      stack.pop_back();
      const BestShape best = best_shape(piece, shapes, guess);
      guess = best.shape;
      if (best.out <= 0.0 || (!fixed.empty() && best_shape(piece, fixed, 0).out <= 0.0)) continue;
      Piece one, other;
      if (cut(piece, one, other) > piece_m) {
        stack.push_back(one);
        stack.push_back(other);
        continue;
      }
      if (shapes[best.shape].radius_m + best.out > before[best.shape] + piece_m)
        raised.emplace_back((piece[0] + piece[1] + piece[2]) / 3.0);
      // A little more than rounding, so that the distance is computed as at most 0.
      shapes[best.shape].radius_m += best.out + 1e-12;
    }
  }
  return raised;
}

SurfacePoints surface_points(const Shape& shape, std::size_t count) {
  SurfacePoints out;
  const Vector3d along = shape.to - shape.from;
  const double length = along.norm(), r = shape.radius_m;
  const Vector3d z = length > 0.0 ? Vector3d(along / length) : Vector3d::UnitZ();
  const Vector3d x = z.unitOrthogonal(), y = z.cross(x);
  // docs/theory.md (13.37): equal steps along the axis carry equal areas (Archimedes).
  const double reach = 2.0 * r + length;
  out.area_each_m2 = 2.0 * std::numbers::pi * r * reach / static_cast<double>(count);
  const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
  for (std::size_t i = 0; i < count; ++i) {
    // height along z, from `from`
    const double h = reach * (static_cast<double>(i) + 0.5) / static_cast<double>(count) - r;
    const double beyond = h < 0.0 ? h : std::max(0.0, h - length);
    const double ring = std::sqrt(std::max(0.0, r * r - beyond * beyond));
    const double turn = golden * static_cast<double>(i);
    out.points.push_back(shape.from + h * z + ring * (std::cos(turn) * x + std::sin(turn) * y));
  }
  return out;
}

Excess excess(const Solid* solid, std::span<const Shape> balls, std::span<const Shape> shapes) {
  constexpr std::size_t points_per_shape = 1500;
  Excess out;
  for (std::size_t s = 0; s < shapes.size(); ++s) {
    const SurfacePoints surface = surface_points(shapes[s], points_per_shape);
    for (const Vector3d& p : surface.points) {
      bool buried = false;
      for (std::size_t other = 0; other < shapes.size() && !buried; ++other)
        buried = other != s && distance(shapes[other], p) < -1e-9;
      if (buried) continue;
      double beyond = solid == nullptr ? infinity : solid->signed_distance(p);
      for (const Shape& ball : balls) beyond = std::min(beyond, distance(ball, p));
      beyond = std::max(0.0, beyond);
      out.max_m = std::max(out.max_m, beyond);
      out.mean_m += beyond * surface.area_each_m2;
      out.area_m2 += surface.area_each_m2;
    }
  }
  // docs/theory.md (13.38)
  if (out.area_m2 > 0.0) out.mean_m /= out.area_m2;

  // The volume, by cubes: docs/theory.md (13.39).
  constexpr double cubes = 200'000.0;
  Vector3d low = Vector3d::Constant(infinity), high = -low;
  for (const Shape& shape : shapes)
    for (const Vector3d& end : {shape.from, shape.to}) {
      low = low.cwiseMin(end - Vector3d::Constant(shape.radius_m));
      high = high.cwiseMax(end + Vector3d::Constant(shape.radius_m));
    }
  if (shapes.empty()) return out;
  const double side = std::cbrt((high - low).prod() / cubes);
  const Eigen::Vector3i size = ((high - low) / side).array().ceil().cast<int>();
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        const Vector3d p = low + side * Vector3d(i + 0.5, j + 0.5, k + 0.5);
        double least = infinity;
        for (const Shape& shape : shapes) least = std::min(least, distance(shape, p));
        out.volume_m3 += std::clamp(0.5 - least / side, 0.0, 1.0) * side * side * side;
      }
  return out;
}

}  // namespace hamelin::fit
