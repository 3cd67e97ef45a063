# The staging folder is emptied first, so that files which are no longer installed are missing.
file(REMOVE_RECURSE "${stage}")
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${build}" --prefix "${stage}"
  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
