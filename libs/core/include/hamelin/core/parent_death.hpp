#pragma once
#include <sys/types.h>

namespace hamelin {

/// To be called by a process that was just forked: the system kills it (SIGKILL) as soon as the
/// thread that forked it has ended, however that ended. Otherwise a run whose planner never returns
/// would use a processor forever after a kill of the sweep. The setting survives exec, but
/// processes that the caller starts do not inherit it. Safe between fork and exec.
/// @param parent the process that called fork; if it is dead already, the caller ends at once
void end_with_parent(pid_t parent) noexcept;

}  // namespace hamelin
