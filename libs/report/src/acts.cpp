#include "acts.hpp"

namespace hamelin::report {

namespace {

const char* name_of(double number) {
  if (number == 1.0) return "stop";
  if (number == 2.0) return "back";
  if (number == 3.0) return "aside";
  return nullptr;
}

}  // namespace

void Acts::add(double time_s, double number) {
  if (open_) acts_.back()["until"] = time_s;
  const char* const act = name_of(number);
  if (act == last_) return;
  last_ = act;
  open_ = act != nullptr && acts_.size() < acts_max_;
  if (open_)
    acts_.push_back({{"t", time_s}, {"until", time_s}, {"act", act}});
  else if (act != nullptr)
    ++left_out_;
}

}  // namespace hamelin::report
