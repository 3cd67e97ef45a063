# Finds OMPL by its own CMake package, which defines no target. Defines OMPL::OMPL and OMPL_VERSION.
find_package(ompl QUIET CONFIG)
find_path(OMPL_HEADERS ompl/base/Planner.h HINTS ${OMPL_INCLUDE_DIRS})
find_library(OMPL_LIBRARY ompl HINTS ${OMPL_LIBRARY_DIRS})
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OMPL REQUIRED_VARS OMPL_LIBRARY OMPL_HEADERS
  VERSION_VAR OMPL_VERSION HANDLE_VERSION_RANGE)
mark_as_advanced(OMPL_HEADERS OMPL_LIBRARY)
if(OMPL_FOUND AND NOT TARGET OMPL::OMPL)
  add_library(OMPL::OMPL UNKNOWN IMPORTED)
  set_target_properties(OMPL::OMPL PROPERTIES IMPORTED_LOCATION "${OMPL_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${OMPL_HEADERS}")
endif()
