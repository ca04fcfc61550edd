#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_samples.py ROOT BUILD: README's C++ sample is examples/align_two_maps.cpp, which is compiled, also against an
installed Cairn; its Python sample runs and aligns, where BUILD has the module."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

root, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
readme = (root / "README.md").read_text()


def sample(language):
    return re.search(rf"^```{language}\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)[1]


program = (root / "examples/align_two_maps.cpp").read_text()
if not program.endswith(sample("cpp")) or "int main" not in sample("cpp"):
    sys.exit("README's C++ sample is not examples/align_two_maps.cpp")
if not list((build / "python").glob("cairn/_cairn*.so")):
    print("skipped: the Python module is not built")
    sys.exit(77)
with tempfile.TemporaryDirectory() as folder:
    subprocess.run([build / "bin/cairn", "demo", "--synthetic", "--save", folder], check=True, stdout=subprocess.DEVNULL)
    cache = (build / "CMakeCache.txt").read_text()
    python = re.search(r"^_Python_EXECUTABLE:\w+=(.+)$", cache, re.MULTILINE)
    printed = subprocess.run([python[1] if python else "python3", "-c", sample("python")], check=True, cwd=folder, text=True,
                             stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(build / "python")}).stdout
    if not printed.startswith("aligned 0.99"):
        sys.exit(f"README's Python sample prints {printed}")
