#include "hamelin/bench/families.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/make.hpp"
#include "layout.hpp"

namespace hamelin::bench {

using Eigen::Vector3d;

namespace {

// The dimensions of all families are for an arm with a reach of about 0.9 m. README.md describes
// them. Numbers are drawn in declarations and in braces: C++ evaluates these in order, but the
// arguments of a function in any order.

struct ShelfSize {
  int columns, rows;
  double width, height, depth, bottom;  ///< width and height of one compartment [m]
};

// A shelf with its open side towards the arm, in the current frame, whose x points into it.
void add_shelf(LayoutBuilder& b, const ShelfSize& s) {
  constexpr double t = 0.02;  // of boards
  const double width = s.columns * (s.width + t) + t;
  for (int i = 0; i <= s.rows; ++i)
    b.box(fmt::format("board {}", i), {0.5 * s.depth, 0.0, s.bottom + i * (s.height + t) - 0.5 * t},
          {s.depth, width, t});
  const double height = s.rows * (s.height + t);
  for (int i = 0; i <= s.columns; ++i)
    b.box(fmt::format("side {}", i),
          {0.5 * s.depth, i * (s.width + t) + 0.5 * t - 0.5 * width, s.bottom + 0.5 * (height - t)},
          {s.depth, t, height});
  b.box("back", {s.depth + 0.5 * t, 0.0, s.bottom + 0.5 * (height - t)}, {t, width, height});
  const int compartments = s.columns * s.rows, first = b.below(compartments),
            second = (first + 1 + b.below(compartments - 1)) % compartments;
  const auto inside = [&](int index) {
    const int column = index % s.columns, row = index / s.columns;
    const double y = (column + 0.5) * (s.width + t) + 0.5 * t - 0.5 * width,
                 z = s.bottom + row * (s.height + t);
    return b.room({0.05, y - 0.5 * s.width + 0.07, z + 0.07},
                  {s.depth - 0.05, y + 0.5 * s.width - 0.07, z + s.height - 0.09});
  };
  b.layout.start = inside(first);
  b.layout.goal = inside(second);
}

void shelf(LayoutBuilder& b) {
  b.set_frame({b.uniform(0.48, 0.56), b.uniform(-0.1, 0.1), b.uniform(-0.08, 0.08)});
  add_shelf(b, {2, 2, b.uniform(0.38, 0.48), b.uniform(0.30, 0.36), b.uniform(0.28, 0.36),
                b.uniform(0.10, 0.25)});
}

void tall_shelf(LayoutBuilder& b) {
  b.set_frame({b.uniform(0.46, 0.54), b.uniform(-0.2, 0.2), b.uniform(-0.2, 0.2)});
  add_shelf(b, {1, 4, b.uniform(0.36, 0.44), b.uniform(0.24, 0.29), b.uniform(0.25, 0.32),
                b.uniform(0.02, 0.10)});
}

// An open box on a pedestal; the tip is inside.
Room add_bin(LayoutBuilder& b, const std::string& name, double side) {
  constexpr double t = 0.02;
  b.set_frame({b.uniform(0.40, 0.52), side * b.uniform(0.27, 0.36), b.uniform(-0.15, 0.15)});
  const double x = b.uniform(0.32, 0.42), y = b.uniform(0.30, 0.40), height = b.uniform(0.20, 0.30),
               bottom = b.uniform(0.05, 0.20), middle = bottom + 0.5 * height;
  b.box(name + " floor", {0.0, 0.0, bottom - 0.5 * t}, {x + 2.0 * t, y + 2.0 * t, t});
  for (const int s : {-1, 1}) {
    b.box(fmt::format("{} side {}", name, s), {0.0, s * 0.5 * (y + t), middle},
          {x + 2.0 * t, t, height});
    b.box(fmt::format("{} end {}", name, s), {s * 0.5 * (x + t), 0.0, middle}, {t, y, height});
  }
  return b.room({-0.5 * x + 0.07, -0.5 * y + 0.07, bottom + 0.06},
                {0.5 * x - 0.07, 0.5 * y - 0.07, bottom + height - 0.06});
}

void bins(LayoutBuilder& b) {
  const double side = b.below(2) == 0 ? 1.0 : -1.0;
  b.layout.start = add_bin(b, "bin 1", side);
  b.layout.goal = add_bin(b, "bin 2", -side);
}

void cage(LayoutBuilder& b) {
  const double s = b.uniform(0.50, 0.60), bottom = b.uniform(0.10, 0.25), top = bottom + s,
               r = b.uniform(0.010, 0.016), h = 0.5 * s;
  b.set_frame({b.uniform(0.58, 0.66), b.uniform(-0.1, 0.1), b.uniform(-0.2, 0.2)});
  int bar = 0;
  const auto upright = [&](double x, double y) {
    b.post(fmt::format("bar {}", bar++), x, y, bottom, top, r);
  };
  for (const int side : {-1, 1}) {
    for (const int end : {-1, 1}) upright(side * h, end * h);
    upright(side * h, b.uniform(-0.05, 0.05));
    upright(b.uniform(-0.05, 0.05), side * h);
  }
  for (const double z : {bottom, top})
    for (const int side : {-1, 1}) {
      b.box(fmt::format("rail {}", bar++), {side * h, 0.0, z}, {0.03, s, 0.03});
      b.box(fmt::format("rail {}", bar++), {0.0, side * h, z}, {s, 0.03, 0.03});
    }
  b.box("roof rail", {0.0, 0.0, top}, {s, 0.03, 0.03});
  const double side = b.below(2) == 0 ? 1.0 : -1.0;
  Room inside = b.room({-h + 0.1, -h + 0.1, bottom + 0.1}, {h - 0.1, h - 0.1, top - 0.1});
  Room outside = b.room({-h, side > 0 ? h + 0.08 : -h - 0.30, bottom},
                        {h, side > 0 ? h + 0.30 : -h - 0.08, top});
  if (b.below(2) == 0) std::swap(inside, outside);
  b.layout.start = inside;
  b.layout.goal = outside;
}

void table(LayoutBuilder& b) {
  const double top = b.uniform(0.08, 0.22);
  b.set_frame({});
  b.box("table", {0.65, 0.0, top - 0.015}, {0.8, 1.5, 0.03});
  const int count = 10 + b.below(5);
  for (int i = 0; i < count; ++i) {
    const double x = b.uniform(0.32, 0.95), y = b.uniform(-0.65, 0.65),
                 height = b.uniform(0.12, 0.42), a = b.uniform(0.05, 0.14),
                 c = b.uniform(0.05, 0.14), yaw = b.uniform(-0.4, 0.4);
    const bool round = b.below(2) == 0;
    b.set_frame({x, y, yaw});
    if (round)
      b.post(fmt::format("object {}", i), 0.0, 0.0, top, top + height, 0.5 * a);
    else
      b.box(fmt::format("object {}", i), {0.0, 0.0, top + 0.5 * height}, {a, c, height});
  }
  b.set_frame({});
  const double side = b.below(2) == 0 ? 1.0 : -1.0;
  const auto half = [&](double s) {
    return b.room({0.35, s > 0 ? 0.15 : -0.55, top + 0.09},
                  {0.75, s > 0 ? 0.55 : -0.15, top + 0.2});
  };
  b.layout.start = half(side);
  b.layout.goal = half(-side);
}

void under_table(LayoutBuilder& b) {
  const double top = b.uniform(0.44, 0.56), front = b.uniform(0.30, 0.40),
               depth = b.uniform(0.55, 0.75), width = b.uniform(0.8, 1.2);
  b.set_frame({front, b.uniform(-0.15, 0.15), b.uniform(-0.1, 0.1)});
  b.box("table top", {0.5 * depth, 0.0, top - 0.015}, {depth, width, 0.03});
  for (const int side : {-1, 1})
    for (const double x : {0.03, depth - 0.03})
      b.box(fmt::format("leg {} {}", side, x < 0.1 ? 1 : 2),
            {x, side * (0.5 * width - 0.03), 0.5 * (top - 0.03)}, {0.05, 0.05, top - 0.03});
  Room above = b.room({0.0, -0.35, top + 0.08}, {0.35, 0.35, top + 0.3}),
       below = b.room({0.08, -0.35, 0.06}, {0.40, 0.35, top - 0.12});
  if (b.below(2) == 0) std::swap(above, below);
  b.layout.start = above;
  b.layout.goal = below;
}

void pillars(LayoutBuilder& b) {
  const int count = 6 + b.below(4);
  std::vector<Eigen::Vector2d> placed;
  for (int tries = 0; tries < 1000 && static_cast<int>(placed.size()) < count; ++tries) {
    const double x = b.uniform(-0.2, 0.75), y = b.uniform(-0.75, 0.75);
    const Eigen::Vector2d p(x, y);
    if (p.norm() < 0.34 || p.norm() > 0.75) continue;
    if (std::any_of(placed.begin(), placed.end(),
                    [&](const auto& q) { return (p - q).norm() < 0.24; }))
      continue;
    placed.push_back(p);
    b.post(fmt::format("pillar {}", placed.size()), p.x(), p.y(), 0.0, 1.3, b.uniform(0.025, 0.05));
  }
  const double side = b.below(2) == 0 ? 1.0 : -1.0;
  const auto sector = [&](double s) {
    return b.room({0.25, s > 0 ? 0.15 : -0.65, 0.15}, {0.75, s > 0 ? 0.65 : -0.15, 0.75});
  };
  b.layout.start = sector(side);
  b.layout.goal = sector(-side);
}

void windows(LayoutBuilder& b) {
  constexpr double t = 0.04, half_width = 0.9, height = 1.25;
  b.set_frame({b.uniform(0.36, 0.44), b.uniform(-0.05, 0.05), b.uniform(-0.08, 0.08)});
  struct Opening {
    double y, z, width, height;
  };
  const auto opening = [&](double side) {
    Opening o{};
    o.y = side * b.uniform(0.24, 0.34);
    o.z = b.uniform(0.30, 0.65);
    o.width = b.uniform(0.28, 0.36);
    o.height = b.uniform(0.28, 0.38);
    return o;
  };
  const std::array<Opening, 2> openings{opening(-1.0), opening(1.0)};
  double y = -half_width;
  for (std::size_t i = 0; i < 2; ++i) {
    const Opening& o = openings[i];
    const double left = o.y - 0.5 * o.width, low = o.z - 0.5 * o.height,
                 high = o.z + 0.5 * o.height;
    b.box(fmt::format("wall {}", i), {0.5 * t, 0.5 * (y + left), 0.5 * height},
          {t, left - y, height});
    b.box(fmt::format("sill {}", i), {0.5 * t, o.y, 0.5 * low}, {t, o.width, low});
    b.box(fmt::format("lintel {}", i), {0.5 * t, o.y, 0.5 * (high + height)},
          {t, o.width, height - high});
    y = left + o.width;
  }
  b.box("wall 2", {0.5 * t, 0.5 * (y + half_width), 0.5 * height}, {t, half_width - y, height});
  const auto behind = [&](const Opening& o) {
    return b.room({t + 0.06, o.y - 0.2, o.z - 0.2}, {t + 0.35, o.y + 0.2, o.z + 0.2});
  };
  const int first = b.below(2);
  b.layout.start = behind(openings[static_cast<std::size_t>(first)]);
  b.layout.goal = behind(openings[static_cast<std::size_t>(1 - first)]);
}

void beams(LayoutBuilder& b) {
  const int horizontal = 4 + b.below(3), hanging = 3 + b.below(3);
  std::vector<Eigen::Vector2d> placed;
  for (int tries = 0; tries < 1000 && static_cast<int>(placed.size()) < horizontal; ++tries) {
    const double x = b.uniform(0.25, 0.75), z = b.uniform(0.25, 1.0);
    const Eigen::Vector2d p(x, z);
    if (std::any_of(placed.begin(), placed.end(),
                    [&](const auto& q) { return (p - q).norm() < 0.24; }))
      continue;
    placed.push_back(p);
    b.set_frame({p.x(), 0.0, b.uniform(-0.15, 0.15)});
    b.beam(fmt::format("beam {}", placed.size()), {0.0, 0.0, p.y()}, 1.6, b.uniform(0.015, 0.04));
  }
  b.set_frame({});
  for (int i = 0; i < hanging; ++i) {
    const double x = b.uniform(0.30, 0.75), y = b.uniform(-0.6, 0.6), z = b.uniform(0.35, 0.7),
                 radius = b.uniform(0.015, 0.03);
    b.post(fmt::format("pipe {}", i), x, y, z, 1.3, radius);
  }
  Room low = b.room({0.30, -0.45, 0.05}, {0.75, 0.45, 0.35}),
       high = b.room({0.25, -0.45, 0.70}, {0.70, 0.45, 1.0});
  if (b.below(2) == 0) std::swap(low, high);
  b.layout.start = low;
  b.layout.goal = high;
}

void clutter(LayoutBuilder& b) {
  scene::Clutter random;
  random.count = 20 + static_cast<std::size_t>(b.below(21));
  random.size_min_m = 0.05;
  random.size_max_m = 0.22;
  random.bounds = {{-0.9, -0.9, 0.0}, {0.9, 0.9, 1.2}};
  random.keep_out = {{{0.0, 0.0, 0.2}, 0.3}};
  random.seed = b.rng.next();
  for (auto& obstacle : scene::make_clutter(random)) b.add(std::move(obstacle));
  const double side = b.below(2) == 0 ? 1.0 : -1.0;
  const auto half = [&](double s) {
    return b.room({-0.6, s > 0 ? 0.2 : -0.8, 0.1}, {0.8, s > 0 ? 0.8 : -0.2, 1.0});
  };
  b.layout.start = half(side);
  b.layout.goal = half(-side);
}

struct Family {
  const char* name;
  const char* description;
  void (*make)(LayoutBuilder& b);
};

constexpr std::array<Family, 10> all{{
    {"shelf", "two by two compartments; from one compartment into another", &shelf},
    {"tall_shelf", "four low compartments above each other; from one into another", &tall_shelf},
    {"bins", "two open bins to the left and right; from the bottom of one into the other", &bins},
    {"cage", "a cage of bars and rails; from inside to beside it, or back", &cage},
    {"table", "a table full of objects; from between them on one side to the other side", &table},
    {"under_table", "a table with legs; from above its top to below it, or back", &under_table},
    {"pillars", "pillars around the arm; from one side to the other", &pillars},
    {"windows", "a wall with two windows; from behind one to behind the other", &windows},
    {"beams", "beams across and pipes from above; from low to high, or back", &beams},
    {"clutter", "random boxes, cylinders and spheres; from one side to the other", &clutter},
}};

const Family& family_of(std::string_view name) {
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Family& f) { return f.name == name; });
  if (found == all.end())
    throw Error(ErrorCode::usage, fmt::format("family '{}' is not known, expected one of {}", name,
                                              fmt::join(families(), ", ")));
  return *found;
}

}  // namespace

const std::vector<std::string>& families() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    list.reserve(std::size(all));
    for (const auto& family : all) list.emplace_back(family.name);
    return list;
  }();
  return names;
}

std::string_view describe(std::string_view family) {
  return family_of(family).description;
}

Layout make_layout(std::string_view family, std::uint64_t seed) {
  const Family& f = family_of(family);
  LayoutBuilder builder(seed);
  f.make(builder);
  return std::move(builder.layout);
}

}  // namespace hamelin::bench
