# SPDX-License-Identifier: BSD-3-Clause
# cmake -D ROOT=<source tree> -P layers.cmake
#
# Checks every #include of the tree against the layers of docs/architecture.md, and that library
# code neither prints nor exits. Fails with file:line of each breach.
cmake_minimum_required(VERSION 3.25)

# --- The rule ---------------------------------------------------------------------------------

# A module includes itself and modules of lower layers; one layer's modules never see each other.
set(LAYER_core 0)
set(LAYER_geometry 1)
set(LAYER_storage 1)
set(LAYER_map 2)
set(LAYER_pose_graph 2)
set(LAYER_adjustment 3)
set(LAYER_confidence 3)
set(LAYER_formats 3)
set(LAYER_recording 3)
set(LAYER_registration 4)
set(LAYER_evaluation 3)
set(LAYER_simulation 3)
set(LAYER_alignment 5)
set(LAYER_merging 6)
set(LAYER_vision 7)
set(LAYER_atlas 7)
set(LAYER_experiments 8)
set(LAYER_report 9)

# Highest layer that the folders beside the library may include. Tests in tests/ may include all.
set(HIGHEST_src 5) # cairn/cairn.hpp, the one header beside the modules
set(HIGHEST_apps 9)
set(HIGHEST_python 9)
set(HIGHEST_benchmarks 9)
set(HIGHEST_examples 9)
set(HIGHEST_adapters 4)

# Modules whose subfolders may not include each other's headers, only those of the module itself.
set(BLIND_SUBFOLDERS registration)

# Modules whose detail/ is for all of the library: small tools and costs, which are not installed.
set(SHARED_DETAIL core geometry adjustment)

# Libraries that only the modules named may include: "start of the header's name" "modules".
set(HEAVY
  "opencv2/" "vision"
  "ceres/" "adjustment vision"
  "embree" "simulation"
  "jpeglib.h" "vision"
  "png.h" "vision"
  "libexif/exif-data.h" "vision"
  "libexif/exif-utils.h" "vision"
  "pqxx/" "storage"
  "bzlib.h" "recording"
  "lz4" "recording"
  "sqlite3" "storage"
  "yaml-cpp/" "experiments"
  "zlib.h" "formats recording report"
  "zstd.h" "recording"
  "pcl/" ""
  "Python.h" ""
  "pybind11/" "")

# What library code never calls, for the caller decides what is printed and when to end.
set(OUTPUT_CALLS "printf|fprintf|vprintf|vfprintf|puts|fputs|putchar|perror")
set(EXIT_CALLS "exit|_exit|_Exit|quick_exit|abort|terminate")

# --- The check --------------------------------------------------------------------------------

if(NOT IS_DIRECTORY "${ROOT}/src/cairn")
  message(FATAL_ERROR "ROOT must name Cairn's source tree, not '${ROOT}'")
endif()

function(breach file line text)
  message(NOTICE "${file}:${line}: ${text}")
  set_property(GLOBAL APPEND PROPERTY BREACHES "${file}:${line}")
endfunction()

# Sets `out` to the lines of a file that match `regex`, each as "number:line", with what CMake's
# lists cannot hold replaced: ; by a comma, [ and ] by parentheses, \ by a slash.
function(matching_lines file regex out)
  set(found "")
  file(READ "${file}" content)
  if(content MATCHES "${regex}")
    string(REPLACE ";" "," content "${content}")
    string(REPLACE "[" "(" content "${content}")
    string(REPLACE "]" ")" content "${content}")
    string(REPLACE "\\" "/" content "${content}")
    string(REPLACE "\n" ";" content "${content}")
    set(number 0)
    foreach(line IN LISTS content)
      math(EXPR number "${number} + 1")
      if(line MATCHES "${regex}")
        list(APPEND found "${number}:${line}")
      endif()
    endforeach()
  endif()
  set(${out} "${found}" PARENT_SCOPE)
endfunction()

# Checks that `file` (relative to ROOT) may include header `included` ("cairn/...").
function(check_own_header file line included)
  if(included STREQUAL "cairn/cairn.hpp" AND NOT file MATCHES "^src/")
    return()
  endif()
  if(NOT included MATCHES "^cairn/([^/]+)/(.+)$")
    breach("${file}" ${line} "includes ${included}, which is in no module")
    return()
  endif()
  set(to "${CMAKE_MATCH_1}")
  set(to_path "${CMAKE_MATCH_2}")
  if(NOT DEFINED LAYER_${to})
    breach("${file}" ${line} "includes ${included}: module ${to} is not in the layer table")
    return()
  endif()
  if(to_path MATCHES "(^|/)detail/" AND NOT to IN_LIST SHARED_DETAIL AND NOT file MATCHES "^(src/cairn/${to}|benchmarks)/")
    breach("${file}" ${line} "includes ${included}: what is in detail/ belongs to its module")
  endif()

  if(file MATCHES "^src/cairn/([^/]+)/(.+)$")
    set(from "${CMAKE_MATCH_1}")
    set(from_path "${CMAKE_MATCH_2}")
    if(from STREQUAL to)
      if(from IN_LIST BLIND_SUBFOLDERS AND from_path MATCHES "^([^/]+)/")
        set(from_folder "${CMAKE_MATCH_1}")
        if(to_path MATCHES "^([^/]+)/" AND NOT CMAKE_MATCH_1 STREQUAL from_folder
           AND NOT CMAKE_MATCH_1 STREQUAL "detail" AND NOT from_folder STREQUAL "detail")
          breach("${file}" ${line} "includes ${included}: ${from}'s subfolders are blind to each other")
        endif()
      endif()
    elseif(DEFINED LAYER_${from} AND NOT LAYER_${to} LESS LAYER_${from})
      breach("${file}" ${line}
             "includes ${included}: ${from} (layer ${LAYER_${from}}) may not see ${to} (layer ${LAYER_${to}})")
    endif()
  else()
    string(REGEX MATCH "^[^/]+" folder "${file}")
    if(LAYER_${to} GREATER HIGHEST_${folder})
      breach("${file}" ${line}
             "includes ${included}: ${folder}/ may see layers up to ${HIGHEST_${folder}}, ${to} is on ${LAYER_${to}}")
    endif()
  endif()
