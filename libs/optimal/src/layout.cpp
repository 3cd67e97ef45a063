#include "layout.hpp"

namespace hamelin::optimal {

Layout::Layout(const Problem& problem)
    : n_(problem.q_start.size()),
      intervals_(problem.intervals),
      free_time_(problem.objective == Objective::time),
      h_ref_(problem.duration_s / problem.intervals),
      fixed_(problem.limits.jerk.size() > 0 ? 1 : 0),
      q_start_(problem.q_start),
      v_start_(problem.v_start),
      q_goal_(problem.q_goal),
      v_goal_(problem.v_goal),
      sources_(static_cast<std::size_t>(points())) {
  for (Index i = 0; i < blocks(); ++i)
    sources_[static_cast<std::size_t>(first_point() + i)] = {i, 1.0, 0, 0.0, 0.0};
  set_end(0, 0, 1);
  set_end(1, intervals_ + 2, -1);
}

// The three points from an end inwards; `step` is also the sign of time.
void Layout::set_end(int end, Index outermost, Index step) {
  const auto set = [&](Index i, Index block, double share, double position_share, double steps) {
    const VectorXd& v = end == 0 ? v_start_ : v_goal_;
    sources_[static_cast<std::size_t>(outermost + step * i)] = {
        block, share, end, position_share, v.isZero(0.0) ? 0.0 : steps * static_cast<double>(step)};
  };
  if (fixed_ > 0) {
    for (Index i = 0; i < 3; ++i) set(i, -1, 0.0, 1.0, static_cast<double>(i - 1));
    return;
  }
  const Index block = outermost + 2 * step - first_point();
  set(0, block, 1.0, 0.0, -2.0);
  set(1, block, -0.5, 1.5, 0.5);
}

}  // namespace hamelin::optimal
