# SPDX-License-Identifier: BSD-3-Clause
# find_package(cairn) for consumers: cairn::cairn and, as components, the modules that need more (cairn-config.cmake.in).
# What is installed is in parts, tool, dev and python, each of which is a Debian package (CairnPackages.cmake).
include(CMakePackageConfigHelpers)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME dev)

get_property(modules GLOBAL PROPERTY CAIRN_MODULES)
install(TARGETS ${modules} cairn_cairn cairn_pcl EXPORT cairn-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT cairn-targets NAMESPACE cairn:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)
foreach(module IN LISTS modules)
  get_target_property(folder ${module} SOURCE_DIR)
  file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}/src" "${folder}")
  # What is in detail/ is no interface, and may need what who installs Cairn does not have.
  install(DIRECTORY "src/${folder}/" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/${folder}"
          FILES_MATCHING PATTERN "*.hpp" PATTERN "detail" EXCLUDE)
endforeach()
install(FILES src/cairn/cairn.hpp DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/cairn)
install(DIRECTORY adapters/pcl/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/cairn/adapters/pcl
        FILES_MATCHING PATTERN "*.hpp")
install(FILES "${PROJECT_BINARY_DIR}/generated/cairn/core/version_number.hpp"
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/cairn/core)
# Every part holds code of others, and each Debian package has a folder of documents (CairnPackages.cmake).
set_property(GLOBAL APPEND PROPERTY CAIRN_NOTICES "${PROJECT_SOURCE_DIR}/LICENSE" "${PROJECT_SOURCE_DIR}/THIRD_PARTY")
get_property(notices GLOBAL PROPERTY CAIRN_NOTICES)
install(FILES ${notices} DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT tool)
install(FILES ${notices} DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/libcairn-dev" COMPONENT dev EXCLUDE_FROM_ALL)
if(TARGET cairn_app)
  install(FILES packaging/cairn.bash RENAME cairn COMPONENT tool
          DESTINATION "${CMAKE_INSTALL_DATADIR}/bash-completion/completions")
  install(FILES packaging/cairn.zsh RENAME _cairn COMPONENT tool
          DESTINATION "${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions")
  # The manual pages are the tool's own help.
  set(man "${PROJECT_BINARY_DIR}/man")
  install(CODE "execute_process(COMMAND_ERROR_IS_FATAL ANY
    COMMAND \"${PROJECT_SOURCE_DIR}/packaging/man_pages\" \"$<TARGET_FILE:cairn::tool>\" \"${man}\")" COMPONENT tool)
  install(DIRECTORY "${man}/" DESTINATION "${CMAKE_INSTALL_MANDIR}/man1" COMPONENT tool)
endif()

# pkg-config, for cairn::cairn. A static library precedes those that it needs.
get_property(core_modules GLOBAL PROPERTY CAIRN_CORE_MODULES)
set(core ${core_modules})
list(REVERSE core)
list(TRANSFORM core PREPEND "-l")
list(JOIN core " " CAIRN_PC_LIBRARIES)
# The prefix is known on installation: from where the file is.
file(RELATIVE_PATH CAIRN_PC_PREFIX "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
string(REGEX REPLACE "/$" "" CAIRN_PC_PREFIX "${CAIRN_PC_PREFIX}")
configure_file(packaging/cairn.pc.in "${PROJECT_BINARY_DIR}/cairn.pc" @ONLY)
install(FILES "${PROJECT_BINARY_DIR}/cairn.pc" DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

if(TARGET cairn_python)
  set(CAIRN_PYTHON_INSTALL_DIR "" CACHE STRING
      "Where the Python package is installed, below the prefix; empty: where Debian's Python looks")
  # Debian's Python looks in other folders below /usr than below /usr/local; the prefix is known on installation.
  install(CODE "
    set(cairn_python_folder \"${CAIRN_PYTHON_INSTALL_DIR}\")
    if(NOT cairn_python_folder AND CMAKE_INSTALL_PREFIX STREQUAL \"/usr\")
      set(cairn_python_folder lib/python3/dist-packages)
    elseif(NOT cairn_python_folder)
      set(cairn_python_folder lib/python${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}/dist-packages)
    endif()" COMPONENT python)
  install(TARGETS cairn_python LIBRARY DESTINATION "\${cairn_python_folder}/cairn" COMPONENT python)
  install(DIRECTORY python/cairn/ DESTINATION "\${cairn_python_folder}/cairn" COMPONENT python
          FILES_MATCHING PATTERN "*.py" PATTERN "*.pyi" PATTERN "py.typed")
  install(FILES ${notices} DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/python3-cairn" COMPONENT python EXCLUDE_FROM_ALL)
endif()

# Modules that a consumer asks for by name, beside what always comes.
set(CAIRN_COMPONENTS core pcl)
foreach(module IN LISTS modules)
  if(NOT module IN_LIST core_modules)
    string(REGEX REPLACE "^cairn_" "" component ${module})
    list(APPEND CAIRN_COMPONENTS ${component})
  endif()
endforeach()
set_property(GLOBAL PROPERTY CAIRN_COMPONENTS ${CAIRN_COMPONENTS})
set(CAIRN_YAML_PACKAGE "")
if(yaml-cpp_FOUND)
  set(CAIRN_YAML_PACKAGE yaml-cpp)
endif()
configure_package_config_file(cmake/cairn-config.cmake.in "${PROJECT_BINARY_DIR}/cairn-config.cmake"
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/cairn-config-version.cmake"
  COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/cairn-config.cmake" "${PROJECT_BINARY_DIR}/cairn-config-version.cmake"
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)
