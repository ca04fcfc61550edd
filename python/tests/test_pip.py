# SPDX-License-Identifier: BSD-3-Clause
"""test_pip.py SOURCE BUILD: `pip install` into a virtual environment, with the module of a build."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

PROGRAM = """
import sys, cairn
assert cairn.__file__.startswith(sys.prefix), cairn.__file__
pair = cairn.synthetic_pair(landmarks=500)
result = cairn.align(pair.source, pair.target)
print(cairn.__version__, result.verdict)
"""


def main(source, build):
    source = pathlib.Path(source)
    try:
        import ensurepip  # noqa: F401
        import setuptools  # noqa: F401
    except ImportError as error:
        print(f"SKIPPED: {error} (Debian: python3-venv, python3-setuptools)")
        return
    environment = {**os.environ, "CAIRN_BUILD": build}
    environment.pop("PYTHONPATH", None)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        tree = folder / "cairn"
        tree.mkdir()
        for file in ("CMakeLists.txt", "pyproject.toml", "setup.py"):
            shutil.copy2(source / file, tree)
        shutil.copytree(source / "python" / "cairn", tree / "python" / "cairn")
        venv = folder / "venv"
        subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", venv], check=True)
        python = venv / "bin" / "python"
        subprocess.run(
            [python, "-m", "pip", "install", "--no-build-isolation", "--no-index", "--no-deps", "-q", tree],
            env=environment, check=True)
        subprocess.run([python, "-c", PROGRAM], env=environment, cwd=folder, check=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
