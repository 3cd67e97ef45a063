# A fresh stage each time, so that a file no longer installed is missed.
file(REMOVE_RECURSE "${stage}")
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${build}" --prefix "${stage}" OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
