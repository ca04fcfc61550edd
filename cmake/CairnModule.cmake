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

# cairn_unity(TARGET): with CAIRN_UNITY_BUILD, compiles the sources of a target up to twelve at a time. Most of the time
# goes into what they share (Eigen, GoogleTest, and the templates of both), so this halves it.
function(cairn_unity target)
  if(NOT CAIRN_UNITY_BUILD)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  get_target_property(sources ${target} SOURCES)
  set(ordinary "")
  foreach(source IN LISTS sources)
    get_filename_component(path "${source}" ABSOLUTE)
    file(RELATIVE_PATH path "${PROJECT_SOURCE_DIR}" "${path}")
    set(group "")
    foreach(apart IN LISTS CAIRN_UNITY_APART)
      string(REPLACE " " ";" apart "${apart}")
      if(path IN_LIST apart)
        list(LENGTH apart group_size)
        list(GET apart 0 group)
        string(MAKE_C_IDENTIFIER "${group}" group)
      endif()
    endforeach()
    if(group STREQUAL "")
      list(APPEND ordinary "${source}")
    elseif(group_size EQUAL 1)
      set_source_files_properties("${source}" PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    else()
      set_source_files_properties("${source}" PROPERTIES UNITY_GROUP "${group}")
    endif()
  endforeach()
  list(LENGTH ordinary count)
  math(EXPR groups "(${count} + 11) / 12")
  set(at 0)
  foreach(source IN LISTS ordinary)
    math(EXPR group "${at} * ${groups} / ${count}")
    math(EXPR at "${at} + 1")
    set_source_files_properties("${source}" PROPERTIES UNITY_GROUP "${group}")
  endforeach()
endfunction()

# Sources, a group a line, that are not compiled with the others of their target: a helper of theirs has the name
# of another's there.
set(CAIRN_UNITY_APART
    "src/cairn/geometry/decompositions.cpp"
    # Highway's sources include themselves.
    "src/cairn/core/detail/descriptor_kernel.cpp"
    "src/cairn/registration/detail/batch_kernel.cpp")

# cairn_module(NAME [OPTIONAL] SOURCES ... DEPENDS ... PRIVATE_DEPENDS ... TESTS ... [RELEASE_ONLY TEST...])
#
# One static library cairn_NAME (alias cairn::NAME) for the current folder, and one test program of
# its x_test.cpp files. OPTIONAL modules are not part of cairn::cairn: a
# consumer asks for them as components (cairn-config.cmake.in).
function(cairn_module name)
  cmake_parse_arguments(ARG "OPTIONAL" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS;TESTS;RELEASE_ONLY" ${ARGN})
  add_library(cairn_${name} STATIC ${ARG_SOURCES})
  add_library(cairn::${name} ALIAS cairn_${name})
  if(CAIRN_TEST_ONLY)
    set_target_properties(cairn_${name} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
  cairn_target_settings(cairn_${name})
  cairn_unity(cairn_${name})
  set_target_properties(cairn_${name} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_include_directories(cairn_${name} PUBLIC
    "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>" "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
  target_link_libraries(cairn_${name} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS})
  set_property(GLOBAL APPEND PROPERTY CAIRN_MODULES cairn_${name})
  if(NOT ARG_OPTIONAL)
    set_property(GLOBAL APPEND PROPERTY CAIRN_CORE_MODULES cairn_${name})
  endif()
  if(CAIRN_BUILD_TESTS AND ARG_TESTS)
    cairn_test(${name} SOURCES ${ARG_TESTS} DEPENDS cairn::${name} RELEASE_ONLY ${ARG_RELEASE_ONLY})
  endif()
endfunction()

# cairn_test(NAME SOURCES ... DEPENDS ... [SANITIZED FILTER | RELEASE_ONLY TEST...] [LONG TEST...] [TOGETHER SUITE...]): a
# GoogleTest program, each of its tests known to CTest. Those that do not match SANITIZED, or match RELEASE_ONLY, have the
# label release_only: sanitizers leave them out, as they take long and reach no code that others do not. Those of LONG have
# the label long: besides, they show at length what others show too, so they wait for scripts/test --full. The tests of a
# suite in TOGETHER share what takes seconds to make: without sanitizers they run in one process, as one test of CTest, and
# none of them may be skipped, which nobody would see.
function(cairn_test name)
  cmake_parse_arguments(ARG "" "SANITIZED" "SOURCES;DEPENDS;RELEASE_ONLY;LONG;TOGETHER" ${ARGN})
  add_executable(cairn_${name}_test ${ARG_SOURCES})
  cairn_target_settings(cairn_${name}_test)
  cairn_unity(cairn_${name}_test)
  # Tests spend their time in the library: optimising their own code costs more than it brings.
  target_compile_options(cairn_${name}_test PRIVATE $<$<CONFIG:Release>:-O1>)
  target_include_directories(cairn_${name}_test PRIVATE "${PROJECT_SOURCE_DIR}/tests")
  target_link_libraries(cairn_${name}_test PRIVATE ${ARG_DEPENDS} GTest::gmock GTest::gtest_main)
  if(CAIRN_TEST_ONLY AND NOT name IN_LIST CAIRN_TEST_ONLY)
    set_target_properties(cairn_${name}_test PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  # Of a GoogleTest filter, what follows "-" is left out.
  set(apart ${ARG_LONG})
  if(NOT CAIRN_SANITIZE)
    foreach(suite IN LISTS ARG_TOGETHER)
      list(APPEND apart "${suite}.*")
      add_test(NAME ${suite} COMMAND cairn_${name}_test --gtest_filter=${suite}.*)
      set_tests_properties(${suite} PROPERTIES TIMEOUT 1200)
    endforeach()
  endif()
  list(JOIN apart ":" apart)
  list(JOIN ARG_RELEASE_ONLY ":" slow)
  if(ARG_SANITIZED)
    set(quick "${ARG_SANITIZED}-${apart}")
    set(slow "-${ARG_SANITIZED}:${apart}")
  elseif(slow)
    set(quick "-${slow}:${apart}")
    set(slow "${slow}-${apart}")
  else()
    set(quick "-${apart}")
  endif()
  gtest_discover_tests(cairn_${name}_test TEST_FILTER "${quick}" TEST_LIST cairn_${name}_quick_tests
                       DISCOVERY_TIMEOUT 120 PROPERTIES TIMEOUT 600)
  if(slow)
    gtest_discover_tests(cairn_${name}_test TEST_FILTER "${slow}" DISCOVERY_TIMEOUT 120
                         PROPERTIES TIMEOUT 600 LABELS release_only)
  endif()
  if(ARG_LONG)
    list(JOIN ARG_LONG ":" long)
    gtest_discover_tests(cairn_${name}_test TEST_FILTER "${long}" TEST_LIST cairn_${name}_long_tests
                         DISCOVERY_TIMEOUT 120 PROPERTIES TIMEOUT 600 LABELS long)
  endif()
endfunction()
