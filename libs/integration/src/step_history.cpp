#include "hamelin/integration/step_history.hpp"

#include <algorithm>

namespace hamelin::integration {

void StepHistory::restart(const dynamics::ConstVectorRef& v) {
  displacements_[0] = v;
  count_ = 0;
}

void StepHistory::record(double h, const dynamics::ConstVectorRef& delta) {
  const bool same_step = count_ > 0 && step_ == h;
  for (std::size_t i = displacements_.size() - 1; i > 0; --i)
    displacements_[i].swap(displacements_[i - 1]);
  displacements_[0] = delta;
  count_ = same_step ? std::min(count_ + 1, 4) : 1;
  step_ = h;
}

void StepHistory::guess(double h, dynamics::VectorRef delta) const {
  const auto& d = displacements_;
  if (count_ == 0)
    delta = h * d[0];
  else if (step_ != h)
    delta = d[0] * (h / step_);
  else if (count_ == 1)
    delta = d[0];
  else if (count_ == 2)
    delta = 2.0 * d[0] - d[1];
  else if (count_ == 3)
    delta = 3.0 * (d[0] - d[1]) + d[2];
  else
    delta = 4.0 * (d[0] + d[2]) - 6.0 * d[1] - d[3];
}

}  // namespace hamelin::integration
