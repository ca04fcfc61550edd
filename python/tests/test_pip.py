# SPDX-License-Identifier: BSD-3-Clause
"""test_pip.py SOURCE BUILD PYBIND11: `pip install` of a source distribution into a virtual environment, with the module
of a build by this version of pybind11."""

import os
import pathlib
import shutil
import subprocess
import sys
import tarfile
import tempfile

# What a source distribution needs, all of it.
PARTS = (
    "CMakeLists.txt", "LICENSE", "README.md", "THIRD_PARTY", "pyproject.toml", "setup.py", "adapters", "cmake",
    "packaging", "python", "src", "viewer")

PROGRAM = """
import sys, cairn
assert cairn.__file__.startswith(sys.prefix), cairn.__file__
pair = cairn.synthetic_pair(landmarks=500)
result = cairn.align(pair.source, pair.target)
print(cairn.__version__, result.verdict)
"""

METADATA = """
import importlib.metadata, pathlib
cairn = importlib.metadata.distribution("cairn")
print(*(name for name in cairn.requires if name.startswith("numpy")))
print(*(path.name for path in cairn.files if path.name.startswith(("LICENSE", "THIRD_PARTY"))))
"""

WITH_NUMPY_2 = """
import sys, types
sys.modules["numpy"] = types.ModuleType("numpy")
sys.modules["numpy"].__version__ = "2.1.0"
try:
    import cairn
except ImportError as error:
    print(error)
"""


def files_in(folder):
    return {
        path.relative_to(folder) for path in folder.rglob("*") if path.is_file() and path.suffix not in (".pyc", ".pyo")}


def source_distribution(source, folder):
    """The unpacked source distribution of a copy of the source tree."""
    tree = folder / "tree"
    tree.mkdir()
    for name in PARTS + ("MANIFEST.in",):
        if (source / name).is_dir():
            shutil.copytree(source / name, tree / name)
        else:
            shutil.copy2(source / name, tree)
    expected = files_in(tree)
    subprocess.run([sys.executable, "setup.py", "-q", "sdist", "-d", folder], cwd=tree, check=True)
    (archive,) = folder.glob("cairn-*.tar.gz")
    with tarfile.open(archive) as file:
        file.extractall(folder)
    unpacked = folder / archive.name.removesuffix(".tar.gz")
    left_out = expected - files_in(unpacked)
    assert not left_out, f"the source distribution leaves out {sorted(map(str, left_out))}"
    return unpacked


def main(source, build, pybind11):
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
        tree = source_distribution(source, folder)
        venv = folder / "venv"
        subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", venv], check=True)
        python = venv / "bin" / "python"
        subprocess.run(
            [python, "-m", "pip", "install", "--no-build-isolation", "--no-index", "--no-deps", "-q", tree],
            env=environment, check=True)

        def output(program):
            return subprocess.run(
                [python, "-c", program], env=environment, cwd=folder, check=True, stdout=subprocess.PIPE,
                text=True).stdout

        print(output(PROGRAM))
        numpy, notices = output(METADATA).splitlines()
        is_old = tuple(map(int, pybind11.split(".")[:2])) < (2, 12)
        if shutil.which("pkg-config"):
            assert ("<2" in numpy) == is_old, numpy
        assert {"LICENSE", "THIRD_PARTY"} <= set(notices.split()), notices
        viewer = pathlib.Path(build) / "viewer" / "page" / "THIRD_PARTY_VIEWER.txt"
        assert ("THIRD_PARTY_VIEWER.txt" in notices.split()) == viewer.exists(), notices
        if is_old:
            refusal = output(WITH_NUMPY_2)
            assert "NumPy 2.1.0; expected NumPy below 2" in refusal and "'numpy<2'" in refusal, refusal


if __name__ == "__main__":
    main(*sys.argv[1:])
