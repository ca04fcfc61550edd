# SPDX-License-Identifier: BSD-3-Clause
# Toolchain file: Debian's cross compiler for 64-bit ARM; the programs run under QEMU. packaging/try_aarch64 uses it.
# CAIRN_SYSROOT is a folder with the libraries of that architecture.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)

list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES CAIRN_SYSROOT)
if(NOT IS_DIRECTORY "${CAIRN_SYSROOT}")
  message(FATAL_ERROR "CAIRN_SYSROOT names no folder: '${CAIRN_SYSROOT}'")
endif()
set(CMAKE_SYSROOT "${CAIRN_SYSROOT}")
set(CMAKE_CROSSCOMPILING_EMULATOR "qemu-aarch64-static;-L;${CMAKE_SYSROOT}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
