#include "line_margins.hpp"

#include <algorithm>
#include <cmath>

#include "line_arm.hpp"
#include "single_bounds.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::VectorXd;

LineMargins::LineMargins(Index dof)
    : weights_(VectorXd::Ones(dof)),
      middle_(VectorXd::Zero(dof)),
      place_q_(dof, kernel::places_max) {
  places_.reserve(kernel::places_max);
}

void LineMargins::set(const Margins& margins) {
  full_ = margins.full_m();
  self_most_ = margins.self_most_m();
  for (Index j = 0; j < weights_.size(); ++j) weights_[j] = margins.weight(j);
  const auto& places = margins.places();
  if (place_q_.cols() < static_cast<Index>(places.size()))
    place_q_.resize(weights_.size(), static_cast<Index>(places.size()));
  places_.clear();
  for (const auto& place : places) {
    place_q_.col(static_cast<Index>(places_.size())) = place.q;
    places_.push_back({place.margin, place.near, place.far});
  }
}

bool LineMargins::write(const VectorXd& a, const VectorXd& dq, kernel::Line& line) {
  line.full_margin = inflated(full_);
  line.self_most = inflated(self_most_);
  double square = 0.0;
  for (Index j = 0; j < a.size(); ++j) {
    line.weighted_step[j] = static_cast<float>(weights_[j] * dq[j]);
    square += std::pow(weights_[j] * dq[j], 2);
  }
  const double length = std::sqrt(square);
  line.weighted_length = inflated(length);
  line.place_count = 0;
  double farthest = 0.0;
  for (std::size_t k = 0; k < places_.size(); ++k) {
    const double distance = distance_from(k, a);
    if (distance - length > places_[k].far) continue;
    if (line.place_count == kernel::places_max) return false;
    kernel::Place& place = line.places[line.place_count++];
    for (Index j = 0; j < a.size(); ++j)
      place.apart[j] =
          static_cast<float>(weights_[j] * (a[j] - place_q_(j, static_cast<Index>(k))));
    place.margin = inflated(places_[k].margin);
    place.near = deflated(places_[k].near);
    place.inverse_range = inflated(1.0 / (places_[k].far - places_[k].near));
    farthest = std::max(farthest, distance);
  }
  constexpr double roundings = 32.0;
  line.distance_slack = inflated(roundings * LineArm::unit_roundoff * (farthest + length));
  return true;
}

LineMargins::Range LineMargins::range(const VectorXd& a, const VectorXd& b) {
  double square = 0.0;
  for (Index j = 0; j < a.size(); ++j) square += std::pow(weights_[j] * (b[j] - a[j]), 2);
  Range out{full_, full_, std::sqrt(square)};
  middle_ = 0.5 * (a + b);
  for (std::size_t k = 0; k < places_.size(); ++k) {
    const double distance = distance_from(k, middle_);
    out.most = std::min(out.most, margin_at(places_[k], distance + 0.5 * out.length));
    out.least = std::min(out.least, margin_at(places_[k], distance - 0.5 * out.length));
  }
  return out;
}

double LineMargins::distance_from(std::size_t place, const VectorXd& q) const {
  double square = 0.0;
  for (Index j = 0; j < q.size(); ++j)
    square += std::pow(weights_[j] * (q[j] - place_q_(j, static_cast<Index>(place))), 2);
  return std::sqrt(square);
}

double LineMargins::margin_at(const Place& place, double distance) const {
  const double share = std::clamp((distance - place.near) / (place.far - place.near), 0.0, 1.0);
  return place.margin + share * (full_ - place.margin);
}

}  // namespace hamelin::search
