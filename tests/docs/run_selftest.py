#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Shows that tests/docs/run sees documents that print something else than their commands."""

import os
import pathlib
import subprocess
import sys
import tempfile

RUN = pathlib.Path(__file__).parent / "run"


def run(text, full=True):
    """Exit code and report of a document with this console block."""
    with tempfile.TemporaryDirectory() as folder:
        document = pathlib.Path(folder) / "page.md"
        document.write_text(f"# Page\n\n```console\n{text}```\n\n```sh\n$ false\n```\n")
        environment = {k: v for k, v in os.environ.items() if k not in ("CAIRN_DATA", "CAIRN_TEST_FULL")}
        if full:
            environment["CAIRN_TEST_FULL"] = "1"
        result = subprocess.run([RUN, document, "/usr/bin", folder], env=environment, stdout=subprocess.PIPE, text=True)
        return result.returncode, result.stdout


def check(name, text, passes, **how):
    code, report = run(text, **how)
    if (code == 0) != passes:
        print(f"FAILED: {name}: exit code {code}\n{report}")
        return 1
    return 0


def prints(actual, expected):
    return f"$ printf '{actual}'\n{expected}"


failed = sum([
    check("a command alone", "$ true\n", True),
    check("a command that fails", "$ false\n", False),
    check("a pipe that fails", "$ false | cat\n", False),
    check("no command", "", False),
    check("a continued command", "$ printf \\\n  '1 map\\n'\n1 map\n", True),
    check("the next command finds the files", "$ echo 7 > a\n$ cat a\n7\n", True),
    check("true output", prints("merged 2 maps\\n", "merged 2 maps\n"), True),
    check("stderr", "$ echo remark >&2\nremark\n", True),
    check("other words", prints("merged 2 maps\\n", "joined 2 maps\n"), False),
    check("a missing line", prints("one\\n", "one\ntwo\n"), False),
    check("a line more", prints("one\\ntwo\\n", "one\n"), False),
    check("other blanks", prints("a    1\\n", "a 1\n"), True),
    check("a count of another map", prints("placed 3 of 3\\n", "placed 2 of 3\n"), False),
    check("a count nearby", prints("12,149 landmarks\\n", "12,150 landmarks\n"), True),
    check("a count too far", prints("12,500 landmarks\\n", "12,150 landmarks\n"), False),
    check("the last decimal", prints("0.29 mm\\n", "0.30 mm\n"), True),
    check("a decimal too far", prints("0.27 mm\\n", "0.30 mm\n"), False),
    check("a probability", prints("99.9993 %%\\n", "99.9994 %\n"), True),
    check("another probability", prints("99.99 %%\\n", "99.01 %\n"), False),
    check("a name with a number", prints("robot2\\n", "robot1\n"), False),
    check("seconds", prints("took 20.5 s and 17 ms\\n", "took 3 s and 900 ms\n"), True),
    check("any lines", prints("a\\nb\\nc\\n", "...\nc\n"), True),
    check("any lines, but not the last", prints("a\\nb\\nc\\n", "...\nd\n"), False),
    check("the rest of a line", prints("aligned: because of 7\\n", "aligned: because...\n"), True),
    check("another begin of a line", prints("rejected: because of 7\\n", "aligned: because...\n"), False),
    check("numbers of what is shortened", "$ echo --duration 2 > a\n$ cat a\n--duration 3\n", True, full=False),
    check("words of what is shortened", "$ echo --duration 2 > a\n$ cat a\n--seconds 2\n", False, full=False),
    check("numbers of what is not shortened", "$ echo 5 > a\n$ cat a\n6\n", False, full=False),
])
sys.exit(1 if failed else 0)
