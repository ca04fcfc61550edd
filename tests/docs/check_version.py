#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_version.py ROOT: CMakeLists.txt, CITATION.cff, README and CHANGELOG.md name one version and date."""

import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])


def found(file, pattern):
    match = re.search(pattern, (root / file).read_text(), re.MULTILINE)
    return match.groups() if match else sys.exit(f"{file}: nothing matches {pattern}")


(version,) = found("CMakeLists.txt", r"^project\(cairn VERSION ([\d.]+)")
cited = found("CITATION.cff", r"^version: (.+)\ndate-released: (.+)$")
released = found("CHANGELOG.md", r"^## (\d\S+) - (\S+)$")
shown = found("README.md", r"^ *version = \{(.+)\},\n *year *= \{(.+)\}$")
if cited != (version, released[1]) or released[0] != version or shown != (version, released[1][:4]):
    sys.exit(f"CMakeLists.txt has {version}, CITATION.cff {cited}, CHANGELOG.md {released}, README {shown}")
