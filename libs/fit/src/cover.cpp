#include "hamelin/fit/cover.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/fit/coverage.hpp"

namespace hamelin::fit {

namespace {

using Eigen::Vector3d;

constexpr double units_per_m = 1e5;  // written coordinates are multiples of 1e-5 m
constexpr double piece_m = 2.5e-4;   // size of the finest pieces in the proof of coverage
constexpr std::size_t samples_wanted = 4000;

// Keeps the first point in each cube of the given side, in the order of the cubes.
std::vector<Vector3d> thin(const std::vector<Vector3d>& points, double side) {
  std::vector<std::pair<std::array<std::int64_t, 3>, std::size_t>> keyed;
  keyed.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::array<std::int64_t, 3> cube{};
    for (int k = 0; k < 3; ++k)
      cube[static_cast<std::size_t>(k)] =
          static_cast<std::int64_t>(std::floor(points[i][k] / side));
    keyed.push_back({cube, i});
  }
  std::sort(keyed.begin(), keyed.end());
  std::vector<Vector3d> out;
  for (std::size_t i = 0; i < keyed.size(); ++i)
    if (i == 0 || keyed[i].first != keyed[i - 1].first) out.push_back(points[keyed[i].second]);
  return out;
}

// Points of the surface, about `side` apart; corners of the mesh come first.
std::vector<Vector3d> sample(const Mesh& mesh, double side) {
  std::vector<Vector3d> points = thin(mesh.vertices, 0.5 * side), extra;
  std::vector<std::array<Vector3d, 3>> stack;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    stack.push_back({mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)});
    while (!stack.empty()) {
      const auto [a, b, c] = stack.back();
      stack.pop_back();
      const double ab = (b - a).squaredNorm(), bc = (c - b).squaredNorm(),
                   ca = (a - c).squaredNorm();
      const double longest = std::max({ab, bc, ca});
      if (longest <= side * side) continue;
      const Vector3d middle = longest == ab   ? 0.5 * (a + b)
                              : longest == bc ? 0.5 * (b + c)
                                              : 0.5 * (c + a);
      extra.push_back(middle);
      if (longest == ab) {
        stack.push_back({a, middle, c});
        stack.push_back({middle, b, c});
      } else if (longest == bc) {
        stack.push_back({a, b, middle});
        stack.push_back({a, middle, c});
      } else {
        stack.push_back({a, b, middle});
        stack.push_back({middle, b, c});
      }
    }
    if (extra.size() > 200'000) extra = thin(extra, 0.5 * side);
  }
  points.insert(points.end(), extra.begin(), extra.end());
  return thin(points, 0.5 * side);
}

// An axis (both ends the same for a ball) with the surface points for which it has the least cost.
struct Item {
  Vector3d from, to;
  double depth = 0.0;
  double need = 0.0;  // largest cost in its group: the excess that the group needs
  std::vector<std::size_t> group{};
};

using Items = std::vector<Item>;

double largest_need(const Items& items) {
  double most = -infinity;
  for (const Item& item : items) most = std::max(most, item.need);
  return most;
}

class Coverer {
 public:
  Coverer(const Solid& solid, std::vector<Vector3d> samples, const CoverOptions& options)
      : solid_(solid), samples_(std::move(samples)), options_(options) {}

  std::vector<Vector3d>& samples() { return samples_; }
  [[nodiscard]] bool good(const Items& items) const {
    return items.size() <= static_cast<std::size_t>(options_.count_max) &&
           largest_need(items) <= options_.excess_m;
  }

  // Few shapes within the excess allowed. If these are more than count_max, count_max shapes with
  // the least excess found.
  Items find() {
    Items best = options_.capsules ? improved(choose_greedily(), 12) : grow_balls();
    const auto count_max = static_cast<std::size_t>(options_.count_max);
    for (std::size_t count = 1;
         count < best.size() && count <= std::min<std::size_t>(count_max, 24); ++count)
      if (Items row = improved(balls_in_a_row(count), 12); largest_need(row) <= options_.excess_m)
        best = std::move(row);
    for (;;) {
      if (best.size() <= 1) break;
      const bool too_many = best.size() > count_max;
      Items fewer = without_one(best, too_many ? 1 : 3);
      if (!too_many && largest_need(fewer) > options_.excess_m) break;
      best = std::move(fewer);
    }
    while (best.size() < count_max && largest_need(best) > options_.excess_m)
      best = improved(with_one_more(best), 12);
    return improved(std::move(best), 40);
  }

