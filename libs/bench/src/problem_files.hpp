#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/bench/problem_set.hpp"

namespace hamelin::bench {

[[nodiscard]] inline std::vector<double> list(const Eigen::VectorXd& x) {
  return {x.begin(), x.end()};
}
/// @throws Error invalid if the text of a problem does not have the SHA-256 of the set
void check_made(const Problem& problem, const std::string& text, const std::string& where);
/// @throws Error io
void make_directory(const std::filesystem::path& directory);

}  // namespace hamelin::bench
