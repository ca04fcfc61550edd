# SPDX-License-Identifier: BSD-3-Clause
# Draft, never run. Builds the checkout that it lies in.
import os

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout


class CairnConan(ConanFile):
    name = "cairn"
    version = "0.1.0"
    license = "BSD-3-Clause"
    description = "Aligns, links and merges the landmark maps of visual SLAM"
    package_type = "static-library"
    settings = "os", "compiler", "build_type", "arch"
    options = {
        "with_ceres": [True, False],
        "with_opencv": [True, False],
        "with_postgres": [True, False],
        "with_sqlite": [True, False],
    }
    default_options = {option: False for option in options}

    def requirements(self):
        for name in ("boost/1.83.0", "cli11/2.3.2", "eigen/3.4.0", "fmt/10.2.1", "highway/1.0.7", "nanoflann/1.5.2",
                     "nlohmann_json/3.11.3", "onetbb/2021.10.0", "xxhash/0.8.2", "yaml-cpp/0.8.0", "zlib/1.3.1"):
            self.requires(name)
        if self.options.with_ceres:
            self.requires("ceres-solver/2.1.0")
        if self.options.with_opencv:
            self.requires("opencv/4.8.1")
            self.requires("libjpeg-turbo/3.0.2")
            self.requires("libpng/1.6.43")
        if self.options.with_postgres:
            self.requires("libpqxx/7.9.0")
        if self.options.with_sqlite:
            self.requires("sqlite3/3.45.1")

    def layout(self):
        self.folders.root = os.path.join("..", "..")
        cmake_layout(self)

    def generate(self):
        CMakeDeps(self).generate()
        toolchain = CMakeToolchain(self)
        for option in ("ceres", "opencv", "postgres", "sqlite"):
            toolchain.variables[f"CAIRN_WITH_{option.upper()}"] = bool(getattr(self.options, f"with_{option}"))
        for name in ("BUILD_TESTS", "BUILD_EXAMPLES", "WITH_PCL", "WITH_EMBREE", "WITH_VIEWER"):
            toolchain.variables[f"CAIRN_{name}"] = False
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()

    def package_info(self):
        self.cpp_info.set_property("cmake_file_name", "cairn")
        self.cpp_info.set_property("cmake_target_name", "cairn::cairn")