endfunction()

function(check_heavy_header file line included)
  set(rest "${HEAVY}")
  while(rest)
    list(POP_FRONT rest start modules)
    string(FIND "${included}" "${start}" position)
    string(REPLACE " " ";" modules "${modules}")
    string(REGEX REPLACE "^src/cairn/([^/]+)/.*" "\\1" from "${file}")
    if(position EQUAL 0 AND NOT from IN_LIST modules)
      breach("${file}" ${line} "includes ${included}, too heavy for this module")
    endif()
  endwhile()
endfunction()

set(files "")
foreach(folder IN ITEMS src/cairn apps adapters python benchmarks examples)
  file(GLOB_RECURSE found RELATIVE "${ROOT}" "${ROOT}/${folder}/*.hpp" "${ROOT}/${folder}/*.cpp"
       "${ROOT}/${folder}/*.h" "${ROOT}/${folder}/*.cc" "${ROOT}/${folder}/*.ipp" "${ROOT}/${folder}/*.in")
  list(APPEND files ${found})
endforeach()

file(GLOB folders RELATIVE "${ROOT}/src/cairn" "${ROOT}/src/cairn/*")
foreach(module IN LISTS folders)
  if(IS_DIRECTORY "${ROOT}/src/cairn/${module}" AND NOT DEFINED LAYER_${module})
    breach("src/cairn/${module}" 1 "module ${module} is not in the layer table")
  endif()
endforeach()

set(includes 0)
foreach(file IN LISTS files)
  set(in_library FALSE)
  set(is_test FALSE)
  if(file MATCHES "^src/cairn/")
    set(in_library TRUE)
  endif()
  if(file MATCHES "_test\\.cpp$")
    set(is_test TRUE)
  endif()
  if(in_library AND NOT file MATCHES "^src/cairn/([^/]+/.|cairn\\.hpp$)")
    breach("${file}" 1 "is in no module")
  endif()

  matching_lines("${ROOT}/${file}" "(^|\n)[ \t]*#[ \t]*include" lines)
  foreach(entry IN LISTS lines)
    string(REGEX MATCH "^([0-9]+):[ \t]*#[ \t]*include[ \t]*(.*)$" ignored "${entry}")
    set(line "${CMAKE_MATCH_1}")
    set(rest "${CMAKE_MATCH_2}")
    math(EXPR includes "${includes} + 1")
    if(NOT rest MATCHES "^([<\"])([^>\"]+)[>\"]")
      breach("${file}" ${line} "an include that this check cannot read: ${rest}")
      continue()
    endif()
    set(quote "${CMAKE_MATCH_1}")
    set(included "${CMAKE_MATCH_2}")
    if(included MATCHES "(^|/)\\.\\.?/")
      breach("${file}" ${line} "includes ${included}: write the path from src/, so that the layers show")
    elseif(included MATCHES "^cairn/")
      check_own_header("${file}" ${line} "${included}")
    elseif(in_library AND quote STREQUAL "\"" AND NOT (is_test AND included MATCHES "^support/"))
      breach("${file}" ${line} "includes \"${included}\": the library's own headers start with cairn/")
    elseif(in_library)
      check_heavy_header("${file}" ${line} "${included}")
    endif()
  endforeach()

  if(in_library AND NOT is_test)
    set(printing "std::c(out|err|log)([^A-Za-z0-9_]|$)|fmt::print *\\(|(^|[^A-Za-z0-9_.>])(${OUTPUT_CALLS}) *\\(")
    set(exiting "(^|[^A-Za-z0-9_.>])(${EXIT_CALLS}) *\\(")
    matching_lines("${ROOT}/${file}" "${printing}|${exiting}" lines)
    foreach(entry IN LISTS lines)
      string(REGEX MATCH "^([0-9]+):(.*)$" ignored "${entry}")
      set(line "${CMAKE_MATCH_1}")
      # Neither text in quotes nor comments count.
      string(REGEX REPLACE "\"[^\"]*\"" "\"\"" code "${CMAKE_MATCH_2}")
      string(REGEX REPLACE "//.*" "" code "${code}")
      if(code MATCHES "${printing}")
        breach("${file}" ${line} "prints; the library never does")
      elseif(code MATCHES "${exiting}")
        breach("${file}" ${line} "ends the program; the library never does")
      endif()
    endforeach()
  endif()
endforeach()

list(LENGTH files file_count)
if(includes EQUAL 0)
  message(FATAL_ERROR "found no #include under ${ROOT}: the check has gone blind")
endif()
get_property(breaches GLOBAL PROPERTY BREACHES)
list(LENGTH breaches breach_count)
set(summary "${file_count} files, ${includes} includes, ${breach_count} breaches")
if(breach_count GREATER 0)
  message(FATAL_ERROR "${summary}")
endif()
message(STATUS "${summary}")
