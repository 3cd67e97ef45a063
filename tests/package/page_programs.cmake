# cmake -Dsource=… -Dbinary=… -Dstage=… -Dpage=… -Dprograms=a,b -Dargument=… -Dexpected=regex …
#   -P page_programs.cmake
# Builds the programs of `page` against the install `stage` and runs each with the file or folder
# `argument` of the install and the folder of its planners. The page must contain the sources in
# `source` and its CMakeLists.txt; the output of each program must match `expected`.
file(READ "${page}" text)
file(GLOB sources "${source}/*.c" "${source}/*.cpp")
foreach(file IN LISTS sources)
  file(READ "${file}" program)
  cmake_path(GET file EXTENSION LAST_ONLY language)
  string(REPLACE "." "```" fence "${language}")
  string(FIND "${text}" "${fence}\n${program}```\n" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "${page}: does not contain ${file}")
  endif()
endforeach()
file(READ "${source}/CMakeLists.txt" lines)
string(FIND "${text}" "```cmake\n${lines}```\n" at)
if(at EQUAL -1)
  message(FATAL_ERROR "${page}: does not contain ${source}/CMakeLists.txt")
endif()

file(REMOVE_RECURSE "${binary}")
execute_process(COMMAND "${CMAKE_COMMAND}" -S "${source}" -B "${binary}" -G "${generator}"
  "-DCMAKE_PREFIX_PATH=${stage}" "-DCMAKE_BUILD_TYPE=${build_type}"
  "-DCMAKE_C_COMPILER=${c_compiler}" "-DCMAKE_CXX_COMPILER=${compiler}"
  "-DCMAKE_C_FLAGS=${flags}" "-DCMAKE_CXX_FLAGS=${flags}" COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${binary}" COMMAND_ERROR_IS_FATAL ANY)
file(GLOB_RECURSE planner "${stage}/hybrid.hamelin.so")
cmake_path(GET planner PARENT_PATH planners)
string(REPLACE "," ";" programs "${programs}")
foreach(program IN LISTS programs)
  execute_process(COMMAND "${binary}/${program}" "${stage}/share/hamelin/${argument}" "${planners}"
    OUTPUT_VARIABLE output ECHO_OUTPUT_VARIABLE COMMAND_ERROR_IS_FATAL ANY)
  if(NOT output MATCHES "${expected}")
    message(FATAL_ERROR "${program}: its output does not match ${expected}")
  endif()
endforeach()
