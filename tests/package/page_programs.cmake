# cmake -Dsource=… -Dbinary=… -Dstage=… -Dpage=… … -P embedded.cmake
# Builds and runs the program of `page`; its program and CMake lines must be those in `source`.
file(READ "${page}" text)
file(READ "${source}/main.cpp" program)
string(FIND "${text}" "```cpp\n${program}```\n" at)
if(at EQUAL -1)
  message(FATAL_ERROR "${page}: its program is not ${source}/main.cpp")
endif()
file(STRINGS "${source}/CMakeLists.txt" lines)
list(SUBLIST lines 2 3 lines)
list(JOIN lines "\n" lines)
string(FIND "${text}" "```cmake\n${lines}\n```\n" at)
if(at EQUAL -1)
  message(FATAL_ERROR "${page}: its CMake lines are not those of ${source}/CMakeLists.txt")
endif()

file(REMOVE_RECURSE "${binary}")
execute_process(COMMAND "${CMAKE_COMMAND}" -S "${source}" -B "${binary}" -G "${generator}"
  "-DCMAKE_PREFIX_PATH=${stage}" "-DCMAKE_BUILD_TYPE=${build_type}"
  "-DCMAKE_CXX_COMPILER=${compiler}" "-DCMAKE_CXX_FLAGS=${flags}" COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${binary}" COMMAND_ERROR_IS_FATAL ANY)
file(GLOB_RECURSE planner "${stage}/hybrid.hamelin.so")
cmake_path(GET planner PARENT_PATH planners)
execute_process(COMMAND "${binary}/first" "${stage}/share/hamelin" "${planners}"
  OUTPUT_VARIABLE output ECHO_OUTPUT_VARIABLE COMMAND_ERROR_IS_FATAL ANY)
if(NOT output MATCHES "free fall: -?[0-9.e+-]+ J\nnearest obstacle: 0[.][0-9]+ m\nthe planner holds: [-0-9. e+]+ Nm\n$")
  message(FATAL_ERROR "unexpected output")
endif()
