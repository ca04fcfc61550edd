# SPDX-License-Identifier: BSD-3-Clause
include_guard(GLOBAL)

# cairn_embed_viewer(TARGET SOURCE): builds viewer/ into one HTML page, in the build folder, and has
# SOURCE of TARGET take that file in: its name is the macro CAIRN_VIEWER_PAGE.
function(cairn_embed_viewer target source)
  find_program(CAIRN_NODE node)
  find_program(CAIRN_NPM npm)
  if(NOT CAIRN_NODE OR NOT CAIRN_NPM)
    message(FATAL_ERROR "The viewer of reports takes Node.js and npm to build, which are not to be found "
      "(node: ${CAIRN_NODE}, npm: ${CAIRN_NPM}). Install them (Debian: nodejs, npm), or configure with "
      "-DCAIRN_WITH_VIEWER=OFF: then all is built but the writing of reports.")
  endif()

  set(folder "${PROJECT_SOURCE_DIR}/viewer")
  set(work "${PROJECT_BINARY_DIR}/viewer")
  set(page "${work}/page/report_template.html")
  set(packages "${folder}/package.json" "${folder}/package-lock.json" "${folder}/.npmrc")
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS "${folder}/src/*")
  set(script "${PROJECT_SOURCE_DIR}/cmake/build_viewer.cmake")
  set(run "${CMAKE_COMMAND}" -D "NODE=${CAIRN_NODE}" -D "NPM=${CAIRN_NPM}" -D "SOURCE=${folder}" -D "WORK=${work}")
  # Two steps: the packages are fetched again only if their list changes.
  add_custom_command(OUTPUT "${work}/packages.stamp"
    COMMAND ${run} -D STEP=packages -P "${script}"
    DEPENDS ${packages} "${script}"
    COMMENT "Fetching the packages of the viewer" VERBATIM)
  add_custom_command(OUTPUT "${page}" BYPRODUCTS "${work}/page/THIRD_PARTY_VIEWER.txt"
    COMMAND ${run} -D STEP=page -D "PAGE=${page}" -P "${script}"
    DEPENDS "${work}/packages.stamp" ${sources} "${folder}/build.mjs" "${folder}/tsconfig.json" "${script}"
    COMMENT "Building the viewer" VERBATIM)
  add_custom_target(${target}_viewer DEPENDS "${page}")
  add_dependencies(${target} ${target}_viewer)
  set_source_files_properties("${source}" PROPERTIES
    OBJECT_DEPENDS "${page}" COMPILE_DEFINITIONS "CAIRN_VIEWER_PAGE=\"${page}\"")
  set_property(GLOBAL APPEND PROPERTY CAIRN_NOTICES "${work}/page/THIRD_PARTY_VIEWER.txt")
endfunction()
