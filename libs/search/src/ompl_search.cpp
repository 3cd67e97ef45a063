// The planners of OMPL. Every random number comes from the search's seed: state samplers and the
// sampler of informed sets are our own, the planners' generators are seeded one by one, and nearest
// neighbours are searched linearly, since OMPL's tree of neighbours draws its pivots. OMPL's own
// generators are seeded in the order in which they are made anywhere in the process.
#include <fmt/format.h>
#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/goals/GoalStates.h>
#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/samplers/informed/PathLengthDirectInfSampler.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/datastructures/NearestNeighborsLinear.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/planners/informedtrees/BITstar.h>
#include <ompl/geometric/planners/rrt/InformedRRTstar.h>
#include <ompl/geometric/planners/rrt/RRT.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>
#include <ompl/util/Exception.h>
#include <ompl/util/ProlateHyperspheroid.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "search.hpp"

namespace hamelin::search {

namespace ob = ompl::base;
namespace og = ompl::geometric;

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double range = 0.5;  // the longest edge of a tree [rad or m]
// Share of the samples around the start or a goal, where ways are often narrow, and their spread
// [rad or m].
constexpr double near_share = 0.3, near_spread = 0.5;
// How often a sample of an informed set may lie outside the joint limits.
constexpr int informed_tries = 100;

double* values(ob::State* state) {
  return state->as<ob::RealVectorStateSpace::StateType>()->values;
}
VectorXd vector(const ob::State* state, Index n) {
  return VectorXd::Map(state->as<ob::RealVectorStateSpace::StateType>()->values, n);
}

/// Joint space. OMPL's default structure for the nearest neighbours in a space that is said to be
/// no metric one searches linearly for the nearest k, which is all that BIT* asks for.
class JointSpace final : public ob::RealVectorStateSpace {
 public:
  using RealVectorStateSpace::RealVectorStateSpace;
  [[nodiscard]] bool isMetricSpace() const override { return false; }
};

/// Uniform in the box, or normal around the start or a goal.
void draw_sample(const Search& search, Rng& rng, double* q) {
  const dynamics::JointBox& box = search.box;
  if (rng.uniform() >= near_share) {
    for (Index i = 0; i < box.lower.size(); ++i) q[i] = rng.uniform(box.lower[i], box.upper[i]);
    return;
  }
  const auto k = static_cast<std::size_t>(rng.below(search.goals.size() + 1));
  const VectorXd& center = k < search.goals.size() ? search.goals[k] : search.start;
  for (Index i = 0; i < center.size(); ++i)
    q[i] = std::clamp(center[i] + near_spread * rng.normal(), box.lower[i], box.upper[i]);
}

class Sampler final : public ob::StateSampler {
 public:
  Sampler(const ob::StateSpace* space, const Search& search, Rng& rng)
      : StateSampler(space), search_(search), box_(search.box), rng_(rng) {}
  void sampleUniform(ob::State* state) override { draw_sample(search_, rng_, values(state)); }
  void sampleUniformNear(ob::State* state, const ob::State* near, double distance) override {
    const VectorXd center = vector(near, box_.lower.size());
    for (Index i = 0; i < center.size(); ++i)
      values(state)[i] =
          std::clamp(center[i] + distance * rng_.uniform(-1.0, 1.0), box_.lower[i], box_.upper[i]);
  }
  void sampleGaussian(ob::State* state, const ob::State* mean, double deviation) override {
    const VectorXd center = vector(mean, box_.lower.size());
    for (Index i = 0; i < center.size(); ++i)
      values(state)[i] =
          std::clamp(center[i] + deviation * rng_.normal(), box_.lower[i], box_.upper[i]);
  }

 private:
  const Search& search_;
  const dynamics::JointBox& box_;
  Rng& rng_;
};

/// Uniform in the union of the sets in which a shorter path to one of the goals may lie: Gammell,
/// Barfoot, Srinivasa 2018, doi:10.1109/TRO.2018.2830331.
class InformedSampler final : public ob::PathLengthDirectInfSampler {
 public:
  InformedSampler(const ob::ProblemDefinitionPtr& problem, unsigned calls, const Search& search,
                  Rng& rng)
      : PathLengthDirectInfSampler(problem, calls), search_(search), rng_(rng) {
    const auto n = static_cast<unsigned>(search.start.size());
    for (const VectorXd& goal : search.goals)
      sets_.push_back(
          std::make_shared<ompl::ProlateHyperspheroid>(n, search.start.data(), goal.data()));
  }
  bool sampleUniform(ob::State* state, const ob::Cost& most) override {
    if (!std::isfinite(most.value())) {
      draw_sample(search_, rng_, values(state));
      return true;
    }
    for (int i = 0; i < informed_tries; ++i)
      if (draw(state, most.value())) return true;
    return false;
  }
  bool sampleUniform(ob::State* state, const ob::Cost& least, const ob::Cost& most) override {
    for (int i = 0; i < informed_tries; ++i)
      if (sampleUniform(state, most) && heuristicSolnCost(state).value() >= least.value())
        return true;
    return false;
  }

