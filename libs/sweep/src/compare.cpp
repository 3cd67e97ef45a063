#include "hamelin/sweep/compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "hamelin/core/error.hpp"
#include "statistics.hpp"

namespace hamelin::sweep {

namespace {

using Key = std::vector<std::string>;

/// Runs by what they have in common with their partners.
using Side = std::map<Key, const MergedRun*>;

std::set<std::string> values_of(const std::vector<const MergedRun*>& runs,
                                const std::string& label) {
  std::set<std::string> values;
  for (const MergedRun* r : runs)
    if (const auto found = r->run.labels.find(label); found != r->run.labels.end())
      values.insert(found->second);
  return values;
}

void check_label(const std::vector<MergedRun>& runs, const std::string& option,
                 const std::string& label) {
  std::set<std::string> names;
  for (const auto& r : runs)
    for (const auto& [name, value] : r.run.labels) names.insert(name);
  if (!runs.empty() && !names.contains(label))
    throw Error(ErrorCode::usage, fmt::format("{} {}: no run has that label, expected one of {}",
                                              option, label, fmt::join(names, ", ")));
}

/// All labels but the ignored ones, after `first`.
Key key_of(const MergedRun& r, const std::set<std::string>& ignore, Key first) {
  for (const auto& [name, value] : r.run.labels)
    if (!ignore.contains(name)) first.push_back(fmt::format("{}={}", name, value));
  return first;
}

void add_to(Side& side, Key key, const MergedRun& r) {
  const auto [at, added] = side.emplace(std::move(key), &r);
  if (!added)
    throw Error(ErrorCode::usage,
                fmt::format("{}: the runs '{}' and '{}' have the same labels, expected at most one "
                            "run for each pair; ignore fewer labels",
                            r.directory.string(), at->second->run.id, r.run.id));
}

/// Counts pairs of one comparison.
class Pairing {
 public:
  explicit Pairing(Comparison& out) : out_(out) {}

  void add(const MergedRun& a, const MergedRun& b) {
    if (!a.facts.recorded || !b.facts.recorded || !a.feasible || !b.feasible) {
      out_.without += (a.facts.recorded ? 1U : 0U) + (b.facts.recorded ? 1U : 0U);
      return;
    }
    ++out_.pairs;
    const bool left = a.facts.success, right = b.facts.success;
    ++(left && right ? out_.both : left ? out_.only_a : right ? out_.only_b : out_.neither);
    out_.contacts_a += a.facts.judge_saw_contact ? 1U : 0U;
    out_.contacts_b += b.facts.judge_saw_contact ? 1U : 0U;
    if (left && right)
      times_.push_back(a.facts.time_s.value_or(0.0) - b.facts.time_s.value_or(0.0));
  }
  void alone(const MergedRun& r) { out_.without += r.facts.recorded ? 1U : 0U; }
  void finish() {
    out_.difference_interval = tango_interval(out_.pairs, out_.only_a, out_.only_b);
    out_.reached_p = mcnemar_p(out_.only_a, out_.only_b);
    out_.times = signed_rank(times_);
    out_.time_difference_s = hodges_lehmann(times_);
  }

