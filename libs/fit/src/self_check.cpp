#include "hamelin/fit/self_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/fit/shape.hpp"

namespace hamelin::fit {

namespace {

using Eigen::Vector3d;
using geometry::SE3;

struct Part {
  std::string name;
  int body = -1;              // −1: base
  std::vector<Shape> shapes;  // in the body's COM frame; those of the base in the base frame
};

std::vector<Part> parts_of(const model::Robot& robot) {
  std::vector<Part> parts;
  const auto add = [&](const std::string& name, int body, const Shape& shape) {
    for (Part& part : parts)
      if (part.name == name) {
        part.shapes.push_back(shape);
        return;
      }
    parts.push_back({name, body, {shape}});
  };
  const auto add_all = [&](const auto& spheres, const auto& segments, const std::string& own,
                           int body) {
    for (const model::Sphere& s : spheres)
      add(s.part.empty() ? own : s.part, body, {s.center_m, s.center_m, s.radius_m});
    for (const model::Segment& s : segments)
      if (s.radius_m > 0.0)
        add(s.part.empty() ? own : s.part, body, {s.from_m, s.to_m, s.radius_m});
  };
  for (std::size_t i = 0; i < robot.links.size(); ++i)
    add_all(robot.links[i].spheres, robot.links[i].segments, robot.links[i].name,
            static_cast<int>(i));
  add_all(robot.base_spheres, robot.base_segments, "base", -1);
  return parts;
}

// Distance of two segments (Ericson, Real-Time Collision Detection, 2005, 5.1.9).
double segment_segment_distance(const Vector3d& p1, const Vector3d& q1, const Vector3d& p2,
                                const Vector3d& q2) {
  const Vector3d d1 = q1 - p1, d2 = q2 - p2, r = p1 - p2;
  const double a = d1.squaredNorm(), e = d2.squaredNorm(), f = d2.dot(r);
  if (a <= 0.0) return segment_distance(p2, q2, p1);
  if (e <= 0.0) return segment_distance(p1, q1, p2);
  const double c = d1.dot(r), b = d1.dot(d2), denominator = a * e - b * b;
  double s =
      denominator > 1e-12 * a * e ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0.0;
  double t = (b * s + f) / e;
  if (t < 0.0) {
    t = 0.0;
    s = std::clamp(-c / a, 0.0, 1.0);
  } else if (t > 1.0) {
    t = 1.0;
    s = std::clamp((b - c) / a, 0.0, 1.0);
  }
  return (p1 + s * d1 - p2 - t * d2).norm();
}

double shapes_distance(const std::vector<Shape>& a, const std::vector<Shape>& b) {
  double least = infinity;
  for (const Shape& x : a)
    for (const Shape& y : b) {
      const double axes = x.ball() && y.ball()
                              ? (x.from - y.from).norm()
                              : segment_segment_distance(x.from, x.to, y.from, y.to);
      least = std::min(least, axes - x.radius_m - y.radius_m);
    }
  return least;
}

// The parts' shapes in the base frame.
void place(const model::Robot& robot, const std::vector<double>& q, const std::vector<Part>& parts,
           std::vector<std::vector<Shape>>& placed) {
  std::vector<SE3> poses;
  SE3 moved;
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    moved = moved * SE3::exp(robot.links[i].joint.screw * q[i]);
    poses.push_back(moved * robot.links[i].com);
  }
  placed.resize(parts.size());
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const SE3 pose = parts[k].body < 0 ? SE3() : poses[static_cast<std::size_t>(parts[k].body)];
    placed[k].clear();
    for (const Shape& shape : parts[k].shapes) {
      const Vector3d from = pose * shape.from;
      placed[k].push_back({from, shape.ball() ? from : pose * shape.to, shape.radius_m});
    }
  }
}

std::pair<double, double> range_of(const model::Joint& joint) {
  const double open = joint.type == model::JointType::revolute ? std::numbers::pi : 1.0;
  return {joint.lower.value_or(-open), joint.upper.value_or(open)};
}

