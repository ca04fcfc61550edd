#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_report_format.py ROOT: does docs/report_format.md name the keys that report/ writes and the viewer reads?

That page is the schema of reports. A key that the writer and the viewer do not share, or that the page does not name, is
printed with where it is from.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(sys.argv[1])


def keys(path, *patterns):
    text = (ROOT / path).read_text()
    return {key for pattern in patterns for key in re.findall(pattern, text)}


written = keys("src/cairn/report/writer.cpp", r'\{"([a-z_]+)", ', r'json\["([a-z_]+)"\]', r'\{"([a-z_]+)",\n')
read = keys("viewer/src/document/parse.ts", r'get\(\s*"([a-z_]+)"', r'perStep\("([a-z_]+)"\)')
read |= keys("viewer/src/document/buffers.ts", r'get\(\s*"([a-z_]+)"')
read |= {"system", "processor", "threads"}  # of the machine, shown as they are
described = keys("docs/report_format.md", r'`"?([a-z_]+)"?`', r'"([a-z_]+)"', r"`([a-z_]+) = ")
wrong = [f"{key}: written, but the viewer does not read it" for key in sorted(written - read)]
wrong += [f"{key}: read by the viewer, but never written" for key in sorted(read - written)]
wrong += [f"{key}: not in docs/report_format.md" for key in sorted((written | read) - described)]
print("\n".join(wrong) if wrong else f"{len(written)} keys of reports are written, read and described")
sys.exit(bool(wrong))
