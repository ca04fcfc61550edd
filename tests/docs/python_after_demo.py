#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Configures a folder as scripts/demo does, on a machine without pybind11 and PCL, and then as docs/python.md says, with
pybind11: python_after_demo.py ROOT WORK BUILD

The folder must then be able to build the Python module; so must one that the demo's command configures again, as
scripts/test does with its own. Runs the import of docs/python.md where BUILD has the module.
"""

import pathlib
import re
import shutil
import subprocess
import sys

root, work, build = (pathlib.Path(argument) for argument in sys.argv[1:4])


def run(command, **how):
    print(command, flush=True)
    return subprocess.run(command, shell=True, check=True, cwd=root, text=True, **how)


def configure(command, *options):
    """The configuring command of a document or script, into another folder."""
    assert "cmake --preset release" in command, command
    run(f"{command} -B {work} -D CMAKE_DISABLE_FIND_PACKAGE_PCL=ON {' '.join(options)}", stdout=subprocess.DEVNULL)


def require_target():
    """The target that the document builds."""
    target = re.search(r"--target (\w+)", install[2])[1]
    targets = run(f"cmake --build {work} --target help", stdout=subprocess.PIPE).stdout
    if not re.search(rf"^(\.\.\. )?{target}\b", targets, re.M):
        sys.exit(f"there is no target {target}")


demo = (root / "scripts/demo").read_text().replace("\\\n", " ")
demo = re.search(r"^ *(cmake --preset release[^>\n]*)", demo, re.M)[1]
page = (root / "docs/python.md").read_text().replace("\\\n", " ")
install = re.search(r"^\$ (cmake --preset release[^\n]*?) && (cmake --build build/release[^\n]*)", page, re.M)
for command in (demo, install[1]):
    shutil.rmtree(work, ignore_errors=True)
    configure(demo, "-D CMAKE_DISABLE_FIND_PACKAGE_pybind11=ON")
    configure(command, "-D CMAKE_DISABLE_FIND_PACKAGE_pybind11=OFF")
    require_target()

if list((build / "python").glob("cairn/_cairn*.so")):
    shown = re.search(r"^\$ (PYTHONPATH=build/release/python .*)\n(.*)", page, re.M)
    printed = run(shown[1].replace("build/release", str(build)), stdout=subprocess.PIPE).stdout
    if printed.strip() != shown[2]:
        sys.exit(f"docs/python.md says that this prints {shown[2]}; it prints {printed}")
