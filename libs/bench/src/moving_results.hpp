#pragma once
#include <filesystem>

#include "hamelin/bench/results.hpp"
#include "hamelin/io/text_table.hpp"

/// What results of problems with moving obstacles have besides those of others.
namespace hamelin::bench {

/// Labels of their runs besides family, problem and planner.
inline constexpr const char *obstacles_label = "obstacles", *speed_label = "speed_max_m_s",
                            *prediction_label = "prediction";

/// Adds the prediction to the planner's name in each run that has another one than drawn.
void name_predictions(sweep::Sweeps& sweeps);
/// By planner. @param directory of the sweep, for explanation_file()
[[nodiscard]] std::map<std::string, ContactCounts> count_contacts(
    const sweep::Sweeps& sweeps, const std::filesystem::path& directory);

/// How many problems of each cell each planner solves.
[[nodiscard]] TextTable cell_table(const Results& results);
/// Contacts of each planner, by whether the arm moved, and by whether they were avoidable if that
/// was searched.
[[nodiscard]] TextTable contact_table(const Results& results);
/// hamelin.benchmark/1: contacts
[[nodiscard]] Json contacts_json(const Results& results);

}  // namespace hamelin::bench
