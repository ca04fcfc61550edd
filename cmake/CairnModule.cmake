# SPDX-License-Identifier: BSD-3-Clause

# Compile settings of our own code; nothing here reaches a consumer.
function(cairn_target_settings target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  # Contraction into fused multiply-adds would make results depend on the instruction set.
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
                         -Wno-sign-conversion -ffp-contract=off)
  if(CAIRN_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

# cairn_module(NAME [OPTIONAL] SOURCES ... DEPENDS ... PRIVATE_DEPENDS ... TESTS ...)
#
# One static library cairn_NAME (alias cairn::NAME) for the current folder, and one test program of
# its x_test.cpp files. OPTIONAL modules need heavy libraries: they are not part of cairn::cairn.
function(cairn_module name)
  cmake_parse_arguments(ARG "OPTIONAL" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS;TESTS" ${ARGN})
  add_library(cairn_${name} STATIC ${ARG_SOURCES})
  add_library(cairn::${name} ALIAS cairn_${name})
  cairn_target_settings(cairn_${name})
  set_target_properties(cairn_${name} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_include_directories(cairn_${name} PUBLIC
    "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>" "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
  target_link_libraries(cairn_${name} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS})
  set_property(GLOBAL APPEND PROPERTY CAIRN_MODULES cairn_${name})
  if(NOT ARG_OPTIONAL)
    set_property(GLOBAL APPEND PROPERTY CAIRN_CORE_MODULES cairn_${name})
  endif()
  if(CAIRN_BUILD_TESTS AND ARG_TESTS)
    cairn_test(${name} SOURCES ${ARG_TESTS} DEPENDS cairn::${name})
  endif()
endfunction()

# cairn_test(NAME SOURCES ... DEPENDS ...): a GoogleTest program, each of its tests known to CTest.
function(cairn_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(cairn_${name}_test ${ARG_SOURCES})
  cairn_target_settings(cairn_${name}_test)
  target_include_directories(cairn_${name}_test PRIVATE "${PROJECT_SOURCE_DIR}/tests")
  target_link_libraries(cairn_${name}_test PRIVATE ${ARG_DEPENDS} GTest::gmock GTest::gtest_main)
  gtest_discover_tests(cairn_${name}_test DISCOVERY_TIMEOUT 120 PROPERTIES TIMEOUT 600)
endfunction()
