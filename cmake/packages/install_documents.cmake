# Installs the documents of HAMELIN_SOURCE into HAMELIN_DOC below the prefix: the site of `./dev docs`
# if it was built, and otherwise the texts from which it is made, in their folders, so that the links
# between them work.
set(to "${CMAKE_INSTALL_PREFIX}/${HAMELIN_DOC}")
set(site "${HAMELIN_SOURCE}/build/docs")
if(EXISTS "${site}/index.html")
  file(INSTALL "${site}/" DESTINATION "${to}/html")
  return()
endif()
file(GLOB_RECURSE texts RELATIVE "${HAMELIN_SOURCE}" "${HAMELIN_SOURCE}/docs/*")
file(GLOB readmes RELATIVE "${HAMELIN_SOURCE}" "${HAMELIN_SOURCE}/*.md" "${HAMELIN_SOURCE}/data/README.md"
  "${HAMELIN_SOURCE}/libs/*/README.md" "${HAMELIN_SOURCE}/plugins/*/README.md" "${HAMELIN_SOURCE}/tests/*/README.md")
foreach(text IN LISTS texts readmes)
  cmake_path(GET text PARENT_PATH folder)
  file(INSTALL "${HAMELIN_SOURCE}/${text}" DESTINATION "${to}/${folder}"
    PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
endforeach()
