# SPDX-License-Identifier: BSD-3-Clause
# Compiles through ccache where it is installed. Relative paths let every checkout use the objects of the others.
find_program(CAIRN_CCACHE ccache)
if(CAIRN_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  cmake_path(GET CMAKE_CURRENT_LIST_DIR PARENT_PATH cairn_checkout)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env "CCACHE_BASEDIR=${cairn_checkout}" CCACHE_NOHASHDIR=true
      "${CAIRN_CCACHE}")
endif()
