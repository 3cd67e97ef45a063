#include "sampler.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace hamelin::mcap {

Sampler::Sampler(std::optional<double> rate_hz, Receiver receiver)
    : rate_hz_(rate_hz), receiver_(std::move(receiver)) {
  if (rate_hz_) (void)log::sample_count(0.0, *rate_hz_);  // checks the rate
}

void Sampler::add_tick(const log::Trajectory::Point& point, const Json& tick) {
  if (!last_) begin_s_ = point.time_s;
  if (last_ && rate_hz_) add_samples(point);
  if (!rate_hz_) {
    pass_lines(point.time_s);
    receiver_.sample(point, tick);
  }
  last_ = Tick{point, tick};
}

void Sampler::add_samples(const log::Trajectory::Point& next) {
  for (const long count = log::sample_count(next.time_s - begin_s_, *rate_hz_); samples_ < count;
       ++samples_) {
    const double time_s = begin_s_ + static_cast<double>(samples_) / *rate_hz_;
    pass_lines(time_s);
    receiver_.sample(log::interpolated(last_->point, next, time_s), last_->line);
  }
}

void Sampler::add_line(const Json& line) {
  const double last_s = last_ ? last_->point.time_s : -std::numeric_limits<double>::infinity();
  const Json time = line.value("time_s", Json());
  double time_s = time.is_number() ? time.get<double>() : last_s;
  time_s = std::max(time_s, lines_.empty() ? last_s : lines_.back().time_s);
  lines_.push_back({time_s, line});
}

void Sampler::pass_lines(double time_s) {
  auto line = lines_.begin();
  for (; line != lines_.end() && line->time_s <= time_s; ++line)
    receiver_.line(line->time_s, line->line);
  lines_.erase(lines_.begin(), line);
}

void Sampler::finish() {
  if (!last_) return;
  if (rate_hz_) {
    pass_lines(last_->point.time_s);
    receiver_.sample(last_->point, last_->line);
  }
  pass_lines(std::numeric_limits<double>::infinity());
}

}  // namespace hamelin::mcap
