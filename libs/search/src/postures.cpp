#include "hamelin/search/postures.hpp"

#include <algorithm>

#include "hamelin/search/joint_metric.hpp"
#include "roots.hpp"
#include "search_input.hpp"

namespace hamelin::search {

namespace {

bool is_new(const std::vector<Posture>& found, const Eigen::VectorXd& q, double apart) {
  return std::none_of(found.begin(), found.end(), [&](const Posture& other) {
    return (other.q - q).lpNorm<Eigen::Infinity>() < apart;
  });
}

}  // namespace

Postures find_postures(const model::Model& model, const Settings& settings, const Problem& problem,
                       Query& query, const PosturesWanted& wanted) {
  check(model, settings);
  check(model, problem);
  const Eigen::VectorXd weights = joint_weights(model);
  const dynamics::JointBox box = joint_box(model, settings);
  Roots finder(model, box, settings, weights);
  finder.begin(problem);
  Rng rng = rng_of(settings, problem);
  Postures out;
  const auto tried = [&] {
    long sum = 0;
    for (const GoalFigures& each : finder.figures()) sum += each.tried;
    return sum;
  };
  Root root;
  while (out.found.size() < wanted.count && finder.tries(0) &&
         (finder.in_batch() || tried() < wanted.attempts)) {
    if (!finder.attempt(query, rng, root)) continue;
    if (is_new(out.found, root.q, wanted.apart))
      out.found.push_back({root.q, root.clearance, root.goal});
    else
      ++out.repeated;
  }
  for (const GoalFigures& each : finder.figures()) {
    out.figures.tried += each.tried;
    out.figures.reached += each.reached;
    out.figures.exceeding += each.exceeding;
    out.figures.clear += each.clear;
  }
  return out;
}

}  // namespace hamelin::search
