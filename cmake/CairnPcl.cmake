# SPDX-License-Identifier: BSD-3-Clause
# cairn_pcl_library: the parts of the Point Cloud Library that tests, examples and benchmarks use.
# PCL's own package file pulls in VTK and, through it, MPI and the C language, none of which a
# registration needs.
include_guard(GLOBAL)

find_path(CAIRN_PCL_INCLUDE_DIR pcl/registration/icp.h
          PATH_SUFFIXES pcl-1.15 pcl-1.14 pcl-1.13 pcl-1.12 REQUIRED)
add_library(cairn_pcl_library INTERFACE)
target_include_directories(cairn_pcl_library SYSTEM INTERFACE "${CAIRN_PCL_INCLUDE_DIR}")
target_link_libraries(cairn_pcl_library INTERFACE Eigen3::Eigen)
# g++ 12 sees bounds broken where PCL's templates load three floats as four, which Eigen allows for.
target_compile_options(cairn_pcl_library INTERFACE -Wno-array-bounds)
foreach(part registration features filters search kdtree octree io io_ply common)
  find_library(CAIRN_PCL_${part} pcl_${part} REQUIRED)
  target_link_libraries(cairn_pcl_library INTERFACE "${CAIRN_PCL_${part}}")
endforeach()
foreach(part flann_cpp lz4)
  find_library(CAIRN_${part} NAMES ${part} lib${part}.so.1 REQUIRED)
  target_link_libraries(cairn_pcl_library INTERFACE "${CAIRN_${part}}")
endforeach()
