# SPDX-License-Identifier: BSD-3-Clause
"""Builds the Python module with CMake.

Environment: CMAKE_ARGS has options for CMake; CAIRN_BUILD names a build folder to take the module from, instead of
building it.
"""

import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).parent.resolve()
VERSION = re.search(r"project\(cairn VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)


def required_numpy():
    """pybind11 before 2.12 knows no NumPy 2, which a module that is built with it refuses to be imported with."""
    query = ["pkg-config", "--max-version=2.11.99", "pybind11"]
    is_old = shutil.which(query[0]) and subprocess.run(query, stderr=subprocess.DEVNULL).returncode == 0
    return "numpy<2" if is_old else "numpy"


class BuildWithCMake(build_ext):
    def build_extension(self, extension):
        target = pathlib.Path(self.get_ext_fullpath(extension.name)).resolve()
        given = os.environ.get("CAIRN_BUILD")
        build = pathlib.Path(given or self.build_temp + "/cmake").resolve()
        if not given:
            self.build_with_cmake(build)
        (built,) = (build / "python" / "cairn").glob("_cairn*.so")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(built, target)
        viewer_notices = build / "viewer" / "page" / "THIRD_PARTY_VIEWER.txt"
        if viewer_notices.exists():
            shutil.copy2(viewer_notices, target.parent)

    def build_with_cmake(self, build):
        options = {
            "CMAKE_BUILD_TYPE": "Release",
            "CAIRN_PYTHON": "ON",
            "CAIRN_BUILD_APPS": "OFF",
            "CAIRN_BUILD_EXAMPLES": "OFF",
            "CAIRN_BUILD_TESTS": "OFF",
            "CAIRN_WITH_PCL": "OFF",
            "Python_EXECUTABLE": sys.executable,
        }
        command = ["cmake", "-S", str(ROOT), "-B", str(build)] + [f"-D{k}={v}" for k, v in options.items()]
        if shutil.which("ninja"):
            command += ["-G", "Ninja"]
        subprocess.run(command + shlex.split(os.environ.get("CMAKE_ARGS", "")), check=True)
        jobs = str(self.parallel or len(os.sched_getaffinity(0)))
        subprocess.run(["cmake", "--build", str(build), "--target", "cairn_python", "-j", jobs], check=True)


setup(
    version=VERSION,
    install_requires=[required_numpy()],
    packages=["cairn"],
    package_dir={"cairn": "python/cairn"},
    package_data={"cairn": ["py.typed", "*.pyi"]},
    ext_modules=[Extension("cairn._cairn", sources=[])],
    cmdclass={"build_ext": BuildWithCMake},
)
