#include "shorten.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace hamelin::search {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int cuts = 100;            // attempts to replace a random stretch
constexpr double least_gain = 1e-3;  // by which a cut must shorten the path, as a share of it

// Leaves out way-points: from each, the line to the farthest one that it can see.
MatrixXd skip_points(const MatrixXd& points, Edges& edges) {
  std::vector<Index> kept{0};
  while (kept.back() + 1 < points.cols()) {
    const Index from = kept.back();
    Index to = points.cols() - 1;
    while (to > from + 1 && !edges.clear(points.col(from), points.col(to))) to = (from + to) / 2;
    kept.push_back(std::max(to, from + 1));
  }
  return points(Eigen::all, kept);
}

/// A place on a path: the way-point before it, and where it is behind that.
struct Place {
  Index after;
  VectorXd q;
};

Place place_at(const MatrixXd& points, double s) {
  for (Index i = 0; i + 1 < points.cols(); ++i) {
    const double segment = (points.col(i + 1) - points.col(i)).norm();
    if (s <= segment)
      return {i, points.col(i) +
                     (segment > 0.0 ? s / segment : 0.0) * (points.col(i + 1) - points.col(i))};
    s -= segment;
  }
  return {points.cols() - 2, points.rightCols(1)};
}

// The path with a straight line from a to b.
MatrixXd cut(const MatrixXd& points, const Place& a, const Place& b) {
  const Index before = a.after + 1, behind = points.cols() - 1 - b.after;
  MatrixXd out(points.rows(), before + 2 + behind);
  out.leftCols(before) = points.leftCols(before);
  out.col(before) = a.q;
  out.col(before + 1) = b.q;
  out.rightCols(behind) = points.rightCols(behind);
  return out;
}

// Leaves out way-points that coincide with their neighbour.
MatrixXd without_doubles(const MatrixXd& points) {
  std::vector<Index> kept{0};
  for (Index i = 1; i < points.cols(); ++i)
    if (i + 1 == points.cols() || (points.col(i) - points.col(kept.back())).norm() > 1e-9)
      kept.push_back(i);
  if (kept.size() > 2 &&
      (points.col(kept.back()) - points.col(kept[kept.size() - 2])).norm() <= 1e-9)
    kept.erase(kept.end() - 2);
  return points(Eigen::all, kept);
}

}  // namespace

MatrixXd shorten(const MatrixXd& points, Edges& edges, Rng& rng) {
  MatrixXd path = skip_points(points, edges);
  for (int i = 0; i < cuts && path.cols() > 2; ++i) {
    const double length = path_length(path);
    double s = rng.uniform(0.0, length), t = rng.uniform(0.0, length);
    if (s > t) std::swap(s, t);
    const Place a = place_at(path, s), b = place_at(path, t);
    if (a.after == b.after || t - s - (b.q - a.q).norm() < least_gain * length) continue;
    if (edges.clear(a.q, b.q)) path = without_doubles(cut(path, a, b));
  }
  return skip_points(path, edges);
}

}  // namespace hamelin::search
