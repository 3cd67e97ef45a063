# cmake -Dsource=file.c -Dbinary=… -Dstage=… -Dcompiler=cc -Dflags=… -Dexpected=regex -P pkg_config.cmake
# Builds the program in C with the flags that pkg-config prints of the install `stage`, and runs it
# with a scene and the planners of the install; its output must match `expected`.
file(GLOB_RECURSE pc "${stage}/hamelin.pc")
cmake_path(GET pc PARENT_PATH folder)
function(pkg_config out)
  execute_process(COMMAND "${CMAKE_COMMAND}" -E env "PKG_CONFIG_PATH=${folder}" pkg-config ${ARGN} hamelin
    OUTPUT_VARIABLE text OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(text UNIX_COMMAND "${text}")
  set(${out} ${text} PARENT_SCOPE)
endfunction()
pkg_config(arguments --cflags --libs)
pkg_config(libraries --variable=libdir)
pkg_config(planners --variable=plugindir)
separate_arguments(flags UNIX_COMMAND "${flags}")
execute_process(COMMAND "${compiler}" ${flags} "${source}" ${arguments} -o "${binary}" COMMAND_ERROR_IS_FATAL ANY)
set(ENV{LD_LIBRARY_PATH} "${libraries}")
execute_process(COMMAND "${binary}" "${stage}/share/hamelin/scenes/clutter.json" "${planners}"
  OUTPUT_VARIABLE output ECHO_OUTPUT_VARIABLE COMMAND_ERROR_IS_FATAL ANY)
if(NOT output MATCHES "${expected}")
  message(FATAL_ERROR "${source}: its output does not match ${expected}")
endif()
