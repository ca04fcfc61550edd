#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_workflows.py ROOT: each script and preset that a workflow of ROOT/.github/workflows names exists, and each
workflow builds through the scripts of the repository."""

import json
import os
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
presets = {one["name"] for one in json.loads((root / "CMakePresets.json").read_text())["configurePresets"]}
wrong = []
used = set()
workflows = sorted((root / ".github/workflows").glob("*.yml"))
for workflow in workflows:
    for number, line in enumerate(workflow.read_text().splitlines(), 1):
        for script in re.findall(r"(?:^|[\s\"'&;])((?:scripts|packaging|studies|tests|\.ci)/[\w./-]+)", line.split("#")[0]):
            used.add(script)
            if not os.access(root / script, os.X_OK):
                wrong.append(f"{workflow.name}:{number}: there is no program {script}")
        for preset in re.findall(r"--preset[ =](\w+)", line):
            if preset not in presets:
                wrong.append(f"{workflow.name}:{number}: there is no preset {preset}")
if not {".ci/run", "scripts/test_library", "scripts/docs"} <= used:
    wrong.append(f"the workflows run no more than {sorted(used)}")
print(f"{len(workflows)} workflows, {len(used)} scripts")
sys.exit("\n".join(wrong) or 0)
