#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/bench/moving.hpp"
#include "hamelin/bench/problem_set.hpp"

namespace hamelin::bench {

/// The arm of a set, as the judge models it.
[[nodiscard]] sweep::JudgedArm judged_arm(const RobotFiles& robot);

/// The scene (hamelin.scene/1) of a problem whose obstacles move, without its robot, so that it
/// does not depend on the place of files.
[[nodiscard]] std::string moving_problem_text(const Problem& problem, const sweep::JudgedArm& arm);

/// What planners are told of the obstacles' motion; none: as drawn.
using PredictionChoice = std::optional<scene::Prediction>;
/// "drawn", or the name of the prediction: a label of runs.
[[nodiscard]] std::string describe(const PredictionChoice& choice);

/// Labels of the runs of a problem, by which results are grouped.
[[nodiscard]] std::map<std::string, std::string> labels(const Problem& problem,
                                                        const PredictionChoice& choice);

/// Writes scenes with the robot of the set to `directory`/NAME.json, or NAME-PREDICTION.json with
/// another prediction than the drawn one, and nothing if one is not the published one.
/// @param where the set's file, for messages
/// @return the files: for each prediction, each problem
/// @throws Error as write_problems()
[[nodiscard]] std::vector<std::filesystem::path> write_moving_scenes(
    const ProblemSet& set, const std::vector<Problem>& problems,
    const std::vector<PredictionChoice>& predictions, const std::filesystem::path& directory,
    const std::string& where);

}  // namespace hamelin::bench
