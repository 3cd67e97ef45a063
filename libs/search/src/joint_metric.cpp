#include "hamelin/search/joint_metric.hpp"

#include "hamelin/scene/levers.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// A revolute joint counts fully if its lever is at least this share of the longest, and never less
// than `least`.
constexpr double full_share = 0.25, least = 0.3;
// A prismatic joint counts as a revolute one with this share of the longest lever.
constexpr double slide_share = 0.5;

}  // namespace

VectorXd joint_weights(const model::Model& model) {
  const scene::Levers levers(model, nullptr);
  const Index n = model.dof();
  VectorXd longest = VectorXd::Ones(n);
  if (levers.shapes().rows() > 0) longest = levers.shapes().colwise().maxCoeff();
  double all = 0.0;
  for (Index j = 0; j < n; ++j)
    if (!levers.slides(j)) all = std::max(all, longest[j]);
  if (!(all > 0.0)) return VectorXd::Ones(n);
  VectorXd weights(n);
  for (Index j = 0; j < n; ++j)
    weights[j] = levers.slides(j) ? 1.0 / (slide_share * all)
                                  : std::clamp(longest[j] / (full_share * all), least, 1.0);
  return weights;
}

}  // namespace hamelin::search
