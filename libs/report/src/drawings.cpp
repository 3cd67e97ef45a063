#include "drawings.hpp"

namespace hamelin::report {

void Drawings::add(double time_s, const std::vector<std::vector<double>>& lines) {
  std::size_t numbers = 0;
  for (const auto& line : lines) numbers += line.size();
  if (position_.size() + numbers > 3 * points_max_) {
    ++left_out_;
    return;
  }
  t_.push_back(time_s);
  lines_.push_back(static_cast<double>(lines.size()));
  for (const auto& line : lines) {
    const std::size_t points = line.size() / 3;
    points_.push_back(static_cast<double>(points));
    position_.insert(position_.end(), line.begin(), line.end());
  }
}

Json Drawings::json(Container& container) const {
  constexpr double step_m = 2e-4;
  if (t_.empty()) return nullptr;
  return {{"t", container.exact(t_)},
          {"lines", container.stepped(lines_, 1.0)},
          {"points", container.stepped(points_, 1.0)},
          {"position_m", container.centred(position_, step_m)}};
}

}  // namespace hamelin::report