  // After samples were added: moves the axes, and adds some if that is not enough.
  Items refit(Items items) {
    items = improved(std::move(items), 20);
    while (items.size() < static_cast<std::size_t>(options_.count_max) &&
           largest_need(items) > options_.excess_m)
      items = improved(with_one_more(items), 20);
    return items;
  }

  void assign(Items& items) const {
    for (Item& item : items) {
      item.depth = solid_.exact_depth(item.from, item.to);
      item.group.clear();
      item.need = -infinity;
    }
    for (std::size_t j = 0; j < samples_.size(); ++j) {
      double least = infinity;
      std::size_t at = 0;
      for (std::size_t i = 0; i < items.size(); ++i)
        if (const double c = cost(items[i], samples_[j]); c < least) {
          least = c;
          at = i;
        }
      items[at].group.push_back(j);
      items[at].need = std::max(items[at].need, least);
    }
    items.erase(std::remove_if(items.begin(), items.end(),
                               [](const Item& item) { return item.group.empty(); }),
                items.end());
  }

 private:
  // docs/theory.md (13.32)
  static double cost(const Item& item, const Vector3d& x) {
    return segment_distance(item.from, item.to, x) - item.depth;
  }
  [[nodiscard]] Item item_at(const Vector3d& from, const Vector3d& to) const {
    return {from, to, from == to ? solid_.depth(from) : solid_.depth(from, to)};
  }

  // Grid points inside, spread evenly.
  [[nodiscard]] std::vector<Vector3d> inner(std::size_t count) const {
    auto all = solid_.inner_points();
    if (all.size() <= count) return all;
    std::vector<Vector3d> some;
    some.reserve(count);
    for (std::size_t i = 0; i < count; ++i) some.push_back(all[i * all.size() / count]);
    return some;
  }

