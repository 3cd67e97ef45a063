# Settings and functions for all targets of the workspace: compiler options, libraries, tests,
# benchmarks and the installed package.
include(CMakePackageConfigHelpers)

set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)  # libraries are linked into plugins
set(CMAKE_CXX_VISIBILITY_PRESET hidden)
set(CMAKE_VISIBILITY_INLINES_HIDDEN ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/bin")
set(HAMELIN_PLUGIN_DIR "${CMAKE_INSTALL_LIBDIR}/hamelin/plugins")
set(HAMELIN_BUILD_PLUGIN_DIR "${PROJECT_BINARY_DIR}/lib/hamelin/plugins")

# A unity build compiles several sources of a target as one. Most of the time is spent on headers,
# which are then parsed once. The dev preset compiles each source alone, so that a change recompiles
# little and a missing include is found.
option(HAMELIN_UNITY "Compile several sources of a target as one, in a third of the time" ON)
set(CMAKE_UNITY_BUILD ${HAMELIN_UNITY})
set(CMAKE_UNITY_BUILD_BATCH_SIZE 30)

# Linked as $<BUILD_INTERFACE:...> only, so that users of the package do not inherit its flags.
add_library(hamelin_options INTERFACE)
target_compile_features(hamelin_options INTERFACE cxx_std_20)
if(HAMELIN_WARNINGS)
  target_compile_options(hamelin_options INTERFACE
    -Wall -Wextra -Wpedantic -Wconversion -Wnon-virtual-dtor -Woverloaded-virtual -Wold-style-cast
    # In a unity build a local name may shadow a global name of another file.
    $<$<NOT:$<BOOL:${HAMELIN_UNITY}>>:-Wshadow>)
else()
  target_compile_options(hamelin_options INTERFACE -w)
endif()
target_compile_options(hamelin_options INTERFACE
  # GCC frees memory less often: this saves a tenth of the time and takes a quarter more memory.
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1048576>
  # Debug builds keep all checks. Without light optimisation Eigen would be too slow to use.
  $<$<CONFIG:Debug>:-Og>
  # GCC 12 warns wrongly of overlapping copies where strings are concatenated.
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<NOT:$<CONFIG:Release>>>:-Wno-restrict>
  # Results are the same with and without FMA hardware; kernels enable contraction one by one.
  -ffp-contract=off
  $<$<BOOL:${HAMELIN_WERROR}>:-Werror>
  # Threads share the counters of lines; without atomic updates some become negative, which gcovr refuses.
  $<$<BOOL:${HAMELIN_COVERAGE}>:--coverage> $<$<BOOL:${HAMELIN_COVERAGE}>:-fprofile-update=atomic>)
# A replay recognises the same build by the build-id of the program.
target_link_options(hamelin_options INTERFACE LINKER:--build-id=sha1 $<$<BOOL:${HAMELIN_COVERAGE}>:--coverage>)
if(HAMELIN_SANITIZE)
  list(JOIN HAMELIN_SANITIZE "," _sanitizers)
  target_compile_options(hamelin_options INTERFACE
    -fsanitize=${_sanitizers} -fno-omit-frame-pointer -fno-sanitize-recover=all
    # GCC warns wrongly of uninitialised values in code that a sanitizer adds.
    $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  target_link_options(hamelin_options INTERFACE -fsanitize=${_sanitizers})
  target_compile_definitions(hamelin_options INTERFACE HAMELIN_SANITIZED)
endif()

# Compiler options of code that is not performance-critical. With -Og GCC would take a fifth less time, but runs with
# logs would take an eighth more: the linker keeps one copy of each inline function, also for sources with -O3.
set(HAMELIN_COLD_OPTIONS $<$<CONFIG:Release>:-O1>)

option(HAMELIN_FURTHER_SOURCES "Compile also the sources that the commands of the demo do not need" ON)

# hamelin_library(NAME model [DEPS geometry ...] [SOURCES src/a.cpp ...] [FURTHER src/b.cpp ...] [LINKS Eigen3::Eigen]
#                 [PRIVATE_LINKS ...] [PACKAGES Eigen3 ...] [TEST_LINKS hamelin::io ...] [COLD] [INTERNAL])
#
# Defines hamelin::NAME in the calling folder: headers in include/hamelin/NAME, tests/*_test.cpp as
# one test program, bench/*_bench.cpp as one benchmark program. A DEP must precede NAME in
# libs/CMakeLists.txt, so the order there is the dependency order and cycles are impossible.
# FURTHER are sources that the commands of the demo do not need; a build without
# HAMELIN_FURTHER_SOURCES leaves them out.
# PACKAGES are the packages that find_package(hamelin COMPONENTS NAME) must find for the libraries
# in LINKS and PRIVATE_LINKS. TEST_LINKS are libraries that only the tests need; they may come later
# than NAME. COLD marks a library that is not performance-critical and is compiled with less
# optimisation. INTERNAL marks one that is not installed: programs of the workspace link it.
function(hamelin_library)
  cmake_parse_arguments(PARSE_ARGV 0 arg "COLD;INTERNAL" "NAME"
    "DEPS;SOURCES;FURTHER;LINKS;PRIVATE_LINKS;PACKAGES;TEST_LINKS;TEST_LABELS")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "hamelin_library(${arg_NAME}): unknown argument ${arg_UNPARSED_ARGUMENTS}")
  endif()
  set(target hamelin_${arg_NAME})
  if(arg_SOURCES)
    set(scope PUBLIC)
    if(HAMELIN_FURTHER_SOURCES)
      list(APPEND arg_SOURCES ${arg_FURTHER})
    endif()
    add_library(${target} STATIC ${arg_SOURCES})
    target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:hamelin_options> ${arg_PRIVATE_LINKS})
    if(arg_COLD)
      target_compile_options(${target} PRIVATE ${HAMELIN_COLD_OPTIONS})
    endif()
  else()
    set(scope INTERFACE)
    add_library(${target} INTERFACE)
  endif()
  target_compile_features(${target} ${scope} cxx_std_20)
  add_library(hamelin::${arg_NAME} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${arg_NAME})
  foreach(dep IN LISTS arg_DEPS)
    if(NOT TARGET hamelin::${dep})
      message(FATAL_ERROR
        "libs/${arg_NAME} depends on '${dep}', expected it to precede ${arg_NAME} in libs/CMakeLists.txt")
    endif()
    target_link_libraries(${target} ${scope} hamelin::${dep})
  endforeach()
  target_link_libraries(${target} ${scope} ${arg_LINKS})
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS include/*.hpp include/*.h)
  target_sources(${target} ${scope} FILE_SET HEADERS BASE_DIRS include FILES ${headers})
  set_target_properties(${target} PROPERTIES VERIFY_INTERFACE_HEADER_SETS ON)
  if(NOT arg_INTERNAL)
    set_property(GLOBAL APPEND PROPERTY HAMELIN_LIBS ${arg_NAME})
    set_property(GLOBAL PROPERTY HAMELIN_DEPS_${arg_NAME} ${arg_DEPS})
    set_property(GLOBAL PROPERTY HAMELIN_PACKAGES_${arg_NAME} ${arg_PACKAGES})
    install(TARGETS ${target} EXPORT hamelin_${arg_NAME} FILE_SET HEADERS)
  endif()
  hamelin_tests(NAME ${arg_NAME} LINKS hamelin::${arg_NAME} ${arg_TEST_LINKS} LABELS ${arg_TEST_LABELS})
  hamelin_benchmarks(NAME ${arg_NAME} LINKS hamelin::${arg_NAME})
endfunction()

# hamelin_load_when_needed(TARGET NAME LIBRARY HEADERS ...): the sources of TARGET see the HEADERS of a shared library that
# they load themselves, by core's SharedLibrary, from the file name in the definition HAMELIN_<NAME>_FILE. A program that
# never needs the library then starts without it.
function(hamelin_load_when_needed target name library)
  cmake_parse_arguments(PARSE_ARGV 3 arg "" "" "HEADERS")
  execute_process(COMMAND "${CMAKE_READELF}" -d "${library}" OUTPUT_VARIABLE dynamic ERROR_QUIET)
  if(NOT dynamic MATCHES "SONAME[^[]*[[]([^]]+)[]]")
    message(FATAL_ERROR "${library}: has no SONAME, expected a shared library")
  endif()
  target_compile_definitions(${target} PRIVATE HAMELIN_${name}_FILE="${CMAKE_MATCH_1}")
  target_include_directories(${target} SYSTEM PRIVATE ${arg_HEADERS})
  set_property(GLOBAL APPEND PROPERTY HAMELIN_LOADED_LIBRARIES "${library}")
endfunction()

# Additional compiler options of kernels; a source's own options come last. Kernels are optimised in
# every build, so that all calls are inlined, but less with sanitizers, whose checks multiply the
# code. With its defaults, GCC would copy value types with many lanes through memory, and vectorise
# scalar code at a loss.
set(HAMELIN_KERNEL_OPTIONS $<IF:$<BOOL:${HAMELIN_SANITIZE}>,-O1,-O3>
  -ffp-contract=fast -fno-math-errno -fno-trapping-math -fno-tree-slp-vectorize
  $<$<CXX_COMPILER_ID:GNU>:--param=sra-max-scalarization-size-Ospeed=4096>)

# The best instruction set of this machine that kernels are compiled for; see core/isa.hpp.
function(hamelin_best_instruction_set result)
  set(flags "")
  if(EXISTS /proc/cpuinfo)
    file(STRINGS /proc/cpuinfo flags REGEX "^flags" LIMIT_COUNT 1)
  endif()
  string(REGEX MATCHALL "[a-z0-9_]+" flags "${flags}")
  set(best baseline)
  if("avx2" IN_LIST flags AND "fma" IN_LIST flags)
    set(best v3)
    if("avx512f" IN_LIST flags AND "avx512vl" IN_LIST flags AND "avx512dq" IN_LIST flags)
      set(best v4)
    endif()
  endif()
  set(${result} ${best} PARENT_SCOPE)
endfunction()

# A build for one machine may leave the other instruction sets out.
set(HAMELIN_INSTRUCTION_SETS "baseline;v3;v4" CACHE STRING
  "Instruction sets that kernels are compiled for; `best` is the best one of this machine")
set(HAMELIN_BUILT_ISA ${HAMELIN_INSTRUCTION_SETS})
if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  set(HAMELIN_BUILT_ISA baseline)
endif()
hamelin_best_instruction_set(_best)
list(TRANSFORM HAMELIN_BUILT_ISA REPLACE "^best$" ${_best})
list(REMOVE_DUPLICATES HAMELIN_BUILT_ISA)
foreach(name IN LISTS HAMELIN_BUILT_ISA)
  if(NOT name MATCHES "^(baseline|v3|v4)$")
    message(FATAL_ERROR "HAMELIN_INSTRUCTION_SETS: '${name}' is not known, expected a list of baseline, v3, v4 and best")
  endif()
endforeach()
set(HAMELIN_WITHOUT_ISA "")  # definitions of core
foreach(name IN ITEMS baseline v3 v4)
  if(NOT name IN_LIST HAMELIN_BUILT_ISA)
    string(TOUPPER "HAMELIN_WITHOUT_${name}" definition)
    list(APPEND HAMELIN_WITHOUT_ISA ${definition})
  endif()
endforeach()

# hamelin_isa_sources(TARGET SOURCE... [FURTHER SOURCE...] [LINKS ...]): compiles each source once
# for every instruction set of core/isa.hpp. docs/decisions/0006-instruction-sets.md says what such a
# source may use, and a test checks the objects. Products may be contracted to FMA, because results
# are bit-identical on one instruction set only.
function(hamelin_isa_sources target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "FURTHER;LINKS")
  set(sources ${arg_UNPARSED_ARGUMENTS})
  if(HAMELIN_FURTHER_SOURCES)
    list(APPEND sources ${arg_FURTHER})
  endif()
  set(flags_baseline "")
  set(flags_v3 -mavx2 -mfma)
  set(flags_v4 -mavx2 -mfma -mavx512f -mavx512vl -mavx512dq)
  set_source_files_properties(${sources} PROPERTIES COMPILE_OPTIONS "${HAMELIN_KERNEL_OPTIONS}")
  foreach(name IN LISTS HAMELIN_BUILT_ISA)
    add_library(${target}_${name} OBJECT ${sources})
    target_link_libraries(${target}_${name} PRIVATE $<BUILD_INTERFACE:hamelin_options>
      $<FILTER:$<TARGET_PROPERTY:${target},INTERFACE_LINK_LIBRARIES>,EXCLUDE,LINK_ONLY> ${arg_LINKS})
    target_include_directories(${target}_${name} PRIVATE include)
    target_compile_definitions(${target}_${name} PRIVATE HAMELIN_ISA_NAMESPACE=isa_${name})
    target_compile_options(${target}_${name} PRIVATE ${flags_${name}})
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${target}_${name}>)
    set_property(GLOBAL APPEND PROPERTY HAMELIN_ISA_OBJECTS $<TARGET_OBJECTS:${target}_${name}>)
  endforeach()
endfunction()

# hamelin_tests(NAME scene LINKS hamelin::scene [LABELS slow]): builds tests/*_test.cpp of the
# calling folder as one program. The tests have the CTest labels NAME and LABELS; `./dev tsan` runs
# the label `threads` under the thread sanitizer. HAMELIN_SOURCE_DIR tells tests where the checkout
# is. Tests that cannot run here are skipped; tests/may_skip.txt lists those that may be.
function(hamelin_tests)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "NAME" "LINKS;LABELS")
  file(GLOB tests CONFIGURE_DEPENDS tests/*_test.cpp)
  if(NOT HAMELIN_BUILD_TESTS OR NOT tests)
    return()
  endif()
  set(target hamelin_${arg_NAME}_tests)
  add_executable(${target} ${tests})
  # Compiling tests takes longer than running them, and least with -Og. There GCC warns wrongly of
  # uninitialised values in std::optional.
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:$<IF:$<CXX_COMPILER_ID:GNU>,-Og,-O1>>
    $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  if(NOT TARGET hamelin_test_support)
    add_library(hamelin_test_support OBJECT "${PROJECT_SOURCE_DIR}/tests/support/skip.cpp")
    target_include_directories(hamelin_test_support PUBLIC "${PROJECT_SOURCE_DIR}/tests/support/include")
    target_link_libraries(hamelin_test_support PRIVATE hamelin_options Catch2::Catch2)
  endif()
  target_link_libraries(${target} PRIVATE ${arg_LINKS} hamelin::io hamelin_allocation_count
    hamelin_test_support hamelin_options Catch2::Catch2WithMain)
  target_compile_definitions(${target} PRIVATE
    HAMELIN_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    HAMELIN_TEST_BINARY_DIR="${PROJECT_BINARY_DIR}"
    HAMELIN_TEST_PLUGIN_DIR="${HAMELIN_BUILD_PLUGIN_DIR}")
  # The separators are escaped for each list that the labels pass through before CTest reads them.
  list(PREPEND arg_LABELS ${arg_NAME})
  list(JOIN arg_LABELS "\\\\\\\\;" labels)
  # Catch2 2 cannot skip tests; test::skip (tests/support) prints this line.
  catch_discover_tests(${target} TEST_PREFIX "${arg_NAME}: " PROPERTIES LABELS "${labels}"
    SKIP_REGULAR_EXPRESSION "test skipped: ")
  if("threads" IN_LIST arg_LABELS)
    set_property(GLOBAL APPEND PROPERTY HAMELIN_THREADS_TESTS ${target})
  endif()
endfunction()

# The Catch2 main function of Debian is compiled without benchmarking, so benchmarks have their own.
function(hamelin_benchmarks)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "NAME" "LINKS")
  file(GLOB benches CONFIGURE_DEPENDS bench/*_bench.cpp)
  if(NOT HAMELIN_BUILD_BENCH OR NOT benches)
    return()
  endif()
  find_package(Catch2 REQUIRED)
  set(target hamelin_${arg_NAME}_bench)
  add_executable(${target} ${benches} "${PROJECT_SOURCE_DIR}/cmake/bench_main.cpp")
  # It defines main by including Catch2 with a macro that the other sources must not see.
  set_source_files_properties("${PROJECT_SOURCE_DIR}/cmake/bench_main.cpp" PROPERTIES
    SKIP_UNITY_BUILD_INCLUSION ON)
  target_link_libraries(${target} PRIVATE ${arg_LINKS} fmt::fmt hamelin_options Catch2::Catch2)
  target_compile_definitions(${target} PRIVATE CATCH_CONFIG_ENABLE_BENCHMARKING
    HAMELIN_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  set_property(GLOBAL APPEND PROPERTY HAMELIN_BENCHES ${target})
endfunction()

# hamelin_embed(TARGET hamelin_io FUNCTION name NAMESPACE namespace FILES ...): adds a function to
# TARGET that returns the text of a file by its name.
function(hamelin_embed)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "TARGET;FUNCTION;NAMESPACE" "FILES")
  set(source "${CMAKE_CURRENT_BINARY_DIR}/${arg_FUNCTION}.cpp")
  set(text "// Made at configure time from ${arg_FUNCTION}'s files; do not edit.\n#include <string_view>\n\n")
  string(APPEND text "namespace ${arg_NAMESPACE} {\n"
    "std::string_view ${arg_FUNCTION}(std::string_view name) noexcept;\n")
  string(APPEND text "std::string_view ${arg_FUNCTION}(std::string_view name) noexcept {\n")
  foreach(file IN LISTS arg_FILES)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${file}")
    file(READ "${file}" content)
    cmake_path(GET file FILENAME name)
    string(APPEND text "  if (name == \"${name}\") return R\"hamelin(${content})hamelin\";\n")
  endforeach()
  string(APPEND text "  return {};\n}\n}  // namespace ${arg_NAMESPACE}\n")
  file(CONFIGURE OUTPUT "${source}" CONTENT "${text}" @ONLY)
  target_sources(${arg_TARGET} PRIVATE "${source}")
endfunction()

# There is one export per library, so that find_package(hamelin COMPONENTS dynamics) loads only the
# dependencies of dynamics.
function(hamelin_install_package)
  get_property(HAMELIN_LIBS GLOBAL PROPERTY HAMELIN_LIBS)
  set(HAMELIN_COMPONENTS "")
  foreach(lib IN LISTS HAMELIN_LIBS)
    get_property(deps GLOBAL PROPERTY HAMELIN_DEPS_${lib})
    get_property(packages GLOBAL PROPERTY HAMELIN_PACKAGES_${lib})
    string(APPEND HAMELIN_COMPONENTS "set(_hamelin_deps_${lib} ${deps})\nset(_hamelin_packages_${lib} ${packages})\n")
  endforeach()
  set(dest "${CMAKE_INSTALL_LIBDIR}/cmake/hamelin")
  foreach(lib IN LISTS HAMELIN_LIBS)
    install(EXPORT hamelin_${lib} FILE hamelin_${lib}.cmake NAMESPACE hamelin:: DESTINATION ${dest}
      COMPONENT libhamelin-dev)
  endforeach()
  configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/hamelinConfig.cmake.in" hamelinConfig.cmake
    INSTALL_DESTINATION ${dest} PATH_VARS HAMELIN_PLUGIN_DIR)
  write_basic_package_version_file(hamelinConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/hamelinConfig.cmake"
    "${CMAKE_CURRENT_BINARY_DIR}/hamelinConfigVersion.cmake"
    "${PROJECT_SOURCE_DIR}/cmake/HamelinPlugin.cmake"
    DESTINATION ${dest} COMPONENT libhamelin-dev)
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/data/" "${PROJECT_SOURCE_DIR}/docs/schema"
    DESTINATION "${CMAKE_INSTALL_DATADIR}/hamelin" COMPONENT hamelin)
endfunction()

include(HamelinPlugin)
