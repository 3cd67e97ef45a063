#include "hamelin/sweep/ablation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "hamelin/core/error.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/overrides.hpp"
#include "variant.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view params_pointer = "/planner/params/";

// The key of "/planner/params/KEY=VALUE"; empty for assignments of other values.
std::string parameter_key(std::string_view assignment) {
  if (!assignment.starts_with(params_pointer)) return {};
  const auto rest = assignment.substr(params_pointer.size());
  return std::string(rest.substr(0, rest.find_first_of("=/")));
}

// The parameters that assignments set.
Json params_of(const std::vector<std::string>& assignments) {
  Json document = Json::object();
  for (const auto& assignment : assignments)
    if (assignment.starts_with(params_pointer)) scene::set_pointer(document, assignment);
  return document.empty() ? Json::object() : document["planner"]["params"];
}

// Whether an assignment sets this parameter, or an object that contains it.
bool sets_parameter(const std::string& assignment, const std::string& name) {
  const std::string pointer = assignment.substr(0, assignment.find('=')) + "/",
                    target = fmt::format("{}{}/", params_pointer, name);
  return pointer.starts_with(target) || target.starts_with(pointer);
}

bool has_type(const Json& rule, std::string_view type) {
  const Json types = rule.value("type", Json());
  return types == type ||
         (types.is_array() && std::find(types.begin(), types.end(), type) != types.end());
}

/// The parameters of one planner, and what switches them off.
class Parameters {
 public:
  Parameters(const Variant& variant, const std::vector<fs::path>& plugin_directories)
      : plugin_(planning::find_plugin(*variant.planner, plugin_directories)),
        given_(params_of(variant.set)),
        now_(planning::check_params(plugin_, given_)) {
    rules_ = plugin_.params_schema().value("properties", Json::object());
  }

  [[nodiscard]] bool has(const std::string& name) const { return rules_.contains(name); }
  [[nodiscard]] Json now(const std::string& name) const { return now_.value(name, Json()); }

  // Why the planner does not allow a value; empty if it does.
  [[nodiscard]] std::string refusal(const std::string& name, const Json& value) const {
    Json changed = given_;
    changed[name] = value;
    try {
      (void)planning::check_params(plugin_, changed);
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  }

  // The negation of a boolean, the zero of a number; none for other types, and if the planner does
  // not allow it.
  [[nodiscard]] std::optional<Json> off(const std::string& name) const {
    const Json& rule = rules_[name];
    if (has_type(rule, "boolean") && now(name).is_boolean()) return !now(name).get<bool>();
    const bool number = has_type(rule, "number") || has_type(rule, "integer");
    if (number && refusal(name, 0).empty()) return Json(0);
    return {};
  }

  // What can be ablated: "a, b, c=VALUE".
  [[nodiscard]] std::string choices() const {
    std::vector<std::string> names;
    for (const auto& [name, rule] : rules_.items())
      if (const auto value = off(name)) {
        if (*value != now(name)) names.push_back(name);
      } else if (rule.contains("enum")) {
        names.push_back(name + "=VALUE");
      }
    return names.empty() ? "PARAMETER=VALUE" : fmt::format("{}", fmt::join(names, ", "));
  }

 private:
  planning::Plugin plugin_;
  Json given_, now_, rules_;
};

[[noreturn]] void refuse_part(const std::string& part, const std::string& what) {
  throw Error(ErrorCode::usage, fmt::format("--ablate {}: {}", part, what));
}

// The value of the parameter without the part.
Json value_without(const std::string& planner, const std::string& part, const std::string& name,
                   const Parameters& parameters) {
  if (!parameters.has(name))
    refuse_part(part, fmt::format("planner '{}' has no parameter '{}', expected one of {}", planner,
                                  name, parameters.choices()));
  Json value;
  if (name.size() < part.size()) {
    value = params_of({fmt::format("{}{}", params_pointer, part)})[name];
    if (const auto why = parameters.refusal(name, value); !why.empty()) refuse_part(part, why);
  } else if (const auto off = parameters.off(name)) {
    value = *off;
  } else {
    refuse_part(
        part, fmt::format("'{1}' of planner '{0}' can be neither 0 nor negated, expected {1}=VALUE "
                          "or one of {2}",
                          planner, name, parameters.choices()));
  }
  if (value == parameters.now(name))
    refuse_part(part, fmt::format("planner '{}' has {}={} already, expected another value", planner,
                                  name, value.dump()));
  return value;
}

// The text of a value after "key=" in a planner, where commas separate parameters.
std::string planner_text_of(const Json& value) {
  if (!value.is_string()) return value.dump();
  const std::string& text = value.get_ref<const std::string&>();
  const bool plain = text.find_first_of(",\"[{") == std::string::npos && !Json::accept(text);
  return plain ? text : value.dump();
}

}  // namespace

Ablation make_ablation(const std::string& planner, const std::string& part,
                       const std::vector<fs::path>& plugin_directories) {
  const std::string name = part.substr(0, part.find('='));
  if (name.empty()) refuse_part(part, "no parameter, expected PARAMETER or PARAMETER=VALUE");
  if (scene::python_planner(planner, "--planner"))
    refuse_part(part,
                fmt::format("'{}' is written in Python, expected a planner whose plugin has a "
                            "schema of its parameters",
                            planner));
  const Variant variant = parse_variant(planner, ".");
  const Json value = value_without(planner, part, name, Parameters(variant, plugin_directories));
  std::vector<std::string> others;
  for (const auto& assignment : variant.set)
    if (const auto key = parameter_key(assignment); !key.empty() && key != name)
      others.push_back(assignment.substr(params_pointer.size()));
  others.push_back(fmt::format("{}={}", name, planner_text_of(value)));
  return {planner,
          fmt::format("{}:{}", planner.substr(0, planner.find(':')), fmt::join(others, ",")), name,
          value};
}

void add_ablations(PlanOptions& options, const std::vector<std::string>& parts) {
  if (parts.empty()) return;
  std::vector<std::string> planners;
  const auto given = std::move(options.planners);
  for (const auto& planner : given) {
    planners.push_back(planner);
    for (const auto& part : parts) {
      Ablation ablation = make_ablation(planner, part, options.plugin_directories);
      for (const auto& assignment : options.set)
        if (sets_parameter(assignment, ablation.parameter))
          refuse_part(part,
                      fmt::format("--set {} sets this parameter in all runs, expected it to be "
                                  "set by --planner NAME:key=value",
                                  assignment));
      if (std::find(planners.begin(), planners.end(), ablation.without) != planners.end())
        refuse_part(part, fmt::format("'{}' is planned already, expected each part once",
                                      ablation.without));
      planners.push_back(ablation.without);
      options.ablations.push_back(std::move(ablation));
    }
  }
  options.planners = std::move(planners);
}

std::string part_of(const Ablation& ablation) {
  return fmt::format("{}={}", ablation.parameter, planner_text_of(ablation.value));
}

}  // namespace hamelin::sweep
