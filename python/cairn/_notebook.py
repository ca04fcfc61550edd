# SPDX-License-Identifier: BSD-3-Clause
"""Shows a report in a notebook or browser."""


def _in_notebook():
    try:
        from IPython import get_ipython
    except ImportError:
        return False
    shell = get_ipython()
    return shell is not None and "IPKernelApp" in shell.config


def show(report):
    if _in_notebook():
        from IPython.display import display

        display(report)
        return
    import pathlib
    import tempfile
    import webbrowser

    path = pathlib.Path(tempfile.mkdtemp(prefix="cairn-")) / "report.html"
    report.write(path)
    webbrowser.open(path.as_uri())
