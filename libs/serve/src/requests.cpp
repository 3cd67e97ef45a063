#include "requests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <string_view>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/parts.hpp"

namespace hamelin::serve {

namespace {

using control::Controller;
using std::filesystem::path;

std::string name_in(const Json& value, const char* key) {
  if (!value.is_string())
    throw Error(ErrorCode::invalid, fmt::format("request: /{}: expected a string", key));
  return value.get<std::string>();
}

// The configuration in which something is attached or detached.
Eigen::VectorXd q_in(const Json& request) {
  const Json q = request.value("q", Json());
  if (!q.is_array() ||
      !std::all_of(q.begin(), q.end(), [](const Json& x) { return x.is_number(); }))
    throw Error(ErrorCode::invalid, "request: /q: expected a list of joint positions");
  const auto values = q.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

struct Request {
  const char* key;
  Json (*answer)(Controller&, const Json& value, const Json& request, const path& folder);
};

const std::array<Request, 10>& requests() {
  using C = Controller&;
  using J = const Json&;
  using P = const path&;
  static const std::array<Request, 10> all{{
      {"goals",
       [](C c, J value, J, P folder) -> Json {
         return c.set_goals(scene::goals_from_json(value, folder, "request"));
       }},
      {"planner_params",
       [](C c, J value, J, P) -> Json {
         c.set_planner_params(value);
         return true;
       }},
      {"obstacle",
       [](C c, J value, J, P folder) -> Json {
         return c.world().set_obstacle(scene::obstacle_from_json(value, folder, "request"));
       }},
      {"remove_obstacle",
       [](C c, J value, J, P) -> Json {
         return c.world().remove_obstacle(name_in(value, "remove_obstacle"));
       }},
      {"map",
       [](C c, J value, J, P folder) -> Json {
         return c.world().set_map(scene::map_from_json(value, folder, "request"));
       }},
      {"map_change",
       [](C c, J value, J, P folder) -> Json {
         return c.world().change_map(scene::map_change_from_json(value, folder, "request"));
       }},
      {"attach",
       [](C c, J value, J request, P) -> Json {
         return c.attach(scene::payload_from_json(value, "request"), q_in(request));
       }},
      {"detach",
       [](C c, J value, J request, P) -> Json {
         return c.detach(name_in(value, "detach"), q_in(request));
       }},
      {"stop",
       [](C c, J value, J, P) -> Json {
         c.stop(name_in(value, "stop"));
         return true;
       }},
      {"resume",
       [](C c, J, J, P) -> Json {
         c.resume();
         return true;
       }},
  }};
  return all;
}

Json answer(Controller& controller, const Json& request, const path& folder) {
  std::vector<std::string> keys;
  for (const Request& one : requests()) {
    if (request.is_object() && request.contains(one.key))
      return {{one.key, one.answer(controller, request[one.key], request, folder)}};
    keys.emplace_back(one.key);
  }
  throw Error(ErrorCode::invalid,
              fmt::format("request: expected an object with one of {}", fmt::join(keys, ", ")));
}

}  // namespace

std::string answer_request(Controller& controller, const std::string& text, const path& folder) {
  try {
    return answer(controller, parse_json(text, "request"), folder).dump();
  } catch (const std::exception& e) {
    return Json{{"error", one_line(e.what())}}.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
}

}  // namespace hamelin::serve
