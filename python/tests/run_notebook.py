# SPDX-License-Identifier: BSD-3-Clause
"""Runs the code of a notebook, as Jupyter does cell by cell, without Jupyter: run_notebook.py NOTEBOOK."""

import ast
import json
import pathlib
import sys

try:
    import matplotlib  # noqa: F401
    import pandas  # noqa: F401
except ImportError as error:
    print(f"SKIPPED: {error.name} is not installed")
    sys.exit(0)

notebook = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
names = {"__name__": "__main__"}
cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
if not cells:
    sys.exit("the notebook has no code")
for number, cell in enumerate(cells, 1):
    tree = ast.parse(cell, f"cell {number}")
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, f"cell {number}", "exec"), names)
    if last is not None:
        shown = eval(compile(ast.Expression(last.value), f"cell {number}", "eval"), names)
        print(f"[{number}]", shown._repr_html_()[:200] if hasattr(shown, "_repr_html_") else repr(shown))
if any(cell["outputs"] or cell["execution_count"] for cell in notebook["cells"] if cell["cell_type"] == "code"):
    sys.exit("the notebook contains outputs, which would not stay true: clear them")
