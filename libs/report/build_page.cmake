# cmake -DNPM=… -DNODE=… -DSOURCE=page -DWORK=… -DOUT=folder -P build_page.cmake
#
# Fetches what the lock file names and bundles the pages of `hamelin report`, `sweep` and `accuracy`. Where that fails (no
# registry, say) the build goes on without them, saying so; the commands then say what is missing.
function(give_up what)
  file(REMOVE "${OUT}/page.html" "${OUT}/sweep.html" "${OUT}/accuracy.html")
  message(WARNING "The pages of `hamelin report`, `sweep` and `accuracy` are not built: ${what}. Everything else is; build "
    "again to try again, or configure with -DHAMELIN_BUILD_REPORT=OFF.")
endfunction()

# npm writes this file last, so it stands for all packages.
set(fetched "${WORK}/node_modules/.package-lock.json")
if("${SOURCE}/package-lock.json" IS_NEWER_THAN "${fetched}")  # also if there is none
  file(COPY "${SOURCE}/package.json" "${SOURCE}/package-lock.json" "${SOURCE}/.npmrc" DESTINATION "${WORK}")
  execute_process(COMMAND "${NPM}" ci --omit=dev --ignore-scripts --no-audit --no-fund WORKING_DIRECTORY "${WORK}"
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
