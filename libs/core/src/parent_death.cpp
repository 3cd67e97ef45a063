#include "hamelin/core/parent_death.hpp"

#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

namespace hamelin {

void end_with_parent(pid_t parent) noexcept {
  constexpr int not_set_up = 126;  // as shells exit if a program cannot be executed
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(not_set_up);  // it died before the line above
}

}  // namespace hamelin
