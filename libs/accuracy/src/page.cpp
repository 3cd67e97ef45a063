#include <fmt/format.h>

#include "tables.hpp"

namespace hamelin::accuracy {

namespace {

Json table_json(const Table& table) {
  return {{"head", table.head}, {"words", table.text_columns}, {"rows", table.rows}};
}

Json rows_json(const Measurement& measurement, Json rows) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto bound = measurement.rows[i].error_bound();
    rows[i]["label"] = measurement.rows[i].label();
    rows[i]["error_bound"] = bound ? Json(*bound) : Json(nullptr);
  }
  return rows;
}

Json measurement_json(const Measurement& measurement) {
  const Json document = to_json(measurement);
  Json costs;
  if (measurement.reference) {
    const Table table = cheapest_table(measurement, typographic);
    costs = table_json(table);
    costs["comparisons_from"] = table.comparisons_from;
  }
  return {{"name", measurement.name},
          {"about", about(measurement)},
          {"notes", measurement.notes},
          {"reference_error",
           measurement.reference ? Json(measurement.reference->error_q) : Json(nullptr)},
          {"rows", rows_json(measurement, document["rows"])},
          {"costs", std::move(costs)},
          {"cheaper_peers", cheaper_peers(measurement)},
          {"table", table_json(rows_table(measurement, typographic))}};
}

}  // namespace

Json page_json(const std::vector<Measurement>& all) {
  Json measurements = Json::array();
  for (const auto& measurement : all) measurements.push_back(measurement_json(measurement));
  return {{"format", "hamelin.accuracy-page/1"},
          {"generator", fmt::format("hamelin {}", version())},
          {"measurements", std::move(measurements)}};
}

}  // namespace hamelin::accuracy
