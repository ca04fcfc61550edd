# SPDX-License-Identifier: BSD-3-Clause
# cmake -D BUILD=<build folder> -D WORK=<folder> -D COMPILER=... -D LAUNCHER=... -D PCL=ON|OFF -P run.cmake
#
# Installs a build of Cairn, then builds and runs the consumer project against what was installed. With
# CAIRN_TEST_FULL in the environment, as in scripts/test --full, every header is compiled by itself.
cmake_minimum_required(VERSION 3.25)

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    list(JOIN ARGV " " command)
    message(NOTICE "${output}") # an error message's text would be wrapped
    message(FATAL_ERROR "failed: ${command}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

set(prefix "${WORK}/prefix")
file(REMOVE_RECURSE "${WORK}")
run("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${prefix}")

file(GLOB_RECURSE headers RELATIVE "${prefix}/include" "${prefix}/include/cairn/*.hpp")
set(pcl_headers ${headers})
list(FILTER headers EXCLUDE REGEX "^cairn/adapters/")
list(FILTER pcl_headers INCLUDE REGEX "^cairn/adapters/")
if(NOT "cairn/core/version_number.hpp" IN_LIST headers OR NOT "cairn/map/landmark_map.hpp" IN_LIST headers)
  message(FATAL_ERROR "headers are missing from what was installed: ${headers}")
endif()
if(NOT PCL)
  set(pcl_headers "")
endif()
# The adapter is included as in this tree: adapters/pcl/x.hpp.
list(TRANSFORM pcl_headers REPLACE "^cairn/" "")

file(GLOB_RECURSE config "${prefix}/*/cairn-config.cmake")
file(STRINGS "${config}" components REGEX "^set\\(cairn_components ")
string(REGEX REPLACE "^set\\(cairn_components (.*)\\)$" "\\1" components "${components}")
string(REPLACE "\\;" ";" components "${components}") # file(STRINGS) shields them
if(NOT "pcl" IN_LIST components)
  message(FATAL_ERROR "no components in ${config}: ${components}")
endif()

# A cache file, for lists do not survive a command line. A launcher with arguments is a list, too.
set(cache "")
foreach(entry IN ITEMS CMAKE_CXX_COMPILER_LAUNCHER=LAUNCHER CAIRN_COMPONENTS=components CAIRN_HEADERS=headers
        CAIRN_PCL_HEADERS=pcl_headers)
  string(REGEX MATCH "^(.*)=(.*)$" entry "${entry}")
  string(APPEND cache "set(${CMAKE_MATCH_1} [[${${CMAKE_MATCH_2}}]] CACHE STRING \"\")\n")
endforeach()
file(WRITE "${WORK}/consumer_cache.cmake" "${cache}")
set(each_header OFF)
if(DEFINED ENV{CAIRN_TEST_FULL})
  set(each_header ON)
endif()
run("${CMAKE_COMMAND}" -C "${WORK}/consumer_cache.cmake" -S "${CMAKE_CURRENT_LIST_DIR}/consumer" -B "${WORK}/build" -G Ninja
    "-DCMAKE_PREFIX_PATH=${prefix}" "-DCMAKE_CXX_COMPILER=${COMPILER}" "-DCMAKE_BUILD_TYPE="
    "-DCAIRN_EACH_HEADER=${each_header}")
run("${CMAKE_COMMAND}" --build "${WORK}/build" --parallel 2)
execute_process(COMMAND "${WORK}/build/consumer" WORKING_DIRECTORY "${WORK}" RESULT_VARIABLE result)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "the consumer failed: ${result}")
endif()

# The installed tool runs from where it was installed, through a link, too; --help comes from the whole tool.
if(EXISTS "${prefix}/bin/cairn")
  run("${prefix}/bin/cairn" --version)
  message(STATUS "${output}")
  file(CREATE_LINK "${prefix}/bin/cairn" "${WORK}/cairn" SYMBOLIC)
  run("${WORK}/cairn" --help)
  if(NOT output MATCHES "demo")
    message(FATAL_ERROR "cairn --help does not list the verbs: ${output}")
  endif()
endif()

# Each part, which is a package of its own, comes with the notices of the code of others that it holds.
set(parts tool dev)
if(EXISTS "${BUILD}/python/cairn")
  list(APPEND parts python)
endif()
foreach(part IN LISTS parts)
  run("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${WORK}/${part}" --component ${part})
  set(documents LICENSE THIRD_PARTY)
  if(EXISTS "${BUILD}/viewer/page/THIRD_PARTY_VIEWER.txt")
    list(APPEND documents THIRD_PARTY_VIEWER.txt)
  endif()
  foreach(document IN LISTS documents)
    file(GLOB_RECURSE found "${WORK}/${part}/share/doc/*/${document}")
    if(NOT found)
      message(FATAL_ERROR "${document} was not installed with ${part}")
    endif()
  endforeach()
endforeach()
