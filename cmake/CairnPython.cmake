# SPDX-License-Identifier: BSD-3-Clause
# Sets CAIRN_PYTHON's default: ON where Python with NumPy and pybind11 are found.
include_guard(GLOBAL)

# The first Python that has NumPy: the one in PATH may be another than the one whose packages Debian installs.
if(NOT Python_EXECUTABLE)
  foreach(candidate IN ITEMS python3 /usr/bin/python3)
    execute_process(COMMAND ${candidate} -c "import numpy, sys; print(sys.executable)"
                    RESULT_VARIABLE result OUTPUT_VARIABLE executable ERROR_QUIET
                    OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(result EQUAL 0)
      set(Python_EXECUTABLE "${executable}")
      break()
    endif()
  endforeach()
endif()

set(default OFF)
if(PROJECT_IS_TOP_LEVEL AND Python_EXECUTABLE AND NOT CAIRN_SANITIZE AND NOT CAIRN_BUILD_FUZZERS)
  find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module)
  find_package(pybind11 2.10 QUIET CONFIG)
  if(Python_FOUND AND pybind11_FOUND)
    set(default ON)
  endif()
endif()
# CAIRN_PYTHON builds the Python module (pybind11, NumPy). The default is not cached: what is missing when a folder is
# configured first, as by scripts/demo, may be installed later.
if(NOT DEFINED CACHE{CAIRN_PYTHON})
  set(CAIRN_PYTHON ${default})
endif()
if(CAIRN_PYTHON)
  find_package(Python 3.9 REQUIRED COMPONENTS Interpreter Development.Module)
  find_package(pybind11 2.10 REQUIRED CONFIG)
endif()
