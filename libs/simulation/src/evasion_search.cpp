#include "evasion_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

namespace {

constexpr double never_s = std::numeric_limits<double>::infinity();
// Times are multiples of steps, up to rounding.
constexpr double same_time_s = 1e-9;
// Ways back, and lengths of random ways, one after the other [rad or m].
constexpr std::array<double, 4> backs_s{0.1, 0.2, 0.4, 0.8};
constexpr std::array<double, 4> random_lengths{0.25, 0.5, 1.0, 1.5};
// Arm and obstacle that are predicted to come this near are predicted to touch.
constexpr double predicted_contact_m = 0.01;
// The range of the search for the touching points.
constexpr double threat_range_m = 0.05;

// The environment with all changes of its map up to the contact.
scene::Environment environment_at(const scene::Scene& scene, const model::Model& model,
                                  double time_s) {
  scene::Environment environment = scene::make_environment(scene, model, threat_range_m);
  (void)environment.advance(time_s);
  return environment;
}

}  // namespace

EvasionSearch::EvasionSearch(const Run& run, const ExplainOptions& options)
    : run_(run),
      options_(options),
      contact_s_(run.points.back().time_s),
      delay_s_(run.scene.actuation.type == scene::ActuationType::ideal
                   ? 0.0
                   : run.scene.actuation.delay_s),
      environment_(environment_at(run.scene, run.model, contact_s_)),
      check_(run.scene, run.model, environment_),
      ws_(run.model),
      arm_(run.model),
      asides_(run.model, check_.limits(), VectorXd::Zero(run.model.dof()), options.seed),
      rng_(options.seed) {
  find_threat();
  find_sightings();
}

void EvasionSearch::find_threat() {
  const Point& last = run_.points.back();
  dynamics::forward_kinematics(run_.model, ws_, last.q);
  arm_.place(run_.model, ws_);
  scene::Environment::Scratch scratch(environment_, arm_.view().size());
  std::vector<scene::Contact> near(environment_.contacts_max(arm_.view().size()));
  near.resize(environment_.closest(arm_.view(), threat_range_m, contact_s_, scratch, near,
                                   scene::View::judge));
  const scene::Contact* touch = nullptr;
  for (const auto& contact : near)
    if (contact.obstacle >= 0 &&
        environment_.obstacles()[static_cast<std::size_t>(contact.obstacle)].name ==
            run_.obstacle &&
        (touch == nullptr || contact.distance < touch->distance))
      touch = &contact;
  if (touch == nullptr)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: obstacle '{}' is not near the arm at {} s, expected the contact "
                            "of the result",
                            run_.log.string(), run_.obstacle, contact_s_));
  obstacle_ = static_cast<std::size_t>(touch->obstacle);
  threat_ = {touch->obstacle, touch->sphere, 0.0, last.q, touch->arm_point, touch->direction};
}

void EvasionSearch::find_sightings() {
  const auto& obstacles = environment_.obstacles();
  seen_since_s_.assign(obstacles.size(), never_s);
  if (std::none_of(obstacles.begin(), obstacles.end(),
                   [](const auto& o) { return !o.known && o.visible_within_m; }))
    return;
  std::vector<std::uint8_t> seen(obstacles.size(), 0);
  for (const auto& point : run_.points) {
    dynamics::forward_kinematics(run_.model, ws_, point.q);
    arm_.place(run_.model, ws_);
    for (int k = 0; k >= 0;) {
      k = environment_.reveal_visible(arm_.view(), point.time_s, seen);
      if (k >= 0) seen_since_s_[static_cast<std::size_t>(k)] = point.time_s;
    }
  }
}

std::optional<double> EvasionSearch::known_since() const {
  const scene::Obstacle& obstacle = environment_.obstacles()[obstacle_];
  if (obstacle.judge_only) return std::nullopt;
  if (obstacle.known) return obstacle.appears_s;
  const double since = seen_since_s_[obstacle_];
  return since < never_s ? std::optional(since) : std::nullopt;
}

EvasionCheck::Knowledge EvasionSearch::knowledge_at(double time_s) const {
  EvasionCheck::Knowledge knowledge{time_s, {}};
  for (const double since : seen_since_s_)
    knowledge.seen.push_back(since <= time_s + same_time_s ? 1 : 0);
  return knowledge;
}

