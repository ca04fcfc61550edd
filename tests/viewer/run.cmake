# SPDX-License-Identifier: BSD-3-Clause
# cmake -D NODE= -D SOURCE=viewer -D BUILT=<built viewer> -D WORK= -D TOOL=cairn -P run.cmake unit|browser
cmake_minimum_required(VERSION 3.25)

math(EXPR last "${CMAKE_ARGC} - 1")
set(kind "${CMAKE_ARGV${last}}")
set(copy "${WORK}/${kind}")
file(REMOVE_RECURSE "${copy}")
file(COPY "${SOURCE}/test" "${SOURCE}/src" "${SOURCE}/package.json" "${SOURCE}/build.mjs" "${SOURCE}/tsconfig.json"
     DESTINATION "${copy}")
file(CREATE_LINK "${BUILT}/node_modules" "${copy}/node_modules" SYMBOLIC)
set(ENV{CAIRN_TEMPLATE} "${BUILT}/page/report_template.html")

function(run)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY "${copy}" RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "failed: ${ARGN}")
  endif()
endfunction()

if(kind STREQUAL "browser")
  find_program(chromium NAMES chromium)
  if(NOT chromium)
    message(NOTICE "SKIPPED: there is no chromium: no page was opened")
    return()
  endif()
  set(ENV{CAIRN_CHROMIUM} "${chromium}")
  # What a user gets, not only what the samples hold.
  run("${TOOL}" demo --synthetic --quiet --report "${copy}/report.html")
  run("${NODE}" test/run.mjs browser "${copy}/report.html")
else()
  run("${NODE}" test/run.mjs "${kind}")
endif()
