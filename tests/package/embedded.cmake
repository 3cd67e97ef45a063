# cmake -Dsource=… -Dbinary=… -Dstage=… -Dreadme=… … -P embedded.cmake
# The program and the CMake lines of the README's section "Use the libraries" are those in `source`; builds and runs it.
file(READ "${readme}" text)
string(FIND "${text}" "\n## Use the libraries\n" begin)
if(begin EQUAL -1)
  message(FATAL_ERROR "${readme}: has no section 'Use the libraries'")
endif()
string(SUBSTRING "${text}" ${begin} -1 section)
file(READ "${source}/main.cpp" program)
string(FIND "${section}" "```cpp\n${program}```\n" at)
if(at EQUAL -1)
  message(FATAL_ERROR "${readme}: the program in 'Use the libraries' is not ${source}/main.cpp")
endif()
file(STRINGS "${source}/CMakeLists.txt" lines)
list(SUBLIST lines 2 3 lines)
list(JOIN lines "\n" lines)
string(FIND "${section}" "```cmake\n${lines}\n```\n" at)
if(at EQUAL -1)
  message(FATAL_ERROR "${readme}: the CMake lines in 'Use the libraries' are not those of ${source}/CMakeLists.txt")
endif()

file(REMOVE_RECURSE "${binary}")
execute_process(COMMAND "${CMAKE_COMMAND}" -S "${source}" -B "${binary}" -G "${generator}" "-DCMAKE_PREFIX_PATH=${stage}"
  "-DCMAKE_BUILD_TYPE=${build_type}" "-DCMAKE_CXX_COMPILER=${compiler}" "-DCMAKE_CXX_FLAGS=${flags}"
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${binary}" COMMAND_ERROR_IS_FATAL ANY)
file(GLOB_RECURSE planner "${stage}/hybrid.hamelin.so")
cmake_path(GET planner PARENT_PATH planners)
execute_process(COMMAND "${binary}/first" "${stage}/share/hamelin" "${planners}" OUTPUT_VARIABLE output ECHO_OUTPUT_VARIABLE
  COMMAND_ERROR_IS_FATAL ANY)
if(NOT output MATCHES "free fall: -?[0-9.e+-]+ J\nnearest obstacle: 0[.][0-9]+ m\nthe planner holds: [-0-9. e+]+ Nm\n$")
  message(FATAL_ERROR "unexpected output")
endif()
