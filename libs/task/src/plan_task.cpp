#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "stage.hpp"

namespace hamelin::task {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;
using geometry::SE3;

namespace {

// Rounds in which all grasps are tried, each with other random numbers.
constexpr int rounds = 2;
// What the arm keeps of where an object is taken or let go.
constexpr double grasp_m = 0.003, grasp_rad = 0.02, grasp_speed_m_s = 0.01;
// The stretch on which an object is let go.
constexpr double leaving_m = 0.01;
// What it keeps of where a straight stretch begins.
constexpr double begin_rad = 0.005;

/// The stretches of a step.
enum class Stretch { any, there, straight, away };

std::string_view to_string(Stretch stretch) {
  switch (stretch) {
    case Stretch::any:
      return "a way that ends straight";
    case Stretch::there:
      return "the way there";
    case Stretch::straight:
      return "the straight way to it";
    case Stretch::away:
      break;
  }
  return "the straight way from it";
}

/// What was planned, up to some step.
struct Done {
  Situation situation;
  std::size_t step = 0;  ///< the next one
  std::vector<scene::Goal> goals;
  std::vector<scene::Event> events;
  std::vector<std::string> lines;
};

/// The end of a way that ends straight.
struct Landing {
  std::size_t option = 0;
  VectorXd begin;  ///< where the straight stretch begins
};

scene::Goal line_to(const SE3& pose, const scene::Allowance& may_touch) {
  scene::Goal goal = scene::pose_goal(pose);
  goal.way.emplace();
  goal.may_touch = may_touch;
  return goal;
}

scene::Goal exactly(scene::Goal goal) {
  goal.tolerance_m = grasp_m;
  goal.tolerance_rad = grasp_rad;
  goal.tip_speed_max_m_s = grasp_speed_m_s;
  return goal;
}

SE3 moved(const SE3& pose, const Vector3d& by) {
  return {pose.R(), pose.p() + by};
}

class Planner {
 public:
  Planner(const Task& task, const std::function<void()>& poll) : task_(task), stage_(task, poll) {
    for (const Object& object : task.objects) payloads_.push_back(payload_of(object));
  }

  TaskPlan plan() {
    Done done;
    done.situation.q = task_.scene.start_q.size() > 0 ? task_.scene.start_q : stage_.rest();
    for (const Object& object : task_.objects) done.situation.poses.push_back(object.solid.pose);
    if (stage_.freed()) {
      scene::Event begin;
      begin.time_s = 0.0;
      begin.map = stage_.freed();
      done.events.push_back(std::move(begin));
    }
    TaskPlan out;
    while (done.step < task_.steps.size() && out.found())
      if (!go_on(done))
        out.cause = fmt::format("step {} ({}), {}: {}", failed_ + 1, describe(failed_),
                                to_string(failed_stretch_), cause_);
    out.scene = task_.scene;
    out.scene.goals = std::move(done.goals);
    out.scene.events = std::move(done.events);
    out.steps = std::move(done.lines);
    return out;
  }

 private:
  std::string describe(std::size_t step) const {
    const Step& given = task_.steps[step];
    if (const auto* pick = std::get_if<Pick>(&given))
      return fmt::format("pick '{}'", task_.objects[pick->object].solid.name);
    return std::holds_alternative<Place>(given) ? "place" : "move";
  }

  // What failed last of what came farthest is what is told.
  void fail(std::size_t step, Stretch stretch) {
    if (std::pair(step, stretch) < std::pair(failed_, failed_stretch_)) return;
    failed_ = step;
    failed_stretch_ = stretch;
    cause_ = stage_.cause();
  }

  // The next steps, up to the first after which nothing is held.
  bool go_on(Done& done) {
    do {
      const Step& step = task_.steps[done.step];
      const bool went = std::holds_alternative<Pick>(step)    ? pick(done, std::get<Pick>(step))
                        : std::holds_alternative<Place>(step) ? place(done, std::get<Place>(step))
                                                              : move(done, std::get<Move>(step));
      if (!went) return false;
    } while (done.situation.held && done.step < task_.steps.size());
    return true;
  }

  // One goal more, if there is a way to it.
  bool reach(Done& done, Stretch stretch, const scene::Goal& goal) {
    const auto way = stage_.search(done.situation, goal, round_);
    if (!way) {
      fail(done.step, stretch);
      return false;
    }
    done.situation.q = way->first.rightCols(1);
    done.goals.push_back(goal);
    return true;
  }

  // A way to any of some poses that ends with a straight stretch.
  std::optional<Landing> land(const Done& done, const std::vector<SE3>& poses,
                              const scene::Stretch& stretch, const scene::Allowance& may_touch) {
    std::vector<scene::Goal> options;
    for (const SE3& pose : poses) {
      options.push_back(exactly(scene::pose_goal(pose)));
      options.back().approach = stretch;
    }
    scene::Goal goal =
        options.size() == 1 ? std::move(options.front()) : scene::any_of_goal(std::move(options));
    goal.may_touch = may_touch;
    const auto way = stage_.search(done.situation, goal, round_);
    if (!way) {
      fail(done.step, Stretch::any);
      return std::nullopt;
    }
    const Eigen::MatrixXd& points = way->first;
    const Vector3d end = stage_.tip(points.rightCols(1)).p();
    Index i = points.cols() - 1;
    const double least_m = stretch.distance_m - 1.5 * stretch.tolerance.m;
    while (i > 0 && (stage_.tip(points.col(i)).p() - end).norm() < least_m) --i;
    return Landing{way->second, points.col(i)};
  }

