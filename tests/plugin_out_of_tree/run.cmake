# cmake -Dsource=… -Dwork=… -Dstage=… -Dgenerator=… -Dcompiler=… -Dtype=… -Dsanitize=… -Dflags=…
#   -Djudge=… -Dnm=… -P run.cmake
# Copies the plugin in `source` to `work`, builds it against the install in `stage`, runs `judge` on
# it and checks its exported symbols.
file(REMOVE_RECURSE "${work}")
file(COPY "${source}/" DESTINATION "${work}/source")
execute_process(
  COMMAND "${CMAKE_COMMAND}" -S "${work}/source" -B "${work}/build" -G "${generator}"
    "-DCMAKE_PREFIX_PATH=${stage}" "-DCMAKE_CXX_COMPILER=${compiler}" "-DCMAKE_BUILD_TYPE=${type}"
    "-DHAMELIN_SANITIZE=${sanitize}" "-DCMAKE_CXX_FLAGS=${flags}"
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${work}/build" COMMAND_ERROR_IS_FATAL ANY)
set(plugin "${work}/build/lib/hamelin/plugins/template.hamelin.so")
execute_process(COMMAND ${judge} "${plugin}" COMMAND_ERROR_IS_FATAL ANY)
# Only the entry point may be exported. Coverage and sanitizers add symbols of their own.
if(NOT flags)
  execute_process(COMMAND "${nm}" -D --defined-only "${plugin}"
    OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
  if(NOT symbols MATCHES "^[0-9a-f]+ T hamelin_plugin_entry(@@[^\n]*)?\n$")
    message(FATAL_ERROR "expected one exported symbol, hamelin_plugin_entry, found:\n${symbols}")
  endif()
endif()
