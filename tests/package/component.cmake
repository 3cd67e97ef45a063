# cmake -Dsource=… -Dbinary=… -Dstage=… -Dhidden=fmt,… -Dnever=regex … -P component.cmake
# Configures a consumer of one component with the packages `hidden` disabled, builds it, prints its
# link line, which must not match `never`, and runs it.
file(REMOVE_RECURSE "${binary}")
set(arguments "-DCMAKE_PREFIX_PATH=${stage}" "-DCMAKE_BUILD_TYPE=${build_type}"
  "-DCMAKE_CXX_COMPILER=${compiler}" "-DCMAKE_CXX_FLAGS=${flags}")
string(REPLACE "," ";" hidden "${hidden}")
foreach(package IN LISTS hidden)
  list(APPEND arguments "-DCMAKE_DISABLE_FIND_PACKAGE_${package}=ON")
endforeach()
execute_process(COMMAND "${CMAKE_COMMAND}" -S "${source}" -B "${binary}" -G "${generator}" ${arguments}
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${binary}" --verbose
  OUTPUT_VARIABLE output ECHO_OUTPUT_VARIABLE COMMAND_ERROR_IS_FATAL ANY)
cmake_path(GET source FILENAME name)
string(REGEX MATCH "[^\n]* -o ${name} [^\n]*" link_line "${output}")
if(NOT link_line)
  message(FATAL_ERROR "the build output has no line that links ${name}")
endif()
message("link line: ${link_line}")
string(REGEX MATCH "${never}" unwanted "${link_line}")
if(unwanted)
  message(FATAL_ERROR "the link line of ${name} contains '${unwanted}', expected none of ${never}")
endif()
execute_process(COMMAND "${binary}/${name}" COMMAND_ERROR_IS_FATAL ANY)
