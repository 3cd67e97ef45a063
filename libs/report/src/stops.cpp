#include "stops.hpp"

#include <cmath>

namespace hamelin::report {

namespace {

// Angles are rounded as those of the frames are.
Json rounded(const Eigen::VectorXd& q) {
  constexpr double per_unit = 1e6;
  Json out = Json::array();
  for (const double x : q) out.push_back(std::round(per_unit * x) / per_unit);
  return out;
}

}  // namespace

void Stops::add(double time_s, const std::string* cause, const Eigen::VectorXd& q,
                const Eigen::VectorXd& q_end) {
  if (open_) stops_.back()["until"] = time_s;
  const bool usable = cause != nullptr && q.allFinite() && q_end.allFinite();
  const bool same = usable && (open_ || dropped_) && q_end == q_end_;
  if (same) return;
  open_ = dropped_ = false;
  if (!usable) return;
  q_end_ = q_end;
  dropped_ = stops_.size() >= stops_max_;
  open_ = !dropped_;
  if (dropped_) {
    ++left_out_;
    return;
  }
  stops_.push_back({{"t", time_s},
                    {"until", time_s},
                    {"cause", *cause},
                    {"q", rounded(q)},
                    {"q_end", rounded(q_end)}});
}

}  // namespace hamelin::report