std::vector<std::string> suspicious_limits_of(const model::Robot& robot) {
  std::vector<std::string> findings;
  for (const model::Link& link : robot.links) {
    const model::Joint& joint = link.joint;
    const bool turns = joint.type == model::JointType::revolute;
    const char* unit = turns ? "rad" : "m";
    const auto add = [&](const std::string& what) {
      findings.push_back(fmt::format("joint '{}': {}", joint.name, what));
    };
    if (joint.lower && joint.upper) {
      const double low = *joint.lower, high = *joint.upper;
      if (low > 0.0 || high < 0.0)
        add(fmt::format("0 is outside its limits [{:.4g}, {:.4g}] {}", low, high, unit));
      if (turns && high - low > 4.0 * std::numbers::pi + 1e-6)
        add(fmt::format(
            "its limits [{:.4g}, {:.4g}] rad span more than two turns; are they in degrees?", low,
            high));
      if (!turns && high - low > 10.0)
        add(fmt::format(
            "its limits [{:.4g}, {:.4g}] m span more than 10 m; are they in millimetres?", low,
            high));
      if (high - low < (turns ? 0.01 : 0.001))
        add(fmt::format("its limits [{:.4g}, {:.4g}] {} leave it almost no room", low, high, unit));
    } else if (!turns) {
      add("it is prismatic and has no limits");
    }
    if (joint.velocity_max && *joint.velocity_max > (turns ? 50.0 : 20.0))
      add(fmt::format("its speed limit is {:.4g} {}/s", *joint.velocity_max, unit));
    if (!joint.velocity_max) add("it has no speed limit");
    if (!joint.effort_max) add(fmt::format("it has no {} limit", turns ? "torque" : "force"));
  }
  return findings;
}

}  // namespace

std::vector<PartPair> SelfCheck::contacts_at_rest() const {
  std::vector<PartPair> out;
  for (const PartPair& pair : pairs)
    if (pair.checked && pair.touches_at_rest()) out.push_back(pair);
  return out;
}

std::string contact_reason(const PartPair& pair, int samples) {
  if (samples > 0 && pair.contacts >= always_share_min * samples) return "Always";
  return pair.touches_at_rest() ? "Default" : "";
}

std::vector<description::DisabledPair> SelfCheck::disabled(bool never) const {
  std::vector<description::DisabledPair> out;
  for (const PartPair& pair : pairs) {
    const bool touches = pair.touches_at_rest() || pair.contacts > 0;
    const bool listed = !pair.checked && !pair.neighbours;
    std::string reason;
    if (pair.neighbours && (touches || !pair.checked)) {
      reason = "Adjacent";
    } else if (listed) {
      reason = pair.reason;
    } else if (never && samples > 0 && !touches) {
      reason = "Never";
    } else {
      reason = contact_reason(pair, samples);
    }
    if (!reason.empty()) out.push_back({pair.part_a, pair.part_b, reason, 0});
  }
  return out;
}

namespace {

bool has_shapes(const std::vector<Part>& parts, int body) {
  return std::any_of(parts.begin(), parts.end(),
                     [body](const Part& part) { return part.body == body; });
}

bool shapes_between(const std::vector<Part>& parts, int low, int high) {
  for (int body = low + 1; body < high; ++body)
    if (has_shapes(parts, body)) return true;
  return false;
}

// Whether the pair is checked in a run, and the reason if it is not.
PartPair pair_of(const model::Robot& robot, const std::vector<description::DisabledPair>& listed,
                 const std::vector<Part>& parts, const Part& a, const Part& b) {
  PartPair pair;
  pair.part_a = a.name;
  pair.part_b = b.name;
  const auto is_this_pair = [&pair](const std::string& x, const std::string& y) {
    return (x == pair.part_a && y == pair.part_b) || (x == pair.part_b && y == pair.part_a);
  };
  const auto [low, high] = std::minmax(a.body, b.body);
  pair.neighbours = !shapes_between(parts, low, high);
  pair.checked = true;
  for (const auto& [x, y] : robot.self_collision_disabled)
    if (is_this_pair(x, y)) {
      pair.checked = false;
      pair.reason = "listed";
    }
  if (robot.self_collision_disabled.empty() && high - low == 1) {
    pair.checked = false;
    pair.reason = "neighbours, and no pair is listed";
  }
  for (const description::DisabledPair& known : listed)
    if (!pair.checked && is_this_pair(known.link_a, known.link_b) && !known.reason.empty())
      pair.reason = known.reason;
  return pair;
}

// Each joint at 0, or in the middle of its range if that does not contain 0.
std::vector<double> rest_of(const model::Robot& robot) {
  std::vector<double> q;
  for (const model::Link& link : robot.links) {
    const auto [low, high] = range_of(link.joint);
    q.push_back(low <= 0.0 && high >= 0.0 ? 0.0 : 0.5 * (low + high));
  }
  return q;
}

}  // namespace

