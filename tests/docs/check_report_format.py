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


def shape_keys(path):
    """The members of object({...}) in the viewer's readers; `xLabel` is read from `x_label`."""
    text = re.sub(r"/\*.*?\*/", "", (ROOT / path).read_text(), flags=re.DOTALL)
    found = set()
    for start in re.finditer(r"\bobject\(\{|const kPose = \{", text):
        depth, part, parts = 1, "", []
        for character in text[start.end():]:
            depth += (character in "({[") - (character in ")}]")
            if depth == 0 or (depth == 1 and character == ","):
                parts.append(part.strip())
                part = ""
            else:
                part += character
            if depth == 0:
                break
        found |= {re.match(r"\w+", one).group() for one in parts if re.match(r"\w", one)}
    return {re.sub(r"[A-Z]", lambda letter: "_" + letter.group().lower(), key) for key in found}


writer = (ROOT / "src/cairn/report/writer.cpp").read_text()
writer = re.sub(r"(std::array|kKinds\[\] =) ?\{[^}]*\}", "", writer)  # lists of values, not of keys
written = set(re.findall(r'\{"([a-z_]+)",\s|json\["([a-z_]+)"\]', writer))
written = {key for pair in written for key in pair if key}
for struct in re.findall(r"^CAIRN_REPORT_STRUCT\(\w+,([^)]*)\)", writer, re.MULTILINE):
    written |= set(re.findall(r"\w+", struct))
read = keys("viewer/src/document/report.ts", r'get\(\s*"([a-z_]+)"')
read |= shape_keys("viewer/src/document/report.ts")
read |= keys("viewer/src/document/buffers.ts", r'get\(\s*"([a-z_]+)"')
read |= {"system", "processor", "threads"}  # of the machine, shown as they are
described = keys("docs/report_format.md", r'`"?([a-z_]+)"?`', r'"([a-z_]+)"', r"`([a-z_]+) = ")
wrong = [f"{key}: written, but the viewer does not read it" for key in sorted(written - read)]
wrong += [f"{key}: read by the viewer, but never written" for key in sorted(read - written)]
wrong += [f"{key}: not in docs/report_format.md" for key in sorted((written | read) - described)]
print("\n".join(wrong) if wrong else f"{len(written)} keys of reports are written, read and described")
sys.exit(bool(wrong))