  // Deep points that are far from each other: the ends of candidate capsules.
  [[nodiscard]] std::vector<Vector3d> ends(std::size_t count) const {
    const auto points = inner(4000);
    std::vector<double> depth(points.size()), apart(points.size(), infinity);
    double deepest = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i)
      deepest = std::max(deepest, depth[i] = solid_.depth(points[i]));
    std::vector<Vector3d> chosen;
    while (chosen.size() < std::min(count, points.size())) {
      std::size_t best = 0;
      double most = -infinity;
      for (std::size_t i = 0; i < points.size(); ++i)
        if (const double score = std::min(apart[i], deepest) + 2.0 * depth[i];
            score > most && apart[i] > 0.0) {
          most = score;
          best = i;
        }
      if (most == -infinity) break;
      chosen.push_back(points[best]);
      for (std::size_t i = 0; i < points.size(); ++i)
        apart[i] = std::min(apart[i], (points[i] - points[best]).norm());
    }
    return chosen;
  }

  [[nodiscard]] Items candidates() const {
    Items out;
    if (!options_.capsules) {
      for (const Vector3d& p : inner(1500)) out.push_back(item_at(p, p));
      return out;
    }
    const auto points = ends(44);
    for (std::size_t i = 0; i < points.size(); ++i)
      for (std::size_t j = i; j < points.size(); ++j)
        if (Item item = item_at(points[i], points[j]); item.depth > -options_.excess_m)
          out.push_back(std::move(item));
    return out;
  }

  // Balls in a row along the longest axis, a good start for rods and boxes.
  [[nodiscard]] Items balls_in_a_row(std::size_t count) const {
    Vector3d mean = Vector3d::Zero();
    for (const Vector3d& x : samples_) mean += x / static_cast<double>(samples_.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Vector3d& x : samples_) spread += (x - mean) * (x - mean).transpose();
    const Vector3d axis =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(2);
    double low = infinity, high = -infinity;
    for (const Vector3d& x : samples_) {
      low = std::min(low, axis.dot(x - mean));
      high = std::max(high, axis.dot(x - mean));
    }
    Items row;
    for (std::size_t i = 0; i < count; ++i) {
      const double at =
          low + (high - low) * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
      const Vector3d p = mean + at * axis;
      row.push_back(item_at(p, p));
    }
    return row;
  }

  // Adds balls one by one, each where the cost is largest.
  Items grow_balls() {
    const auto points = inner(4000);
    Item deepest = item_at(points.front(), points.front());
    for (const Vector3d& p : points)
      if (Item item = item_at(p, p); item.depth > deepest.depth) deepest = std::move(item);
    Items items = improved({std::move(deepest)}, 12);
    while (items.size() < static_cast<std::size_t>(options_.count_max) &&
           largest_need(items) > options_.excess_m)
      items = improved(with_one_more(items), 20);
    return items;
  }

  // Takes, again and again, the candidate that covers the most remaining samples within the excess
  // allowed.
  Items choose_greedily() const {
    Items pool = candidates();
    const double reach = options_.excess_m;
    for (Item& item : pool)
      for (std::size_t j = 0; j < samples_.size(); ++j)
        if (cost(item, samples_[j]) <= reach) item.group.push_back(j);
    std::vector<char> left(samples_.size(), 1);
    std::size_t open = samples_.size();
    Items chosen;
    while (open > 0) {
      std::size_t best = 0, most = 0;
      for (std::size_t i = 0; i < pool.size(); ++i) {
        auto& group = pool[i].group;
        if (group.size() <= most) continue;
        group.erase(
            std::remove_if(group.begin(), group.end(), [&](std::size_t j) { return left[j] == 0; }),
            group.end());
        if (group.size() > most) {
          most = group.size();
          best = i;
        }
      }
      if (most == 0) break;
      for (const std::size_t j : pool[best].group) left[j] = 0;
      open -= most;
      chosen.push_back(pool[best]);
      if (chosen.size() >= 4 * static_cast<std::size_t>(options_.count_max)) break;
    }
    if (chosen.empty()) {
      Item item = pool.empty() ? item_at(samples_.front(), samples_.front()) : pool.front();
      chosen.push_back(std::move(item));
    }
    return chosen;
  }

  // Adds the deepest ball that reaches the costliest sample at half its cost.
  Items with_one_more(Items items) {
    assign(items);
    const auto worst = std::max_element(
        items.begin(), items.end(), [](const Item& a, const Item& b) { return a.need < b.need; });
    const Item worst_item = *worst;
    Vector3d x = samples_[worst_item.group.front()];
    for (const std::size_t j : worst_item.group)
      if (cost(worst_item, samples_[j]) >= worst_item.need) x = samples_[j];
    Item best = item_at(x, x);
    for (const Vector3d& p : inner(4000)) {
      Item item = item_at(p, p);
      if (cost(item, x) <= 0.5 * worst_item.need && item.depth > best.depth) best = std::move(item);
    }
    items.push_back(std::move(best));
    return items;
  }

  // Leaves out one axis and moves the rest: the best result for the `tries` axes whose samples the
  // others reach at the least cost.
  Items without_one(const Items& items, int tries) {
    std::vector<std::pair<double, std::size_t>> loss;
    for (std::size_t i = 0; i < items.size(); ++i) {
      double most = -infinity;
      for (const std::size_t j : items[i].group) {
        double least = infinity;
        for (std::size_t other = 0; other < items.size(); ++other)
          if (other != i) least = std::min(least, cost(items[other], samples_[j]));
        most = std::max(most, least);
      }
      loss.emplace_back(most, i);
    }
    std::sort(loss.begin(), loss.end());
    Items best;
    double least = infinity;
    for (std::size_t k = 0; k < std::min(loss.size(), static_cast<std::size_t>(tries)); ++k) {
      Items fewer = items;
      fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(loss[k].second));
      fewer = improved(std::move(fewer), 20);
      if (const double largest = largest_need(fewer); largest < least) {
        least = largest;
        best = std::move(fewer);
      }
      if (least <= options_.excess_m) break;
    }
    return best;
  }

  // Moves axes and reassigns samples in turn. Returns the best of all rounds.
  Items improved(Items items, int rounds) {
    assign(items);
    Items best = items;
    double least = largest_need(best);
    int idle = 0;
    for (int round = 0; round < rounds && idle < 4; ++round) {
      for (Item& item : items) descend(item);
      assign(items);
      const double largest = largest_need(items);
      idle = largest < least - 1e-5 ? 0 : idle + 1;
      if (largest < least) {
        least = largest;
        best = items;
      }
    }
    return best;
  }

  // Moves one axis to lower the largest cost of its group: steps along random directions, halved
  // when none helps.
  void descend(Item& item) {
    item.depth = item_at(item.from, item.to).depth;  // from the grid, as for the trials
    // The samples with the largest cost decide on small steps, some others on steps that are too
    // large.
    constexpr std::size_t worst_watched = 96, others_watched = 160;
    std::vector<std::pair<double, std::size_t>> costs;
    for (const std::size_t j : item.group) costs.emplace_back(-cost(item, samples_[j]), j);
    std::size_t watched = std::min(worst_watched, costs.size());
    std::nth_element(costs.begin(), costs.begin() + static_cast<std::ptrdiff_t>(watched - 1),
                     costs.end());
    const std::size_t stride = std::max<std::size_t>(1, (costs.size() - watched) / others_watched);
    for (std::size_t w = watched; w < costs.size(); w += stride) costs[watched++] = costs[w];
    const auto worst = [&](const Item& at) {
      double most = -infinity;
      for (std::size_t w = 0; w < watched; ++w)
        most = std::max(most, cost(at, samples_[costs[w].second]));
      return most;
    };
    double now = worst(item);
    const double first_step =
        options_.capsules ? 0.5 * options_.excess_m : 0.25 * options_.excess_m;
    for (double step = std::max(first_step, 4e-4); step > 1e-4;) {
      // one after another: the order in which arguments are evaluated depends on the compiler
      const double z = rng_.normal(), y = rng_.normal(), x = rng_.normal();
      const Vector3d u = Vector3d(x, y, z).normalized();
      const Vector3d v = u.unitOrthogonal(), w = u.cross(v);
      bool moved = false;
      const auto attempt = [&](const Vector3d& from, const Vector3d& to) {
        const Item next = item_at(from, to);
        const double then = worst(next);
        if (then >= now) return false;
        now = then;
        item.from = next.from;
        item.to = next.to;
        item.depth = next.depth;
        return moved = true;
      };
      for (const Vector3d& way : {u, v, w})
        for (const double sign : {step, -step}) {
          const Vector3d shift = sign * way;
          if (options_.capsules) {
            if (attempt(item.from + shift, item.to)) continue;
            if (attempt(item.from, item.to + shift)) continue;
            (void)attempt(item.from + shift, item.to + shift);
          } else {
            const Vector3d at = item.from + shift;
            (void)attempt(at, at);
          }
        }
      if (!moved) step *= 0.5;
    }
  }

  const Solid& solid_;
  std::vector<Vector3d> samples_;
  const CoverOptions& options_;
  Rng rng_{1};
};

