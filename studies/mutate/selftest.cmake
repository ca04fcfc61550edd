# SPDX-License-Identifier: BSD-3-Clause
# A proof that studies/mutate/mutate tells faults that a test sees from those that none sees:
#   cmake -D SCRIPT=... -D TOY=... -D WORK=... -P selftest.cmake
file(REMOVE_RECURSE "${WORK}")
file(COPY "${TOY}/" DESTINATION "${WORK}")

function(mutate expected_status)
  execute_process(COMMAND "${SCRIPT}" --root "${WORK}" --module toy --jobs 1 ${ARGN}
                  RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(output MATCHES "no libclang for Python")
    message("skipped: ${output}")
    return()
  endif()
  if(NOT status EQUAL expected_status)
    message(FATAL_ERROR "studies/mutate/mutate ${ARGN} ended with ${status}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

function(expect pattern)
  if(NOT output MATCHES "${pattern}")
    message(FATAL_ERROR "Expected \"${pattern}\" in:\n${output}")
  endif()
endfunction()

# mutants, tried, killed, survived, of these not reached: the sizes that are added make a kill.
mutate(0)
if(NOT output)
  return()
endif()
expect("toy.cpp: 7 mutants, 1 more do not compile")
expect("\ntoy +7 +7 +5 +2 +1\n")
expect("toy.cpp:12: [0-9a-f]+: `a - b` -> `a [+] b`\n")
expect("toy.cpp:17: [0-9a-f]+: `a [*] b` -> `a / b` [(]no test reaches it[)]\n")

# What survived is found again where its line has moved to.
file(READ "${WORK}/src/cairn/toy/toy.cpp" source)
file(WRITE "${WORK}/src/cairn/toy/toy.cpp" "// One line more.\n${source}")
mutate(0)
expect("toy.cpp:13: [0-9a-f]+: `a - b` -> `a [+] b`\n")