SelfCheck check_self(const model::Robot& robot,
                     const std::vector<description::DisabledPair>& listed,
                     const SelfCheckOptions& options) {
  SelfCheck out;
  const std::vector<Part> parts = parts_of(robot);
  std::vector<std::pair<std::size_t, std::size_t>> indices;
  for (std::size_t a = 0; a < parts.size(); ++a)
    for (std::size_t b = a + 1; b < parts.size(); ++b) {
      if (parts[a].body == parts[b].body) continue;
      out.pairs.push_back(pair_of(robot, listed, parts, parts[a], parts[b]));
      indices.emplace_back(a, b);
    }

  std::vector<double> q = rest_of(robot);
  out.rest_q = q;
  out.samples = options.samples;
  std::vector<std::vector<Shape>> placed;
  place(robot, q, parts, placed);
  for (std::size_t k = 0; k < indices.size(); ++k)
    out.pairs[k].rest_m = out.pairs[k].least_m =
        shapes_distance(placed[indices[k].first], placed[indices[k].second]);
  Rng rng(options.seed);
  for (int sample = 0; sample < options.samples; ++sample) {
    for (std::size_t i = 0; i < q.size(); ++i) {
      const auto [low, high] = range_of(robot.links[i].joint);
      q[i] = rng.uniform(low, high);
    }
    place(robot, q, parts, placed);
    for (std::size_t k = 0; k < indices.size(); ++k) {
      const double distance = shapes_distance(placed[indices[k].first], placed[indices[k].second]);
      out.pairs[k].least_m = std::min(out.pairs[k].least_m, distance);
      if (distance <= 0.0) ++out.pairs[k].contacts;
    }
  }

  for (std::size_t i = 0; i < robot.links.size(); ++i)
    if (!has_shapes(parts, static_cast<int>(i)))
      out.links_without_shapes.push_back(robot.links[i].name);
  out.suspicious_limits = suspicious_limits_of(robot);
  return out;
}

std::string srdf_text(const std::string& robot,
                      const std::vector<description::DisabledPair>& pairs) {
  const auto quoted = [](const std::string& text) {
    std::string out;
    for (const char c : text) {
      if (c == '&') {
        out += "&amp;";
      } else if (c == '<') {
        out += "&lt;";
      } else if (c == '"') {
        out += "&quot;";
      } else {
        out += c;
      }
    }
    return out;
  };
  std::string text = fmt::format("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", quoted(robot));
  for (const description::DisabledPair& pair : pairs)
    text += fmt::format("  <disable_collisions link1=\"{}\" link2=\"{}\" reason=\"{}\"/>\n",
                        quoted(pair.link_a), quoted(pair.link_b), quoted(pair.reason));
  return text + "</robot>\n";
}

Json to_json(const SelfCheck& check, const model::Robot& robot) {
  Json pairs = Json::array();
  for (const auto& pair : check.pairs)
    pairs.push_back({{"parts", {pair.part_a, pair.part_b}},
                     {"checked", pair.checked},
                     {"reason", pair.checked ? Json(nullptr) : Json(pair.reason)},
                     {"neighbours", pair.neighbours},
                     {"rest_m", pair.rest_m},
                     {"least_m", pair.least_m},
                     {"contacts", pair.contacts}});
  Json faults = Json::array();
  for (const auto& pair : check.contacts_at_rest())
    faults.push_back({{"parts", {pair.part_a, pair.part_b}}, {"rest_m", pair.rest_m}});
  return {{"name", robot.name},
          {"rest_q", check.rest_q},
          {"samples", check.samples},
          {"overlaps_at_rest", faults},
          {"pairs", pairs},
          {"links_without_shapes", check.links_without_shapes},
          {"odd_limits", check.suspicious_limits},
          {"notes", robot.notes},
          {"warnings", robot.warnings}};
}

}  // namespace hamelin::fit
