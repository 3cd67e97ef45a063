#include "hamelin/sweep/run_facts.hpp"

#include "hamelin/sweep/failure_class.hpp"

namespace hamelin::sweep {

namespace {

// A member of an object; null if there is none.
const Json& member(const Json& object, const char* key) {
  static const Json none;
  if (!object.is_object()) return none;
  const auto found = object.find(key);
  return found == object.end() ? none : *found;
}

std::optional<double> number_at(const Json& object, const char* key) {
  const Json& value = member(object, key);
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

std::string text_at(const Json& object, const char* key) {
  const Json& value = member(object, key);
  return value.is_string() ? value.get<std::string>() : std::string();
}

void read_result(const Json& result, bool timing, RunFacts& facts) {
  facts.own_outcome = text_at(result, "outcome");
  facts.time_s = number_at(result, "time_s");
  facts.certified_share = number_at(result, "certified_share");
  facts.recovery_work_J = number_at(result, "recovery_work_J");
  facts.filter_work_J = number_at(result, "filter_work_J");
  facts.torque_change_mean = number_at(member(result, "torque_change"), "mean");
  facts.contact_arm_speed_m_s = number_at(member(result, "mover_contact"), "arm_speed_m_s");
  if (const Json& plant = member(result, "plant"); plant.is_object())
    facts.plant_contacts = number_at(plant, "contacts").value_or(0.0);
  if (const Json& escape = member(result, "escape"); escape.is_object())
    for (const auto& [name, value] : escape.items())
      if (value.is_number()) facts.escape[name] = value.get<double>();
  if (!timing) return;
  const Json& tick = member(member(result, "timing"), "tick_us");
  facts.tick_us_p50 = number_at(tick, "p50");
  facts.tick_us_p99 = number_at(tick, "p99");
}

void read_verdict(const Json& judge, RunFacts& facts) {
  const Json &obstacles = member(judge, "obstacles"), &self = member(judge, "self");
  facts.judged = obstacles.is_object() || self.is_object();
  facts.judge_saw_contact = judge.is_object() && judge.value("contact", false);
  facts.clearance_m = number_at(obstacles, "clearance_m");
  facts.self_clearance_m = number_at(self, "clearance_m");
}

}  // namespace

RunFacts facts_of(const Json& record, bool timing) {
  RunFacts facts;
  if (record.is_null()) return facts;
  facts.recorded = true;
  facts.outcome = text_at(record, "outcome");
  facts.cause = text_at(record, "cause");
  facts.success = is_success(facts.outcome);
  facts.failure = failure_class(record);
  facts.contact = judged_contact(record);
  facts.contact_time_s = judged_contact_time(record);
  read_result(member(record, "result"), timing, facts);
  read_verdict(member(record, "judge"), facts);
  return facts;
}

}  // namespace hamelin::sweep
