#pragma once
#include <sys/types.h>
#include <unistd.h>

#include <fstream>
#include <string>

namespace hamelin::test {

/// Whether a process has ended within a minute. One that its parent has not reaped counts as ended.
inline bool has_ended(pid_t pid) {
  for (int i = 0; i < 6000; ++i) {
    std::ifstream status("/proc/" + std::to_string(pid) + "/stat");
    std::string number, name, state;
    status >> number >> name >> state;
    if (!status || state == "Z") return true;
    ::usleep(10'000);
  }
  return false;
}

}  // namespace hamelin::test
