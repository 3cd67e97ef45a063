# Debian packages of a build whose prefix is /usr (presets ci and package), one per install component:
# `cpack --preset package`. docs/decisions/0008-packages.md says what is in which package.
set(HAMELIN_MAINTAINER "The hamelin authors <hamelin@packages.invalid>" CACHE STRING "Maintainer of the Debian packages")

# Sets what CPack wants to know of one package. DEPENDS are other packages, SIBLINGS packages of the
# same version of hamelin.
macro(hamelin_debian_package name)
  cmake_parse_arguments(_package "" "SECTION;SUMMARY;DESCRIPTION" "SIBLINGS;DEPENDS;RECOMMENDS;SUGGESTS;CONTROL" ${ARGN})
  string(TOUPPER "${name}" _key)
  list(APPEND CPACK_COMPONENTS_ALL ${name})
  list(TRANSFORM _package_SIBLINGS APPEND " (= ${PROJECT_VERSION})")
  list(PREPEND _package_DEPENDS ${_package_SIBLINGS})
  foreach(_field IN ITEMS DEPENDS RECOMMENDS SUGGESTS)
    list(JOIN _package_${_field} ", " CPACK_DEBIAN_${_key}_PACKAGE_${_field})
  endforeach()
  set(CPACK_DEBIAN_${_key}_PACKAGE_NAME ${name})
  set(CPACK_DEBIAN_${_key}_PACKAGE_SECTION ${_package_SECTION})
  set(CPACK_DEBIAN_${_key}_DESCRIPTION "${_package_SUMMARY}\n${_package_DESCRIPTION}")
  set(CPACK_DEBIAN_${_key}_PACKAGE_CONTROL_EXTRA ${_package_CONTROL})
  set(CPACK_DEBIAN_${_key}_PACKAGE_CONTROL_STRICT_PERMISSION ON)
  hamelin_install_debian_documents(${name})
endmacro()

# Every package has its copyright, its changelog and, where lintian is wrong, overrides with reasons.
function(hamelin_install_debian_documents name)
  set(folder "${PROJECT_SOURCE_DIR}/cmake/packages")
  install(FILES "${folder}/copyright" "${PROJECT_BINARY_DIR}/packages/changelog.gz"
    DESTINATION "${CMAKE_INSTALL_DOCDIR_BASE}/${name}" COMPONENT ${name} EXCLUDE_FROM_ALL)
  if(EXISTS "${folder}/${name}.lintian-overrides")
    install(FILES "${folder}/${name}.lintian-overrides" DESTINATION share/lintian/overrides RENAME ${name}
      COMPONENT ${name} EXCLUDE_FROM_ALL)
  endif()
endfunction()

# The changelog in Debian's format names CHANGELOG.md, which is complete. Its date is that of the
# commit, or SOURCE_DATE_EPOCH.
function(hamelin_write_debian_changelog)
  if(NOT DEFINED ENV{SOURCE_DATE_EPOCH})
    execute_process(COMMAND git log -1 --format=%ct WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}"
      OUTPUT_VARIABLE seconds OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    if(seconds)
      set(ENV{SOURCE_DATE_EPOCH} ${seconds})
    endif()
  endif()
  string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
  set(file "${PROJECT_BINARY_DIR}/packages/changelog")
  configure_file("${PROJECT_SOURCE_DIR}/cmake/packages/changelog.in" "${file}" @ONLY)
  execute_process(COMMAND gzip -9nc "${file}" OUTPUT_FILE "${file}.gz" COMMAND_ERROR_IS_FATAL ANY)
endfunction()

# Sets `out` to the development packages that a program needs which links the static libraries.
function(hamelin_debian_development_packages out)
  set(debian_Eigen3 libeigen3-dev)
  set(debian_OpenSSL libssl-dev)
  set(debian_ZLIB zlib1g-dev)
  set(debian_fmt libfmt-dev)
  set(debian_nlohmann_json nlohmann-json3-dev)
  set(debian_octomap liboctomap-dev)
  set(debian_spdlog libspdlog-dev)
  set(debian_tinyxml2 libtinyxml2-dev)
  set(debian_zstd libzstd-dev)
  set(names "")
  get_property(libs GLOBAL PROPERTY HAMELIN_LIBS)
  foreach(lib IN LISTS libs)
    get_property(packages GLOBAL PROPERTY HAMELIN_PACKAGES_${lib})
    foreach(package IN LISTS packages)
      if(NOT debian_${package})
        message(FATAL_ERROR "libs/${lib}: the package '${package}' has no Debian name, expected one in ${CMAKE_CURRENT_FUNCTION_LIST_FILE}")
      endif()
      list(APPEND names ${debian_${package}})
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES names)
  list(SORT names)
  set(${out} ${names} PARENT_SCOPE)
endfunction()

# Sets `out` to the packages of the libraries that are loaded when they are needed, which dpkg-shlibdeps cannot know.
function(hamelin_debian_loaded_packages out)
  set(names "")
  get_property(libraries GLOBAL PROPERTY HAMELIN_LOADED_LIBRARIES)
  foreach(library IN LISTS libraries)
    file(REAL_PATH "${library}" file)
    execute_process(COMMAND dpkg -S "${file}" OUTPUT_VARIABLE owner ERROR_QUIET)
    if(NOT owner MATCHES "^([^:]+):")
      message(FATAL_ERROR "${file}: belongs to no package, expected one that hamelin can depend on")
    endif()
    list(APPEND names ${CMAKE_MATCH_1})
  endforeach()
  list(REMOVE_DUPLICATES names)
  set(${out} ${names} PARENT_SCOPE)
endfunction()

