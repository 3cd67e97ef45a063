#include "hamelin/search/margins.hpp"

#include <algorithm>
#include <utility>

#include "hamelin/search/joint_metric.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::VectorXd;

void Margins::add(const VectorXd& q, double margin_m, double near, double far) {
  if (margin_m < full_) places_.push_back({q, margin_m, near, far});
}

double Margins::margin_at(const Place& place, double distance) const {
  const double weight = std::clamp((distance - place.near) / (place.far - place.near), 0.0, 1.0);
  return place.margin + weight * (full_ - place.margin);
}

Margins Margins::raised(double by_m, VectorXd stray) const {
  Margins out = *this;
  out.stray_ = std::move(stray);
  out.full_ += by_m;
  out.self_most_ += by_m;
  for (Place& place : out.places_) place.margin += by_m;
  return out;
}

double Margins::slope() const {
  double most = 0.0;
  for (const Place& place : places_)
    most = std::max(most, (full_ - place.margin) / (place.far - place.near));
  return most;
}

// docs/theory.md (17.1)
double Margins::required(const VectorXd& q) const {
  double margin = full_;
  for (const Place& place : places_)
    margin = std::min(margin, margin_at(place, weighted_distance(weights_, q, place.q)));
  return margin;
}

double Margins::least(const VectorXd& a, const VectorXd& b) const {
  double margin = full_;
  for (const Place& place : places_)
    margin = std::min(margin, margin_at(place, weighted_distance(weights_, a, b, place.q)));
  return margin;
}

}  // namespace hamelin::search
