# SPDX-License-Identifier: BSD-3-Clause
# cmake -D WORK=<folder> -P layers_selftest.cmake
#
# Proves that layers.cmake sees what it is there to see: on a small tree with one breach of each
# kind it must name exactly these, and on the same tree without them it must pass.
cmake_minimum_required(VERSION 3.25)

file(REMOVE_RECURSE "${WORK}")

# Lines of the tree without a breach, and the files that hold one each, at line 2.
function(allowed file)
  string(JOIN "\n" text "// SPDX" ${ARGN})
  file(WRITE "${WORK}/tree/${file}" "${text}\n")
endfunction()
set(breach_files "")
macro(breach file)
  string(JOIN "\n" text "// SPDX" ${ARGN})
  string(APPEND breach_tree "file(WRITE [==[${WORK}/tree/${file}]==] [==[${text}\n]==])\n")
  list(APPEND breach_files "${file}")
endmacro()

function(run_check expect_failure)
  execute_process(COMMAND "${CMAKE_COMMAND}" -D "ROOT=${WORK}/tree" -P "${CMAKE_CURRENT_LIST_DIR}/layers.cmake"
                  RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE errors)
  set(errors "${output}${errors}" PARENT_SCOPE)
  if(expect_failure AND result EQUAL 0)
    message(FATAL_ERROR "accepted a tree with breaches:\n${output}${errors}")
  elseif(NOT expect_failure AND NOT result EQUAL 0)
    message(FATAL_ERROR "refused a tree without a breach:\n${output}${errors}")
  endif()
endfunction()

allowed(src/cairn/core/a.hpp "#include <vector>")
allowed(src/cairn/geometry/a.hpp "#include \"cairn/core/a.hpp\"" "#include <Eigen/Core>")
allowed(src/cairn/geometry/a.cpp "#include \"cairn/geometry/a.hpp\"" "// never call exit(1) or printf(x)"
        "const char* text = \"std::cout << puts(1)\"\;" "std::snprintf(buffer, size, format)\;" "state.abort()\;")
allowed(src/cairn/geometry/a_test.cpp "#include \"support/x.hpp\"" "#include \"cairn/geometry/a.hpp\""
        "std::cout << 1\;" "std::exit(0)\;")
allowed(src/cairn/sequence/a.cpp "#include <opencv2/core.hpp>")
allowed(src/cairn/registration/a.hpp "#include \"cairn/registration/score/a.hpp\"" "#include \"cairn/map/a.hpp\"")
allowed(src/cairn/registration/score/a.hpp "#include \"cairn/registration/a.hpp\""
        "#include \"cairn/registration/score/b.hpp\"")
allowed(src/cairn/report/a.hpp "#include \"cairn/experiments/a.hpp\"")
allowed(apps/cairn/a.cpp "#include \"cairn/report/a.hpp\"" "#include \"local.hpp\"" "std::cout << 1\;")
allowed(adapters/pcl/a.hpp "#include \"cairn/registration/a.hpp\"" "#include \"adapters/pcl/b.hpp\""
        "#include <pcl/point_cloud.h>")
run_check(FALSE)

breach(src/cairn/core/upwards.hpp "#include \"cairn/geometry/a.hpp\"")
breach(src/cairn/map/upwards.cpp "  #  include <cairn/registration/a.hpp>")
breach(src/cairn/map/upwards_test.cpp "#include \"cairn/registration/a.hpp\"")
breach(src/cairn/map/sideways.hpp "#include \"cairn/trajectory/a.hpp\"")
breach(src/cairn/placement/sideways.hpp "#include \"cairn/evaluation/a.hpp\"")
breach(src/cairn/registration/score/other_folder.hpp "#include \"cairn/registration/neighbors/a.hpp\"")
breach(src/cairn/registration/neighbors/other_folder.cpp "#include \"cairn/registration/estimation/a.hpp\"")
breach(src/cairn/report/unknown_module.hpp "#include \"cairn/nonsense/a.hpp\"")
breach(src/cairn/report/no_module.hpp "#include \"cairn/cairn.hpp\"")
breach(src/cairn/report/relative.hpp "#include \"../core/a.hpp\"")
breach(src/cairn/report/relative_inside.hpp "#include <cairn/report/../core/a.hpp>")
breach(src/cairn/report/bare.hpp "#include \"a.hpp\"")
breach(src/cairn/report/other_tree.cpp "#include \"apps/cairn/a.hpp\"")
breach(src/cairn/report/test_support.cpp "#include \"support/x.hpp\"")
breach(src/cairn/report/macro.cpp "#include HEADER")
breach(src/cairn/core/opencv.cpp "#include <opencv2/core.hpp>")
breach(src/cairn/registration/pcl_test.cpp "#include <pcl/point_cloud.h>")
breach(src/cairn/sequence/python.cpp "#include <Python.h>")
breach(src/cairn/atlas/pybind.cpp "#include <pybind11/pybind11.h>")
breach(src/cairn/evaluation/ceres.cpp "#include <ceres/ceres.h>")
breach(src/cairn/core/cout.cpp "  std::cout << 1\;")
breach(src/cairn/core/cerr.hpp "std::cerr<<\"a\"\;")
breach(src/cairn/core/printf.cpp "  printf(\"a\")\;")
breach(src/cairn/core/std_puts.cpp "  std::puts(\"a\")\; // prints")
breach(src/cairn/core/exit.cpp "  if (x) std::exit(1)\;")
breach(src/cairn/core/abort.cpp "  abort()\;")
breach(adapters/pcl/upwards.hpp "#include \"cairn/evaluation/a.hpp\"")
breach(apps/cairn/unknown_module.cpp "#include \"cairn/nonsense/a.hpp\"")
breach(python/relative.cpp "#include \"../src/cairn/core/a.hpp\"")
cmake_language(EVAL CODE "${breach_tree}")
run_check(TRUE)

foreach(file IN LISTS breach_files)
  string(FIND "${errors}" "\n${file}:2: " position)
  string(FIND "${errors}" "${file}:2: " first)
  if(position EQUAL -1 AND NOT first EQUAL 0)
    message(SEND_ERROR "missed the breach in ${file}")
  endif()
endforeach()
list(LENGTH breach_files expected)
if(NOT errors MATCHES "[ ,]${expected} breaches")
  message(SEND_ERROR "expected exactly ${expected} breaches")
endif()

# A folder and a file that no module owns.
file(REMOVE_RECURSE "${WORK}/tree")
allowed(src/cairn/nonsense/a.hpp "#include <vector>")
run_check(TRUE)
file(REMOVE_RECURSE "${WORK}/tree")
allowed(src/cairn/loose.hpp "#include <vector>")
run_check(TRUE)

# A wrong ROOT must not pass for a clean tree.
file(REMOVE_RECURSE "${WORK}/tree")
run_check(TRUE)
file(MAKE_DIRECTORY "${WORK}/tree/src/cairn")
run_check(TRUE)
