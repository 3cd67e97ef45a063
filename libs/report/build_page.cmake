# cmake -DNPM=… -DNODE=… -DSOURCE=page -DWORK=… -DOUT=folder -DTESTS=ON|OFF -P build_page.cmake
#
# Fetches the packages of the lock file into WORK (with TESTS those of the browser tests too) and bundles the pages of
# `hamelin report`, `sweep` and `accuracy`. If that fails, for example without a registry, the build continues without the
# pages and prints a warning; the commands that need a page then name what is missing.
function(give_up what)
  file(REMOVE "${OUT}/page.html" "${OUT}/sweep.html" "${OUT}/accuracy.html")
  message(WARNING "The pages of `hamelin report`, `sweep` and `accuracy` are not built: ${what}. Everything else is; build "
    "again to try again, or configure with -DHAMELIN_BUILD_REPORT=OFF.")
endfunction()

# npm writes this file last, and every change of the lock file makes it older than that.
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
    give_up("npm could not fetch its packages (see above; it needs a registry or a filled cache)")
    return()
  endif()
endif()
file(MAKE_DIRECTORY "${OUT}")
execute_process(COMMAND "${NODE}" "${SOURCE}/build.mjs" --modules "${WORK}/node_modules" --out "${OUT}"
  RESULT_VARIABLE failed)
if(failed)
  give_up("build.mjs failed (see above)")
endif()
