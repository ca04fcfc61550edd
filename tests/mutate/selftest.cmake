# SPDX-License-Identifier: BSD-3-Clause
# A proof that scripts/mutate tells faults that a test sees from those that none sees:
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
    message(FATAL_ERROR "scripts/mutate ${ARGN} ended with ${status}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

function(expect pattern)
  if(NOT output MATCHES "${pattern}")
    message(FATAL_ERROR "Expected \"${pattern}\" in:\n${output}")
  endif()
endfunction()

# mutants, tried, killed, equivalent, survived, of these not reached: the sizes that are added make a kill.
mutate(0)
if(NOT output)
  return()
endif()
expect("toy.cpp: 7 mutants, 1 more do not compile")
expect("\ntoy +7 +7 +5 +0 +2 +1\n")
expect("toy.cpp:12: [0-9a-f]+: `a - b` -> `a [+] b`\n")
expect("toy.cpp:17: [0-9a-f]+: `a [*] b` -> `a / b` [(]no test reaches it[)]\n")

# What is explained no longer counts as a survivor, wherever its line has moved to.
file(WRITE "${WORK}/tests/mutants_equivalent.txt"
     "file src/cairn/toy/toy.cpp\nchange `a - b` -> `a + b`\nline return a - b;\nwhy a toy\n")
file(READ "${WORK}/src/cairn/toy/toy.cpp" source)
file(WRITE "${WORK}/src/cairn/toy/toy.cpp" "// One line more.\n${source}")
mutate(0)
expect("\ntoy +7 +7 +5 +1 +1 +1\n")
