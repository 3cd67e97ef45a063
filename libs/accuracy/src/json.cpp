#include <initializer_list>
#include <utility>

#include "hamelin/accuracy/accuracy.hpp"
#include "hamelin/core/error.hpp"

namespace hamelin::accuracy {

namespace {

Json or_null(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json row_json(const Row& row) {
  return {{"integrator", row.integrator},
          {"order", row.order},
          {"order_asked", row.order_asked},
          {"step_s", or_null(row.step_s)},
          {"rtol", or_null(row.rtol)},
          {"atol", or_null(row.atol)},
          {"tolerance", or_null(row.tolerance)},
          {"outcome", row.completed ? "completed" : "diverged"},
          {"cause", row.cause ? Json(*row.cause) : Json(nullptr)},
          {"error_q", or_null(row.error_q)},
          {"error_v", or_null(row.error_v)},
          {"reference_error", or_null(row.reference_error)},
          {"reference_error_v", or_null(row.reference_error_v)},
          {"reference_limited", row.reference_limited},
          {"energy_error_max_J", or_null(row.energy_error_max_J)},
          {"drift_J_per_s", or_null(row.drift_J_per_s)},
          {"drift_ci_J_per_s", or_null(row.drift_ci_J_per_s)},
          {"energy_samples", row.energy_samples},
          {"cpu_us", or_null(row.cpu_us)},
          {"evaluations", row.evaluations},
          {"factorizations", row.factorizations},
          {"steps", row.steps},
          {"rejected", row.rejected},
          {"halvings", row.halvings},
          {"isa", row.isa},
          {"mode", row.mode}};
}

Row read_row(const Json& from) {
  const auto number = [](const Json& value) {
    return value.is_null() ? std::nullopt : std::optional(value.get<double>());
  };
  Row row;
  row.integrator = from["integrator"];
  row.order = from["order"];
  row.order_asked = from["order_asked"];
  row.completed = from["outcome"] == "completed";
  if (!from["cause"].is_null()) row.cause = from["cause"];
  row.reference_limited = from["reference_limited"];
  row.isa = from["isa"];
  row.mode = from["mode"];
  for (const auto& [key, value] :
       std::initializer_list<std::pair<const char*, std::optional<double>*>>{
           {"step_s", &row.step_s},
           {"rtol", &row.rtol},
           {"atol", &row.atol},
           {"tolerance", &row.tolerance},
           {"error_q", &row.error_q},
           {"error_v", &row.error_v},
           {"reference_error", &row.reference_error},
           {"reference_error_v", &row.reference_error_v},
           {"energy_error_max_J", &row.energy_error_max_J},
           {"drift_J_per_s", &row.drift_J_per_s},
           {"drift_ci_J_per_s", &row.drift_ci_J_per_s},
           {"cpu_us", &row.cpu_us}})
    *value = number(from[key]);
  for (const auto& [key, value] :
       std::initializer_list<std::pair<const char*, long*>>{{"energy_samples", &row.energy_samples},
                                                            {"evaluations", &row.evaluations},
                                                            {"factorizations", &row.factorizations},
                                                            {"steps", &row.steps},
                                                            {"rejected", &row.rejected},
                                                            {"halvings", &row.halvings}})
    *value = from[key].get<long>();
  return row;
}

}  // namespace

Json to_json(const Measurement& measurement) {
  Json rows = Json::array();
  for (const auto& row : measurement.rows) rows.push_back(row_json(row));
  Json reference;
  if (const auto& r = measurement.reference)
    reference = {{"scheme", r->scheme},
                 {"check", r->check},
                 {"error_q", r->error_q},
                 {"error_v", r->error_v},
                 {"evaluations", r->evaluations},
                 {"q", std::vector<double>(r->q.begin(), r->q.end())},
                 {"v", std::vector<double>(r->v.begin(), r->v.end())}};
  return {{"schema", "hamelin.accuracy/1"},    {"version", version()},
          {"name", measurement.name},          {"dof", measurement.dof},
          {"planar", measurement.planar},      {"duration_s", measurement.duration_s},
          {"reference", std::move(reference)}, {"rows", std::move(rows)},
          {"notes", measurement.notes}};
}

Measurement measurement_from_json(const Json& document, const std::string& where) {
  check_shipped_schema(document, "accuracy", where);
  const auto vector = [](const Json& value) {
    const auto numbers = value.get<std::vector<double>>();
    return Eigen::VectorXd(
        Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<long>(numbers.size())));
  };
  Measurement measurement;
  measurement.name = document["name"];
  measurement.dof = document["dof"];
  measurement.planar = document["planar"];
  measurement.duration_s = document["duration_s"];
  measurement.notes = document["notes"].get<std::vector<std::string>>();
  if (const Json& r = document["reference"]; !r.is_null())
    measurement.reference = Reference{vector(r["q"]), vector(r["v"]), r["error_q"],    r["error_v"],
                                      r["scheme"],    r["check"],     r["evaluations"]};
  for (const Json& from : document["rows"]) measurement.rows.push_back(read_row(from));
  return measurement;
}

}  // namespace hamelin::accuracy
