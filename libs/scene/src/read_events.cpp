#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "hamelin/core/text.hpp"
#include "read_scene.hpp"

namespace hamelin::scene {

namespace {

// An obstacle that an arm carries must be one that rests by itself, and that it can see.
void check_carried(const Reader& event, const Event& given, const Scene& scene) {
  if (!given.attach) event.fail("obstacle", "is given without attach, expected both");
  const std::vector<std::string> names = names_of(scene.obstacles);
  for (const Obstacle& obstacle : scene.obstacles)
    if (obstacle.attached_to == given.obstacle)
      event.fail("obstacle", fmt::format("obstacle '{}' is attached to '{}', expected an obstacle "
                                         "that nothing is attached to",
                                         obstacle.name, given.obstacle));
  const auto found = std::find(names.begin(), names.end(), given.obstacle);
  if (found == names.end())
    event.fail("obstacle",
               fmt::format("there is no obstacle '{}', expected one of the scene's {}{}",
                           given.obstacle, names.size(), did_you_mean(given.obstacle, names)));
  const Obstacle& o = scene.obstacles[static_cast<std::size_t>(found - names.begin())];
  if (moves(o) || o.shape == Shape::frame || !o.known || o.judge_only || o.appears_s > 0.0)
    event.fail("obstacle",
               fmt::format("'{}' moves, is a frame, or is not known from the start, expected a "
                           "solid that rests and is known",
                           given.obstacle));
}

}  // namespace

std::vector<Event> read_events(const Reader& in, const std::filesystem::path& folder,
                               const Scene& scene) {
  std::vector<Event> out;
  std::set<std::string> attached;
  if (scene.model.payload) attached.insert(scene.model.payload->name);
  in.each("events", [&](const Reader& given) {
    Event event;
    event.time_s = given.maybe<double>("time_s");
    event.goals_reached = given.maybe<std::size_t>("goals_reached");
    if (event.time_s.has_value() == event.goals_reached.has_value())
      given.fail("time_s", event.time_s ? "is given in addition to goals_reached, expected one of "
                                          "the two"
                                        : "is missing, expected time_s or goals_reached");
    if (event.goals_reached && *event.goals_reached >= scene.goals.size())
      given.fail("goals_reached",
                 fmt::format("is {}, expected less than the number of goals, {}, because the run "
                             "ends with the last one",
                             *event.goals_reached, scene.goals.size()));
    if (given.find("attach") != nullptr) event.attach = read_payload(given.child("attach"));
    event.detach = given.maybe<std::string>("detach");
    event.obstacle = given.get<std::string>("obstacle", "");
    if (!event.obstacle.empty()) check_carried(given, event, scene);
    event.required = given.get("required", true);
    if (given.find("map") != nullptr) event.map = read_map_change(given.child("map"), folder);
    if (event.attach && event.detach)
      given.fail("detach", "is given in addition to attach, expected one of the two");
    if (!event.attach && !event.detach && !event.map)
      given.fail("attach", "is missing, expected attach, detach or map");
    if (event.map && !scene.map) given.fail("map", "there is no map, expected one in the scene");
    if (event.attach && !attached.insert(event.attach->name).second)
      given.fail("attach/name",
                 fmt::format("'{}' is attached already, expected another name or a detach before",
                             event.attach->name));
    if (event.detach && scene.model.payload && *event.detach == scene.model.payload->name)
      given.fail("detach", fmt::format("'{}' is the payload of /model, which stays attached, "
                                       "expected what an earlier event attaches",
                                       *event.detach));
    if (event.detach && attached.erase(*event.detach) == 0)
      given.fail("detach",
                 fmt::format("'{}' is not attached, expected what an earlier event attaches",
                             *event.detach));
    out.push_back(std::move(event));
  });
  return out;
}

std::vector<WrenchSpec> read_wrenches(const Reader& in) {
  using dynamics::Reference;
  std::vector<WrenchSpec> out;
  in.each("wrenches", [&](const Reader& given) {
    WrenchSpec wrench;
    wrench.frame = given.get<std::string>("frame", "");
    wrench.reference =
        dynamics::reference_named(given.get<std::string>("reference", "local_world_aligned"))
            .value_or(Reference::local_world_aligned);
    wrench.force_N = given.vector("force_N", wrench.force_N);
    wrench.moment_Nm = given.vector("moment_Nm", wrench.moment_Nm);
    if (given.find("force_N") == nullptr && given.find("moment_Nm") == nullptr)
      given.fail("force_N", "is missing, expected force_N, moment_Nm or both");
    wrench.from_s = given.get("from_s", 0.0);
    wrench.to_s = given.maybe<double>("to_s");
    if (wrench.to_s && !(*wrench.to_s > wrench.from_s))
      given.fail("to_s",
                 fmt::format("is {}, expected more than from_s, {}", *wrench.to_s, wrench.from_s));
    out.push_back(std::move(wrench));
  });
  return out;
}

}  // namespace hamelin::scene