function(hamelin_debian_packages)
  set(folder "${PROJECT_SOURCE_DIR}/cmake/packages")
  cmake_path(GET CMAKE_INSTALL_DOCDIR PARENT_PATH CMAKE_INSTALL_DOCDIR_BASE)
  hamelin_write_debian_changelog()

  hamelin_debian_package(libhamelin0 SECTION libs
    RECOMMENDS hamelin-plugins CONTROL "${folder}/shlibs" "${folder}/symbols" "${folder}/triggers"
    SUMMARY "control loop for robot arms among obstacles, C library"
    DESCRIPTION "hamelin moves robot arms through cluttered 3D maps without touching anything.

This library is its control loop for programs in C and other languages. Each
tick takes joint positions and velocities, calls a planner and returns
torques or the next position, and whether the motion was proved clear.")
  hamelin_debian_development_packages(development)
  hamelin_debian_package(libhamelin-dev SECTION libdevel SIBLINGS libhamelin0 DEPENDS ${development}
    SUGGESTS hamelin-doc hamelin pkg-config cmake
    SUMMARY "control loop for robot arms among obstacles, development files"
    DESCRIPTION "hamelin moves robot arms through cluttered 3D maps without touching anything.

This package has what programs in C need to link the control loop, and the
static C++ libraries with their headers and CMake package: robots, rigid-body
dynamics, variational integrators, OctoMap scenes with exact distances, the
interface of planner plugins, optimal motions, simulation and logs. Planners
are built against it; a template and examples are included.")
  hamelin_debian_package(hamelin-plugins SECTION science SUGGESTS hamelin
    SUMMARY "planners for robot arms among obstacles"
    DESCRIPTION "hamelin moves robot arms through cluttered 3D maps without touching anything.

This package has its planners as plugins: hybrid, which is the one to use,
mppi, which samples motions, the potential field apf, gyro, and a template.")
  hamelin_debian_loaded_packages(loaded)
  hamelin_debian_package(hamelin SECTION science SIBLINGS hamelin-plugins DEPENDS ${loaded} SUGGESTS python3-hamelin hamelin-doc
    SUMMARY "motions of robot arms in 3D maps, simulated and proved clear"
    DESCRIPTION "hamelin moves robot arms through cluttered 3D maps without touching anything,
and simulates them with integrators whose errors are measured.

It reads URDF robots and OctoMap maps, runs a reactive planner in closed loop
at 1 kHz, proves for each step that the motion stayed clear, and writes logs,
HTML reports and a replay that is equal to the bit. It also computes optimal
motions, and sweeps over many scenes in parallel.")
  if(TARGET hamelin_python)
    get_property(python GLOBAL PROPERTY HAMELIN_PYTHON_LIBRARY)
    string(REGEX MATCH "3[.]([0-9]+)" python "${python}")
    math(EXPR next "${CMAKE_MATCH_1} + 1")
    hamelin_debian_package(python3-hamelin SECTION python SIBLINGS hamelin hamelin-plugins
      DEPENDS "python3 (>= ${python})" "python3 (<< 3.${next})" "python3-numpy (>= 1:1.21)" libpython${python} ${loaded}
      RECOMMENDS python3-pandas python3-matplotlib SUGGESTS hamelin-doc
      CONTROL "${folder}/postinst" "${folder}/prerm"
      SUMMARY "motions of robot arms in 3D maps, for Python"
      DESCRIPTION "hamelin moves robot arms through cluttered 3D maps without touching anything,
and simulates them with integrators whose errors are measured.

This package is its interface for Python with numpy: robots and dynamics of
single and many states, integrators, distances, runs, sweeps, optimal
motions, the control loop and logs, and planners written in Python.")
  endif()
  hamelin_debian_package(hamelin-doc SECTION doc
    SUMMARY "motions of robot arms in 3D maps, documentation"
    DESCRIPTION "hamelin moves robot arms through cluttered 3D maps without touching anything,
and simulates them with integrators whose errors are measured.

This package has its guides, the theory with every equation that the code
cites, formats of files, a gallery of programs in Python, and figures.")
  hamelin_install_debian_extras()

  set(CPACK_GENERATOR DEB)
  set(CPACK_DEB_COMPONENT_INSTALL ON)
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${HAMELIN_MAINTAINER}")
  set(CPACK_DEBIAN_PACKAGE_SOURCE ${PROJECT_NAME})
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_HAMELIN-DOC_PACKAGE_ARCHITECTURE all)
  set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own
  set(CPACK_PACKAGE_DIRECTORY "${PROJECT_BINARY_DIR}/packages")
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_STRIP_FILES ON)
  set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
  set(CPACK_VERBATIM_VARIABLES ON)
  include(CPack)
endfunction()

# What only packages contain: examples and documents.
function(hamelin_install_debian_extras)
  set(examples "${CMAKE_INSTALL_DOCDIR_BASE}/libhamelin-dev/examples")
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/plugins/template" "${PROJECT_SOURCE_DIR}/tests/package/robot_loop"
    "${PROJECT_SOURCE_DIR}/libs/serve/clients"
    DESTINATION "${examples}" COMPONENT libhamelin-dev EXCLUDE_FROM_ALL PATTERN tests EXCLUDE)
  install(CODE "set(HAMELIN_SOURCE \"${PROJECT_SOURCE_DIR}\")\nset(HAMELIN_DOC \"${CMAKE_INSTALL_DOCDIR_BASE}/hamelin-doc\")"
    COMPONENT hamelin-doc EXCLUDE_FROM_ALL)
  install(SCRIPT "${PROJECT_SOURCE_DIR}/cmake/packages/install_documents.cmake" COMPONENT hamelin-doc EXCLUDE_FROM_ALL)
endfunction()