 private:
  Comparison& out_;
  std::vector<double> times_;
};

/// Pairs two sides; calls same(a, b) for each pair.
template <class Visit>
Comparison compare(std::string name_a, std::string name_b, const Side& a, const Side& b,
                   Visit visit) {
  Comparison out;
  out.a = std::move(name_a);
  out.b = std::move(name_b);
  Pairing pairing(out);
  for (const auto& [key, r] : a) {
    const auto found = b.find(key);
    if (found == b.end()) {
      pairing.alone(*r);
      continue;
    }
    const std::size_t before = out.pairs;
    pairing.add(*r, *found->second);
    if (out.pairs > before) visit(out, *r, *found->second);
  }
  for (const auto& [key, r] : b)
    if (!a.contains(key)) pairing.alone(*r);
  pairing.finish();
  return out;
}

std::map<std::string, std::string> hashes_of_scenes(const std::filesystem::path& directory) {
  std::map<std::string, std::string> hashes;
  for (const auto& scene : read_plan(directory).scenes) hashes[scene.file] = scene.sha256;
  return hashes;
}

}  // namespace

Comparison compare_sweeps(const std::vector<MergedRun>& runs, const std::filesystem::path& a,
                          const std::filesystem::path& b, const CompareOptions& options) {
  std::vector<const MergedRun*> of_a, of_b;
  for (const auto& r : runs) {
    if (r.directory == a) of_a.push_back(&r);
    if (r.directory == b) of_b.push_back(&r);
  }
  std::set<std::string> ignore(options.ignore.begin(), options.ignore.end());
  for (const auto& label : ignore) check_label(runs, "--ignore", label);
  if (values_of(of_a, "planner").size() == 1 && values_of(of_b, "planner").size() == 1)
    ignore.insert("planner");
  Side side_a, side_b;
  for (const auto* r : of_a) add_to(side_a, key_of(*r, ignore, {r->run.scene}), *r);
  for (const auto* r : of_b) add_to(side_b, key_of(*r, ignore, {r->run.scene}), *r);
  auto hashes_a = hashes_of_scenes(a), hashes_b = hashes_of_scenes(b);
  return compare(a.string(), b.string(), side_a, side_b,
                 [&](Comparison& out, const MergedRun& left, const MergedRun& right) {
                   if (hashes_a[left.run.scene] != hashes_b[right.run.scene]) ++out.other_scenes;
                 });
}

namespace {

// The runs by the value of a label, for at most so many values.
std::map<std::string, Side> sides_of(const std::vector<MergedRun>& runs,
                                     const CompareOptions& options, std::size_t most) {
  check_label(runs, "--label", options.label);
  std::set<std::string> ignore(options.ignore.begin(), options.ignore.end());
  for (const auto& label : ignore) check_label(runs, "--ignore", label);
  ignore.insert(options.label);
  std::map<std::string, Side> sides;
  for (const auto& r : runs) {
    const auto value = r.run.labels.find(options.label);
    if (value == r.run.labels.end()) continue;
    if (sides.size() == most && !sides.contains(value->second)) continue;
    add_to(sides[value->second], key_of(r, ignore, {r.directory.string(), r.run.scene}), r);
  }
  return sides;
}

Comparison compare(const std::string& a, const std::string& b, const Side& side_a,
                   const Side& side_b) {
  return compare(a, b, side_a, side_b, [](Comparison&, const MergedRun&, const MergedRun&) {});
}

}  // namespace

std::vector<Comparison> compare_values(const std::vector<MergedRun>& runs,
                                       const CompareOptions& options, std::size_t most) {
  const auto sides = sides_of(runs, options, most);
  std::vector<Comparison> all;
  for (auto a = sides.begin(); a != sides.end(); ++a)
    for (auto b = std::next(a); b != sides.end(); ++b) {
      auto one = compare(a->first, b->first, a->second, b->second);
      if (one.pairs > 0) all.push_back(std::move(one));
    }
  return all;
}

std::vector<Comparison> compare_ablations(const Sweeps& sweeps) {
  if (sweeps.ablations.empty()) return {};
  auto sides = sides_of(sweeps.runs, {}, std::numeric_limits<std::size_t>::max());
  std::vector<Comparison> all;
  for (const auto& ablation : sweeps.ablations)
    all.push_back(compare(ablation.planner, ablation.without, sides[ablation.planner],
                          sides[ablation.without]));
  return all;
}

Json to_json(const Comparison& c) {
  const auto interval = [](const Interval& i) { return Json{i.low, i.high}; };
  const auto& time = c.time_difference_s;
  return {{"a", c.a},
          {"b", c.b},
          {"pairs", c.pairs},
          {"without_partner", c.without},
          {"different_scene_files", c.other_scenes},
          {"reached",
           {{"both", c.both},
            {"only_a", c.only_a},
            {"only_b", c.only_b},
            {"neither", c.neither},
            {"difference", c.difference()},
            {"difference_interval", interval(c.difference_interval)},
            {"p", c.reached_p}}},
          {"contacts", {{"a", c.contacts_a}, {"b", c.contacts_b}}},
          {"arrival",
           {{"pairs", c.both},
            {"different", c.times.used},
            {"difference_s", time ? Json(time->estimate) : Json(nullptr)},
            {"difference_interval_s",
             time && time->interval ? interval(*time->interval) : Json(nullptr)},
            {"rank_biserial", c.times.used > 0 ? Json(c.times.rank_biserial) : Json(nullptr)},
            {"p", c.times.used > 0 ? Json(c.times.p) : Json(nullptr)},
            {"exact", c.times.exact}}}};
}

Json to_json(const std::vector<Comparison>& comparisons) {
  Json all = Json::array();
  for (const auto& c : comparisons) all.push_back(to_json(c));
  return {{"schema", "hamelin.comparison/1"}, {"comparisons", std::move(all)}};
}

namespace {

std::string time_text(const Comparison& c) {
  if (!c.time_difference_s) return "";
  std::string text = fmt::format("  arrival     {:+.3g} s ({} - {}), median of the differences",
                                 c.time_difference_s->estimate, c.a, c.b);
  if (const auto& interval = c.time_difference_s->interval)
    text += fmt::format(", 95 % {:+.3g} to {:+.3g} s", interval->low, interval->high);
  text += fmt::format("; {} of {} pairs differ", c.times.used, c.both);
  if (c.times.used > 0)
    text += fmt::format(", Wilcoxon p = {:.2g}, rank-biserial {:+.2f}", c.times.p,
                        c.times.rank_biserial);
  return text + "\n";
}

}  // namespace

std::string to_text(const std::vector<Comparison>& comparisons) {
  std::string text;
  for (const auto& c : comparisons) {
    text += fmt::format("{}{} against {}: {} pairs\n", text.empty() ? "" : "\n", c.a, c.b, c.pairs);
    text += fmt::format(
        "  reached     both {}, only {} {}, only {} {}, neither {}\n"
        "  difference  {:+.1f} % ({} - {}), 95 % {:+.1f} to {:+.1f} %, McNemar p = {:.2g}\n",
        c.both, c.a, c.only_a, c.b, c.only_b, c.neither, 100.0 * c.difference(), c.a, c.b,
        100.0 * c.difference_interval.low, 100.0 * c.difference_interval.high, c.reached_p);
    text += time_text(c);
    if (c.contacts_a + c.contacts_b > 0)
      text += fmt::format("  contact     {} {}, {} {}\n", c.a, c.contacts_a, c.b, c.contacts_b);
    if (c.without > 0)
      text +=
          fmt::format("  left out    {} runs without a recorded, feasible partner\n", c.without);
    if (c.other_scenes > 0)
      text += fmt::format("  note        the scene files of {} pairs differ\n", c.other_scenes);
  }
  return text;
}

}  // namespace hamelin::sweep