 private:
  // Draws from one of the sets, in proportion to their size, and rejects what others have as well.
  bool draw(ob::State* state, double most) {
    double total = 0.0;
    for (const auto& set : sets_)
      if (most > set->getMinTransverseDiameter()) {
        set->setTransverseDiameter(most);
        total += set->getPhsMeasure();
      }
    if (!(total > 0.0) || !std::isfinite(total)) return false;
    double place = total * rng_.uniform();
    const ompl::ProlateHyperspheroid* from = nullptr;
    for (const auto& set : sets_) {
      if (most <= set->getMinTransverseDiameter()) continue;
      from = set.get();
      if ((place -= set->getPhsMeasure()) <= 0.0) break;
    }
    VectorXd ball(search_.start.size());
    for (double& x : ball) x = rng_.normal();
    ball *= std::pow(rng_.uniform(), 1.0 / static_cast<double>(ball.size())) / ball.norm();
    from->transform(ball.data(), values(state));
    int within = 0;
    for (const auto& set : sets_)
      if (most > set->getMinTransverseDiameter() && set->isInPhs(values(state))) ++within;
    if (within > 1 && rng_.uniform() * within >= 1.0) return false;
    const VectorXd q = vector(state, ball.size());
    return (q.array() >= search_.box.lower.array()).all() &&
           (q.array() <= search_.box.upper.array()).all();
  }

  const Search& search_;
  Rng& rng_;
  std::vector<std::shared_ptr<ompl::ProlateHyperspheroid>> sets_;
};

class Objective final : public ob::PathLengthOptimizationObjective {
 public:
  Objective(const ob::SpaceInformationPtr& info, const Search& search, Rng& rng)
      : PathLengthOptimizationObjective(info), search_(search), rng_(rng) {}
  ob::InformedSamplerPtr allocInformedStateSampler(const ob::ProblemDefinitionPtr& problem,
                                                   unsigned calls) const override {
    return std::make_shared<InformedSampler>(problem, calls, search_, rng_);
  }

 private:
  const Search& search_;
  Rng& rng_;
};

class Validity final : public ob::StateValidityChecker {
 public:
  Validity(const ob::SpaceInformationPtr& info, Edges& edges, Index n)
      : StateValidityChecker(info), edges_(edges), n_(n) {}
  bool isValid(const ob::State* state) const override { return edges_.clear(vector(state, n_)); }

 private:
  Edges& edges_;
  Index n_;
};

/// Proves motions clear, where OMPL would sample them.
class Motions final : public ob::MotionValidator {
 public:
  Motions(const ob::SpaceInformationPtr& info, Edges& edges, Index n)
      : MotionValidator(info), edges_(edges), n_(n) {}
  bool checkMotion(const ob::State* a, const ob::State* b) const override {
    return edges_.clear(vector(a, n_), vector(b, n_));
  }
  bool checkMotion(const ob::State* a, const ob::State* b,
                   std::pair<ob::State*, double>& last) const override {
    const bool clear = checkMotion(a, b);
    if (!clear) {
      last.second = 0.0;
      if (last.first != nullptr) si_->copyState(last.first, a);
    }
    return clear;
  }

