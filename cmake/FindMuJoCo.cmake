# Finds MuJoCo by header and library, as in Debian's libmujoco-dev, whose own CMake package requires
# OpenGL, too. Defines MuJoCo::MuJoCo and MuJoCo_VERSION.
find_path(MuJoCo_INCLUDE_DIR mujoco/mujoco.h)
find_library(MuJoCo_LIBRARY mujoco)
if(MuJoCo_INCLUDE_DIR)
  # 222 is version 2.2.2
  file(STRINGS "${MuJoCo_INCLUDE_DIR}/mujoco/mujoco.h" MuJoCo_VERSION REGEX "^#define mjVERSION_HEADER ")
  string(REGEX REPLACE "[^0-9]*([0-9]+)([0-9])([0-9])$" "\\1.\\2.\\3" MuJoCo_VERSION "${MuJoCo_VERSION}")
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(MuJoCo REQUIRED_VARS MuJoCo_LIBRARY MuJoCo_INCLUDE_DIR
  VERSION_VAR MuJoCo_VERSION HANDLE_VERSION_RANGE)
mark_as_advanced(MuJoCo_INCLUDE_DIR MuJoCo_LIBRARY)
if(MuJoCo_FOUND AND NOT TARGET MuJoCo::MuJoCo)
  add_library(MuJoCo::MuJoCo UNKNOWN IMPORTED)
  set_target_properties(MuJoCo::MuJoCo PROPERTIES IMPORTED_LOCATION "${MuJoCo_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${MuJoCo_INCLUDE_DIR}")
endif()