std::vector<std::size_t> EvasionSearch::starts() const {
  const double from =
      std::max(contact_s_ - ExplainOptions::back_s, environment_.obstacles()[obstacle_].appears_s);
  std::vector<std::size_t> found;
  double next = contact_s_;
  for (std::size_t i = run_.points.size() - 1; i-- > 0;) {
    const Point& point = run_.points[i];
    if (point.time_s < from - same_time_s) break;
    const bool earliest = i == 0 || run_.points[i - 1].time_s < from - same_time_s;
    if (point.time_s > next + same_time_s && !earliest) continue;
    if (!point.q.allFinite() || !point.v.allFinite()) continue;
    found.push_back(i);
    next = point.time_s - ExplainOptions::grid_s;
  }
  return found;
}

void EvasionSearch::run(Explanation& explanation) {
  auto& search = explanation.search;
  explanation.known_since_s = known_since();
  search.seed = options_.seed;
  search.motions_per_start = options_.motions;
  search.first_s = search.last_s = contact_s_;
  const std::vector<std::size_t> from = starts();
  if (!from.empty()) search.last_s = run_.points[from.front()].time_s;
  for (const std::size_t start : from) {
    Explanation::Found found = begin(start, explanation.known_since_s);
    const EvasionCheck::Knowledge knowledge = knowledge_at(found.decided_s);
    found.contact_predicted = found.known && contact_predicted(start, knowledge);
    // Then only evasions for which there was a reason are still looked for.
    if (explanation.latest && !found.known) break;
    if (explanation.latest && !found.contact_predicted) continue;
    search.first_s = run_.points[start].time_s;
    search_from(start, found, knowledge, explanation);
    ++search.starts;
    if (options_.progress)
      options_.progress(static_cast<double>(search.starts), static_cast<double>(from.size()));
    if (explanation.latest_foreseen) break;
  }
  explanation.verdict = explanation.latest_foreseen ? Avoidability::avoidable
                        : explanation.latest        ? Avoidability::avoidable_in_hindsight
                                                    : Avoidability::unavoidable;
}

Explanation::Found EvasionSearch::begin(std::size_t start,
                                        std::optional<double> known_since_s) const {
  const Point& point = run_.points[start];
  Explanation::Found found;
  found.evasion.start_s = point.time_s;
  found.evasion.q = point.q;
  found.evasion.v = point.v;
  found.decided_s = point.time_s - delay_s_;
  found.known = known_since_s && found.decided_s >= *known_since_s - same_time_s;
  return found;
}

void EvasionSearch::search_from(std::size_t start, Explanation::Found found,
                                const EvasionCheck::Knowledge& knowledge,
                                Explanation& explanation) {
  const double until_s = contact_s_ + ExplainOptions::after_s;
  for (int n = 0; n < options_.motions; ++n) {
    propose(n, start, found.evasion);
    if (!check_.fit_duration(found.evasion)) continue;
    ++explanation.search.motions;
    if (!check_.is_clear(found.evasion, until_s)) continue;
    found.looked_clear = check_.looks_clear(found.evasion, until_s, knowledge);
    if (!explanation.latest) explanation.latest = found;
    if (!found.contact_predicted) return;
    if (!found.looked_clear) continue;
    explanation.latest_foreseen = found;
    return;
  }
}

void EvasionSearch::propose(int n, std::size_t start, Evasion& evasion) {
  evasion.way.setZero(run_.model.dof());
  evasion.kind = n == 0 ? Evasion::Kind::stop : Evasion::Kind::aside;
  if (n == 0) return;
  const auto back = static_cast<std::size_t>(n - 1);
  if (back < backs_s.size()) {
    evasion.way = point_before(start, backs_s[back]).q - evasion.q;
    evasion.kind = Evasion::Kind::back;
    if (evasion.way.allFinite() && !evasion.way.isZero(1e-3)) return;
    evasion.kind = Evasion::Kind::aside;
  }
  if (n % 2 == 0) {
    asides_.propose(ws_, threat_, evasion.q, evasion.v, evasion.way);
    evasion.way -= evasion.q;
    return;
  }
  for (double& x : evasion.way) x = rng_.uniform(-1.0, 1.0);
  const auto length = static_cast<std::size_t>(n / 2) % random_lengths.size();
  evasion.way *= random_lengths[length] / std::max(evasion.way.norm(), 1e-6);
}

const log::Trajectory::Point& EvasionSearch::point_before(std::size_t start, double back_s) const {
  const double time_s = run_.points[start].time_s - back_s;
  std::size_t i = start;
  while (i > 0 && run_.points[i].time_s > time_s) --i;
  return run_.points[i];
}

bool EvasionSearch::contact_predicted(std::size_t start, const EvasionCheck::Knowledge& knowledge) {
  for (std::size_t i = start; i < run_.points.size(); ++i)
    if (check_.clearance(run_.points[i].q, run_.points[i].time_s, &knowledge) <=
        predicted_contact_m)
      return true;
  return false;
}

}  // namespace hamelin::simulation
