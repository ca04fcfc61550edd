# SPDX-License-Identifier: BSD-3-Clause
# find_package(cairn) for consumers: cairn::cairn is the whole library, cairn::pcl the PCL adapter.
include(CMakePackageConfigHelpers)

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
install(DIRECTORY adapters/pcl/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/cairn/adapters/pcl
        FILES_MATCHING PATTERN "*.hpp")
install(FILES "${PROJECT_BINARY_DIR}/generated/cairn/core/version_number.hpp"
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/cairn/core)
install(FILES LICENSE THIRD_PARTY DESTINATION ${CMAKE_INSTALL_DOCDIR})

configure_package_config_file(cmake/cairn-config.cmake.in "${PROJECT_BINARY_DIR}/cairn-config.cmake"
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/cairn-config-version.cmake"
  COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/cairn-config.cmake" "${PROJECT_BINARY_DIR}/cairn-config-version.cmake"
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)