  // To where a straight stretch begins, past everything, and along it.
  bool go_straight(Done& done, const Landing& landing, const SE3& pose,
                   const scene::Allowance& may_touch,
                   const std::vector<scene::TipConstraint>& constraints) {
    scene::Goal begin = scene::joint_goal(landing.begin);
    begin.tolerance_rad = begin_rad;
    begin.constraints = constraints;
    return reach(done, Stretch::there, begin) &&
           reach(done, Stretch::straight, exactly(line_to(pose, may_touch)));
  }

  // Tries grasps until the object can also be put down. What follows until then is planned, too.
  bool pick(Done& done, const Pick& pick) {
    const Object& object = task_.objects[pick.object];
    const SE3& pose = done.situation.poses[pick.object];
    scene::Stretch approach;
    approach.direction = pick.approach_axis;
    approach.distance_m = pick.approach_m;
    for (round_ = 0; round_ < rounds; ++round_) {
      std::vector<std::size_t> left(object.grasps.size());
      std::iota(left.begin(), left.end(), std::size_t{0});
      while (!left.empty()) {
        std::vector<SE3> poses;
        poses.reserve(left.size());
        for (const std::size_t k : left) poses.push_back(pose * object.grasps[k]);
        const auto landing = land(done, poses, approach, {{}, {object.solid.name}});
        if (!landing) break;
        const std::size_t taken = left[landing->option];
        Done next = done;
        if (take(next, pick, *landing, taken) && (next.step == task_.steps.size() || go_on(next))) {
          done = std::move(next);
          round_ = 0;
          return true;
        }
        std::erase(left, taken);
      }
    }
    round_ = 0;
    return false;
  }

  bool take(Done& done, const Pick& pick, const Landing& landing, std::size_t taken) {
    const Object& object = task_.objects[pick.object];
    Situation& now = done.situation;
    const SE3 pose = now.poses[pick.object];
    const SE3 tip = pose * object.grasps[taken];
    const scene::Allowance itself{{}, {object.solid.name}};
    if (!go_straight(done, landing, tip, itself, {})) return false;
    const SE3 grasp = pose.inverse() * stage_.tip(now.q);
    now.held = Held{pick.object,
                    object.grasps[taken],
                    pick.approach_axis,
                    pose.R().col(2),
                    now.q,
                    held_at(grasp, payloads_[pick.object])};
    scene::Event attach;
    attach.goals_reached = done.goals.size();
    attach.attach = now.held->payload;
    attach.obstacle = object.solid.name;
    const scene::Allowance around = stage_.around(pick.object, {pose}, object.stands_on);
    if (!reach(done, Stretch::away, line_to(moved(tip, pick.lift_m * Vector3d::UnitZ()), around)))
      return false;
    done.events.push_back(std::move(attach));
    done.lines.push_back(fmt::format("pick '{}': grasp {} of {}", object.solid.name, taken + 1,
                                     object.grasps.size()));
    ++done.step;
    return true;
  }

  bool place(Done& done, const Place& place) {
    std::vector<SE3> tips;
    for (const SE3& pose : place.poses)
      tips.push_back(moved(pose, place.gap_m * Vector3d::UnitZ()) * done.situation.held->grasp);
    scene::Stretch down;
    down.direction = -Vector3d::UnitZ();
    down.in_world = true;
    down.distance_m = place.lower_m;
    const std::size_t object = done.situation.held->object;
    const auto landing = land(done, tips, down, stage_.around(object, place.poses, place.onto));
    return landing && put_down(done, place, *landing, tips[landing->option]);
  }

  bool put_down(Done& done, const Place& place, const Landing& landing, const SE3& tip) {
    Situation& now = done.situation;
    const Held held = *now.held;
    const Object& object = task_.objects[held.object];
    const scene::Allowance around =
        stage_.around(held.object, {place.poses[landing.option]}, place.onto);
    std::vector<scene::TipConstraint> kept;
    if (place.tilt_rad)
      kept.emplace_back(scene::AxisConstraint{held.grasp.R().transpose() * Vector3d::UnitZ(),
                                              held.upright, *place.tilt_rad});
    if (place.speed_m_s) kept.emplace_back(scene::SpeedConstraint{*place.speed_m_s});
    if (!go_straight(done, landing, tip, around, kept)) return false;
    scene::Event detach;
    detach.goals_reached = done.goals.size();
    detach.detach = object.solid.name;
    now.held.reset();
    now.poses[held.object] = stage_.tip(now.q) * held.grasp.inverse();
    const Vector3d back = -(tip.R() * held.approach_axis);
    // The object is let go where the arm begins to leave, and may touch what is below until then.
    scene::Goal leave = line_to(moved(tip, std::min(leaving_m, place.retreat_m) * back), around);
    leave.tolerance_m = grasp_m;
    if (!reach(done, Stretch::away, leave) ||
        !reach(done, Stretch::away,
               line_to(moved(tip, place.retreat_m * back), {{}, {object.solid.name}})))
      return false;
    done.events.push_back(std::move(detach));
    done.lines.push_back(fmt::format("place '{}': pose {} of {}", object.solid.name,
                                     landing.option + 1, place.poses.size()));
    ++done.step;
    return true;
  }

  bool move(Done& done, const Move& move) {
    if (!reach(done, Stretch::there, move.goal)) return false;
    done.lines.push_back(fmt::format("move to a {} goal", scene::type_name(move.goal)));
    ++done.step;
    return true;
  }

  const Task& task_;
  Stage stage_;
  std::vector<scene::Payload> payloads_;  ///< of the objects, at their centres
  int round_ = 0;
  std::size_t failed_ = 0;  ///< the farthest step that failed
  Stretch failed_stretch_ = Stretch::any;
  std::string cause_;
};

}  // namespace

TaskPlan plan_task(const Task& task, const std::function<void()>& poll) {
  return Planner(task, poll).plan();
}

}  // namespace hamelin::task
