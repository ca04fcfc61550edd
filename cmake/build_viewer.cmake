# SPDX-License-Identifier: BSD-3-Clause
# cmake -D STEP=packages|page -D NODE=... -D NPM=... -D SOURCE=viewer -D WORK=<folder> [-D PAGE=<file>] -P ...
#
# Builds the viewer in a folder of its own, so that the source tree stays as it is.
cmake_minimum_required(VERSION 3.25)

set(without "Configure with -DCAIRN_WITH_VIEWER=OFF to build all but the writing of reports.")
file(MAKE_DIRECTORY "${WORK}")

if(STEP STREQUAL "packages")
  file(COPY "${SOURCE}/package.json" "${SOURCE}/package-lock.json" "${SOURCE}/.npmrc" DESTINATION "${WORK}")
  # A registry may be out of reach for a moment.
  foreach(pause IN ITEMS 5 20 0)
    execute_process(COMMAND "${NPM}" ci WORKING_DIRECTORY "${WORK}" RESULT_VARIABLE result
                    OUTPUT_VARIABLE output ERROR_VARIABLE output)
    if(result EQUAL 0)
      break()
    elseif(pause GREATER 0)
      message(NOTICE "npm ci failed; trying again in ${pause} s")
      execute_process(COMMAND "${CMAKE_COMMAND}" -E sleep ${pause})
    endif()
  endforeach()
  if(NOT result EQUAL 0)
    message(NOTICE "${output}")
    message(FATAL_ERROR "npm could not fetch the viewer's packages: is its registry within reach? ${without}")
  endif()
  file(TOUCH "${WORK}/packages.stamp")
else()
  file(REMOVE_RECURSE "${WORK}/src")
  file(COPY "${SOURCE}/src" "${SOURCE}/build.mjs" "${SOURCE}/tsconfig.json" DESTINATION "${WORK}")
  execute_process(COMMAND "${NODE}" build.mjs --outfile "${PAGE}" WORKING_DIRECTORY "${WORK}"
                  RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    message(NOTICE "${output}")
    message(FATAL_ERROR "the viewer does not build. ${without}")
  endif()
endif()
