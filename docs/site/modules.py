#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""modules.py ROOT: the modules as groups of Doxygen's, in the order of the layers.

What each is for comes from the table in docs/architecture.md; a module that it lacks is an error.
"""

import pathlib
import re
import sys


def main():
    root = pathlib.Path(sys.argv[1])
    table = (root / "docs/architecture.md").read_text(encoding="utf-8")
    purposes = re.findall(r"^\| \d+ \| `(\w+)` \| (.*?) \|", table, re.M)
    pcl = re.search(r"^\| `adapters/pcl` \| (.*?) \|", table, re.M)
    if pcl:
        purposes.append(("pcl", pcl[1]))
    modules = {folder.name for folder in (root / "src/cairn").iterdir() if folder.is_dir()} | {"pcl"}
    missing = modules - {name for name, _ in purposes}
    if missing:
        sys.exit(f"docs/architecture.md: no row for {', '.join(sorted(missing))}")
    for name, purpose in purposes:
        purpose = re.sub(r"\*(`[^`]+`)\*", r"\1", purpose)
        print(f"/** @defgroup module_{name} {name}\n    @brief {purpose[0].upper()}{purpose[1:]}. */")


if __name__ == "__main__":
    main()
