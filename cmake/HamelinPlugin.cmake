# hamelin_plugin(NAME mine SOURCES mine.cpp [SCHEMA params.schema.json] [LINKS ...])
#
# Builds the planner plugin NAME.hamelin.so, in this tree or, after find_package(hamelin), outside
# of it. SCHEMA is the JSON Schema of the planner's parameters; it becomes the string literal
# `params_schema` in the generated header "params_schema.hpp". TEST_ONLY, in this tree only,
# excludes a plugin from the install and from the planners' folder.
include(GNUInstallDirs)

function(hamelin_plugin)
  cmake_parse_arguments(PARSE_ARGV 0 arg "TEST_ONLY" "NAME;SCHEMA" "SOURCES;LINKS")
  if(NOT arg_NAME OR NOT arg_SOURCES OR arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR
      "hamelin_plugin: expected NAME and SOURCES; unknown arguments: '${arg_UNPARSED_ARGUMENTS}'")
  endif()
  set(target hamelin_plugin_${arg_NAME})
  set(generated "${CMAKE_CURRENT_BINARY_DIR}/${target}")
  add_library(${target} MODULE ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE hamelin::planning ${arg_LINKS}
    $<TARGET_NAME_IF_EXISTS:hamelin_options>)
  target_compile_features(${target} PRIVATE cxx_std_20)
  if(arg_SCHEMA)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS
      "${CMAKE_CURRENT_SOURCE_DIR}/${arg_SCHEMA}")
    file(READ "${arg_SCHEMA}" schema)
    file(CONFIGURE OUTPUT "${generated}/params_schema.hpp" @ONLY
      CONTENT "#pragma once\ninline constexpr const char* params_schema = R\"hamelin(${schema})hamelin\";\n")
    target_include_directories(${target} PRIVATE "${generated}")
  endif()
  set_target_properties(${target} PROPERTIES PREFIX "" OUTPUT_NAME ${arg_NAME} SUFFIX ".hamelin.so"
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON CXX_EXTENSIONS OFF
    LIBRARY_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/lib/hamelin/plugins")
  # Only the entry point is exported, so that linked libraries and templates do not clash with the
  # host's copies.
  file(CONFIGURE OUTPUT "${generated}/exports.map" @ONLY
    CONTENT "{\n  global: hamelin_plugin_entry;\n  local: *;\n};\n")
  target_link_options(${target} PRIVATE "LINKER:--version-script=${generated}/exports.map")
  set_property(TARGET ${target} APPEND PROPERTY LINK_DEPENDS "${generated}/exports.map")
  if(NOT HAMELIN_SANITIZE)  # the program provides the sanitizers' run-time library
    target_link_options(${target} PRIVATE LINKER:-z,defs)
  endif()
  if(arg_TEST_ONLY)
    set_target_properties(${target} PROPERTIES
      LIBRARY_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/lib/hamelin/test_plugins")
  else()
    set_property(GLOBAL APPEND PROPERTY HAMELIN_PLUGINS ${target})
    install(TARGETS ${target} LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}/hamelin/plugins")
  endif()
endfunction()
