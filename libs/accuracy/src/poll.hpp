#pragma once
#include "hamelin/accuracy/accuracy.hpp"

namespace hamelin::accuracy {

/// Calls Options::poll before every 1000th step.
inline void poll(const Options& options, long step) {
  if (step % 1000 == 0 && options.poll) options.poll();
}

}  // namespace hamelin::accuracy
