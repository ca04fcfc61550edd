# SPDX-License-Identifier: BSD-3-Clause
# cmake -D NODE= -D SOURCE=tests/mcap -D BUILT=<built viewer> -D WORK= -D TOOL=cairn -D ATLAS=0|1 -P run.cmake
cmake_minimum_required(VERSION 3.25)

file(REMOVE_RECURSE "${WORK}")
file(COPY "${SOURCE}/readers.test.mjs" DESTINATION "${WORK}")
file(CREATE_LINK "${BUILT}/node_modules" "${WORK}/node_modules" SYMBOLIC)
set(ENV{CAIRN_TOOL} "${TOOL}")
set(ENV{CAIRN_HAS_ATLAS} "${ATLAS}")
execute_process(COMMAND "${NODE}" --test --test-reporter=spec readers.test.mjs WORKING_DIRECTORY "${WORK}"
                RESULT_VARIABLE result)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "the readers refuse what the tool wrote")
endif()
