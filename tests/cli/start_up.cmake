# SPDX-License-Identifier: BSD-3-Clause
# cmake -D TOOL=cairn -D QUICK=cairn-quick -D WORK=<folder> -P start_up.cmake
#
# The tool that users start loads no library but C's, its quick verbs no large one, and it says so if a part of it is
# missing.
cmake_minimum_required(VERSION 3.25)

execute_process(COMMAND ldd "${QUICK}" OUTPUT_VARIABLE libraries RESULT_VARIABLE result)
if(NOT result EQUAL 0 OR NOT libraries MATCHES "libstdc")
  message(FATAL_ERROR "ldd ${QUICK} failed: ${result} ${libraries}")
endif()
message(STATUS "${libraries}")
# Ceres may be a static library; those that it needs are not.
if(libraries MATCHES "(opencv|embree|ceres|glog|cholmod|spqr|lapack)")
  message(FATAL_ERROR "${QUICK} loads lib${CMAKE_MATCH_1}")
endif()
execute_process(COMMAND ldd "${TOOL}" OUTPUT_VARIABLE libraries)
if(libraries MATCHES "libstdc")
  message(FATAL_ERROR "${TOOL} loads the C++ library: ${libraries}")
endif()

file(REMOVE_RECURSE "${WORK}")
file(COPY "${TOOL}" DESTINATION "${WORK}/bin" FOLLOW_SYMLINK_CHAIN)
execute_process(COMMAND "${WORK}/bin/cairn" --version OUTPUT_VARIABLE version RESULT_VARIABLE result)
if(NOT result EQUAL 0 OR NOT version MATCHES "^cairn [0-9.]+\n$")
  message(FATAL_ERROR "cairn --version: exit code ${result}, ${version}")
endif()
execute_process(COMMAND "${WORK}/bin/cairn" demo --help RESULT_VARIABLE result ERROR_VARIABLE message OUTPUT_QUIET)
if(NOT result EQUAL 1 OR NOT message MATCHES "^cairn: [^\n]*: cannot be started: No such file[^\n]*\n$")
  message(FATAL_ERROR "without its other part cairn demo ends with ${result}: ${message}")
endif()
