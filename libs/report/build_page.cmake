# cmake -DNPM=… -DNODE=… -DSOURCE=page -DWORK=… -DOUT=folder -DTESTS=ON|OFF -P build_page.cmake
#
# Fetches the packages of the lock file into WORK (with TESTS also those of the browser tests) and
# bundles the pages of `hamelin report`, `sweep` and `accuracy`. If that fails, for example without
# a registry, the build continues without the pages and prints a warning; the commands that need a
# page then report the missing file.
function(skip_pages reason)
  file(REMOVE "${OUT}/page.html" "${OUT}/sweep.html" "${OUT}/accuracy.html")
  message(WARNING "The pages of `hamelin report`, `sweep` and `accuracy` are not built: ${reason}. Everything else is "
    "built. Build again to retry, or configure with -DHAMELIN_BUILD_REPORT=OFF.")
endfunction()

# npm writes this file last, so the packages are out of date if the lock file is newer.
set(fetched "${WORK}/node_modules/.package-lock.json")
set(omit --omit=dev)
set(needed "${fetched}")
if(TESTS)
  set(omit "")
  set(needed "${WORK}/node_modules/playwright-core")
endif()
if("${SOURCE}/package-lock.json" IS_NEWER_THAN "${fetched}" OR NOT EXISTS "${needed}")
  file(COPY "${SOURCE}/package.json" "${SOURCE}/package-lock.json" "${SOURCE}/.npmrc" DESTINATION "${WORK}")
  execute_process(COMMAND "${NPM}" ci ${omit} --ignore-scripts --no-audit --no-fund WORKING_DIRECTORY "${WORK}"
    RESULT_VARIABLE failed OUTPUT_QUIET)
  if(failed)
    skip_pages("npm could not fetch the packages (see above; it needs a registry or a filled cache)")
    return()
  endif()
endif()
file(MAKE_DIRECTORY "${OUT}")
execute_process(COMMAND "${NODE}" "${SOURCE}/build.mjs" --modules "${WORK}/node_modules" --out "${OUT}"
  RESULT_VARIABLE failed)
if(failed)
  skip_pages("build.mjs failed (see above)")
endif()