Vector3d rounded(const Vector3d& p) {
  return (p * units_per_m).array().round().matrix() / units_per_m;
}

}  // namespace

Cover cover(const Solid& solid, const std::vector<Shape>& covered, const CoverOptions& options) {
  const double side =
      std::max(1e-3, std::sqrt(2.0 * solid.area() / static_cast<double>(samples_wanted)));
  const auto is_covered = [&](const Vector3d& p) {
    return std::any_of(covered.begin(), covered.end(),
                       [&](const Shape& ball) { return distance(ball, p) < 0.0; });
  };
  std::vector<Vector3d> samples;
  for (const Vector3d& p : sample(solid.mesh(), side))
    if (!is_covered(p)) samples.push_back(p);
  Cover best;
  if (samples.empty()) {
    if (coverage_gap(solid.mesh(), covered, 1e-6).bound_m <= 0.0) return best;
    samples = solid.mesh().vertices;
  }
  Coverer coverer(solid, std::move(samples), options);
  Items items = coverer.find();
  const auto excess_bound_of = [&](const Shape& shape) {
    return shape.radius_m - solid.exact_depth(shape.from, shape.to);
  };
  // Samples do not show the surface between them. Points where radii were raised join them.
  constexpr int rounds = 6;
  for (int round = 0; round < rounds; ++round) {
    for (Item& item : items) {
      const bool ball = item.from == item.to;
      item.from = rounded(item.from);
      item.to = ball ? item.from : rounded(item.to);
    }
    coverer.assign(items);
    Cover now;
    for (const Item& item : items)
      // docs/theory.md (13.33)
      now.shapes.push_back(
          {item.from, item.to, std::max(1.0 / units_per_m, item.need + item.depth)});
    std::vector<Shape> all = now.shapes;
    const auto raised = close_gaps(solid.mesh(), covered, all, piece_m);
    now.excess_bound_m = -infinity;
    for (std::size_t i = 0; i < now.shapes.size(); ++i) {
      // docs/theory.md (13.36)
      now.shapes[i].radius_m = std::ceil((all[i].radius_m + 1e-9) * units_per_m) / units_per_m;
      now.excess_bound_m = std::max(now.excess_bound_m, excess_bound_of(now.shapes[i]));
    }
    if (best.shapes.empty() || now.excess_bound_m < best.excess_bound_m) best = now;
    if (raised.empty() || now.excess_bound_m <= options.excess_m) break;
    for (const Vector3d& p : thin(raised, 1e-3)) coverer.samples().push_back(p);
    items = coverer.refit(std::move(items));
  }
  return best;
}

}  // namespace hamelin::fit
