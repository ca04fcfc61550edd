# SPDX-License-Identifier: BSD-3-Clause
# Two COLMAP models of one simulated place, made from different images, and one of another session: at least one of their
# three pairs is aligned with the right pose and merges with all images, and none is aligned with a wrong one. COLMAP's
# models differ from run to run.
#
#   cmake -D PYTHON=... -D SCRIPT=studies/colmap_pairs.py -D CAIRN=... -D WORK=... -P run.cmake

find_program(colmap colmap)
execute_process(COMMAND "${PYTHON}" -c "import numpy" RESULT_VARIABLE no_numpy OUTPUT_QUIET ERROR_QUIET)
if(NOT colmap OR NOT no_numpy EQUAL 0)
  message("skipped: needs COLMAP and NumPy")
  return()
endif()
file(REMOVE_RECURSE "${WORK}")
execute_process(COMMAND "${PYTHON}" "${SCRIPT}" --cairn "${CAIRN}" --work "${WORK}" --colmap "${colmap}" --images 15
                        --places desk-61 --no-bare --strangers --least-right 1
                RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "exit code ${result}\n${output}")
endif()
message("${output}")