 private:
  Edges& edges_;
  Index n_;
};

/// A planner whose own generator follows from a seed.
template <class Planner>
class Seeded final : public Planner {
 public:
  Seeded(const ob::SpaceInformationPtr& info, std::uint64_t seed) : Planner(info) {
    this->rng_.setLocalSeed(static_cast<std::uint_fast32_t>(seed));
    this->template setNearestNeighbors<ompl::NearestNeighborsLinear>();
    this->setRange(range);
  }
};

ob::PlannerPtr make_planner(scene::GuideType type, const ob::SpaceInformationPtr& info,
                            std::uint64_t seed) {
  switch (type) {
    case scene::GuideType::rrt:
      return std::make_shared<Seeded<og::RRT>>(info, seed);
    case scene::GuideType::rrt_star:
      return std::make_shared<Seeded<og::RRTstar>>(info, seed);
    case scene::GuideType::informed_rrt_star:
      return std::make_shared<Seeded<og::InformedRRTstar>>(info, seed);
    case scene::GuideType::bit_star: {
      auto planner = std::make_shared<og::BITstar>(info);
      // OMPL 1.5 crashes where it prunes the goal of its best path (ompl/ompl#949).
      planner->setPruning(false);
      return planner;
    }
    default:
      return std::make_shared<Seeded<og::RRTConnect>>(info, seed);
  }
}

bool optimises(scene::GuideType type) {
  return type == scene::GuideType::rrt_star || type == scene::GuideType::bit_star ||
         type == scene::GuideType::informed_rrt_star;
}

// A single tree comes out of a narrow place more easily than into it, and goals are narrower than
// starts: it grows from the goals.
bool grows_from_goals(scene::GuideType type) {
  return type != scene::GuideType::rrt_connect && type != scene::GuideType::bit_star;
}

// OMPL would write what it does to the standard output.
void silence() {
  static std::once_flag once;
  std::call_once(once, [] { ompl::msg::setLogLevel(ompl::msg::LOG_NONE); });
}

ob::SpaceInformationPtr make_space(const Search& search, Rng& rng) {
  const Index n = search.start.size();
  auto space = std::make_shared<JointSpace>(static_cast<unsigned>(n));
  ob::RealVectorBounds bounds(static_cast<unsigned>(n));
  for (Index i = 0; i < n; ++i) {
    bounds.setLow(static_cast<unsigned>(i), search.box.lower[i]);
    bounds.setHigh(static_cast<unsigned>(i), search.box.upper[i]);
  }
  space->setBounds(bounds);
  space->setStateSamplerAllocator([&search, &rng](const ob::StateSpace* of) {
    return std::make_shared<Sampler>(of, search, rng);
  });
  auto info = std::make_shared<ob::SpaceInformation>(space);
  info->setStateValidityChecker(std::make_shared<Validity>(info, search.edges, n));
  info->setMotionValidator(std::make_shared<Motions>(info, search.edges, n));
  info->setup();
  return info;
}

ob::ProblemDefinitionPtr make_problem(const Search& search, const ob::SpaceInformationPtr& info,
                                      Rng& rng) {
  auto problem = std::make_shared<ob::ProblemDefinition>(info);
  ob::ScopedState<ob::RealVectorStateSpace> state(info);
  auto goals = std::make_shared<ob::GoalStates>(info);
  const bool backwards = grows_from_goals(search.type);
  const auto add = [&](const VectorXd& q, bool as_start) {
    std::copy(q.begin(), q.end(), values(state.get()));
    if (as_start)
      problem->addStartState(state);
    else
      goals->addState(state);
  };
  add(search.start, !backwards);
  for (const VectorXd& goal : search.goals) add(goal, backwards);
  problem->setGoal(goals);
  problem->setOptimizationObjective(std::make_shared<Objective>(info, search, rng));
  return problem;
}

MatrixXd to_matrix(const og::PathGeometric& path, Index n) {
  MatrixXd out(n, static_cast<Index>(path.getStateCount()));
  for (std::size_t i = 0; i < path.getStateCount(); ++i)
    out.col(static_cast<Index>(i)) = vector(path.getState(static_cast<unsigned>(i)), n);
  return out;
}

Found solve(const Search& search) {
  Rng rng(search.seed);
  const auto info = make_space(search, rng);
  const auto problem = make_problem(search, info, rng);
  const auto planner = make_planner(search.type, info, rng.next() >> 33);
  Found out;
  long end = search.checks_end;
  const auto note_first = [&] {
    if (out.first_checks > 0) return;
    out.first_checks = search.edges.checks();
    end = std::min(end, out.first_checks + search.improve_checks);
  };
  if (optimises(search.type))
    problem->setIntermediateSolutionCallback([&](const ob::Planner*,
                                                 const std::vector<const ob::State*>&,
                                                 const ob::Cost) { note_first(); });
  planner->setProblemDefinition(problem);
  planner->setup();
  // Iterations count as well: a planner may go on without checking anything.
  long iterations = 0;
  const ob::PlannerTerminationCondition ends(
      [&] { return search.edges.checks() + ++iterations >= end; });
  planner->solve(ends);
  ob::PlannerData data(info);
  planner->getPlannerData(data);
  out.states = data.numVertices();
  if (!problem->hasExactSolution()) return {{}, 0, out.states};
  note_first();
  out.points = to_matrix(*problem->getSolutionPath()->as<og::PathGeometric>(), search.start.size());
  if (grows_from_goals(search.type)) out.points = out.points.rowwise().reverse().eval();
  return out;
}

}  // namespace

bool available() noexcept {
  return true;
}

Found search(const Search& search) {
  silence();
  try {
    return solve(search);
  } catch (const ompl::Exception& e) {
    throw Error(ErrorCode::invalid, fmt::format("guide: OMPL: {}", e.what()));
  }
}

}  // namespace hamelin::search
