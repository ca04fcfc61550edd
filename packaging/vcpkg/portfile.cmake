# SPDX-License-Identifier: BSD-3-Clause
# Draft, never run. An overlay port of the checkout that it lies in.
set(SOURCE_PATH "${CURRENT_PORT_DIR}/../..")

vcpkg_check_features(OUT_FEATURE_OPTIONS FEATURES
  FEATURES
    ceres CAIRN_WITH_CERES
    opencv CAIRN_WITH_OPENCV
    postgres CAIRN_WITH_POSTGRES
    sqlite CAIRN_WITH_SQLITE)

vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS
    ${FEATURES}
    -DCAIRN_BUILD_APPS=ON
    -DCAIRN_BUILD_TESTS=OFF
    -DCAIRN_BUILD_EXAMPLES=OFF
    -DCAIRN_WITH_PCL=OFF
    -DCAIRN_WITH_EMBREE=OFF
    -DCAIRN_WITH_VIEWER=OFF)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/cairn)
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
