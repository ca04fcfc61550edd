# SPDX-License-Identifier: BSD-3-Clause
# cmake --build <build> --target package: Debian packages cairn, libcairn-dev and python3-cairn.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME cairn)
set(CPACK_PACKAGE_VENDOR "the Cairn authors")
# Who builds a package for others is its maintainer, and says so in the variables that Debian's own tools read. The
# authors have no mail address; .invalid says that (RFC 2606).
set(contact "the Cairn authors <no-address@cairn.invalid>")
if(NOT "$ENV{DEBFULLNAME}" STREQUAL "" AND NOT "$ENV{DEBEMAIL}" STREQUAL "")
  set(contact "$ENV{DEBFULLNAME} <$ENV{DEBEMAIL}>")
endif()
set(CPACK_PACKAGE_CONTACT "${contact}" CACHE STRING "Maintainer of the packages")
set(CPACK_PACKAGE_DIRECTORY "${PROJECT_BINARY_DIR}/packages")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL dev)
if(TARGET cairn_app)
  list(APPEND CPACK_COMPONENTS_ALL tool)
endif()
if(TARGET cairn_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
# The libraries that executables need, found by dpkg-shlibdeps.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "alignment of visual SLAM landmark maps")
set(about "Cairn aligns the landmark maps of feature-based visual SLAM, and says
whether to believe the pose, from covariances, observations and descriptors.\n")

set(CPACK_DEBIAN_TOOL_PACKAGE_NAME cairn)
set(CPACK_DEBIAN_TOOL_PACKAGE_SECTION science)
set(CPACK_DEBIAN_TOOL_DESCRIPTION "${about}\nThis package has the command-line tool.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libcairn-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_DESCRIPTION "${about}\nThis package has headers, static libraries, and files for CMake and pkg-config.")
# What an installed header includes, or a static library is linked with.
set(needed libeigen3-dev libfmt-dev libtbb-dev libhwy-dev zlib1g-dev)
if(yaml-cpp_FOUND)
  list(APPEND needed libyaml-cpp-dev)
endif()
if(TARGET cairn_storage)
  list(APPEND needed libsqlite3-dev)
endif()
if(TARGET cairn_recording)
  list(APPEND needed libbz2-dev liblz4-dev libzstd-dev)
endif()
if(CAIRN_WITH_POSTGRES)
  list(APPEND needed libpqxx-dev)
endif()
if(TARGET cairn_sequence)
  list(APPEND needed libopencv-core-dev libopencv-imgproc-dev libjpeg-dev libpng-dev libexif-dev)
endif()
if(TARGET cairn_vision)
  list(APPEND needed libopencv-features2d-dev libopencv-calib3d-dev)
endif()
if(CAIRN_WITH_CERES)
  list(APPEND needed libceres-dev)
endif()
if(TARGET cairn_simulation)
  list(APPEND needed libembree-dev)
endif()
list(JOIN needed ", " CPACK_DEBIAN_DEV_PACKAGE_DEPENDS)
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS libpcl-dev)  # cairn::pcl

if(TARGET cairn_python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-cairn)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_DESCRIPTION "${about}\nThis package has the Python module.")
  math(EXPR next "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next}), python3-numpy")
  # Compile the modules, and remove what that made.
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA "${PROJECT_SOURCE_DIR}/packaging/python3-cairn/postinst"
      "${PROJECT_SOURCE_DIR}/packaging/python3-cairn/prerm")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_STRICT_PERMISSION ON)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-pandas, python3-tqdm, python3-matplotlib")
endif()

# What Debian asks of each package: its licence, and what changed.
set(texts "${PROJECT_BINARY_DIR}/packaging")
file(READ LICENSE license)
string(REGEX REPLACE "\n+$" "" license "${license}")
string(REPLACE "\n" "\n " license "${license}")
string(REPLACE "\n \n" "\n .\n" license "${license}")
file(WRITE "${texts}/copyright"
  "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/\nUpstream-Name: cairn\n\n"
  "Files: *\nCopyright: 2026, the Cairn authors\nLicense: BSD-3-Clause\n ${license}\n")
find_program(CAIRN_GZIP gzip)
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${component} upper)
  set(package "${CPACK_DEBIAN_${upper}_PACKAGE_NAME}")
  set(folder "${texts}/${package}")
  file(WRITE "${folder}/changelog.Debian"
    "${package} (${PROJECT_VERSION}-1) unstable; urgency=low\n\n  * New release: see CHANGELOG.md.\n\n"
    " -- ${CPACK_PACKAGE_CONTACT}  Thu, 01 Jan 2026 00:00:00 +0000\n")
  if(CAIRN_GZIP)
    execute_process(COMMAND "${CAIRN_GZIP}" -9nf "${folder}/changelog.Debian")
    install(FILES "${folder}/changelog.Debian.gz" DESTINATION "share/doc/${package}" COMPONENT ${component}
            EXCLUDE_FROM_ALL)
  endif()
  install(FILES "${texts}/copyright" DESTINATION "share/doc/${package}" COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()
include(CPack)
