#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""options.py TOOL STAGED: pages of every verb and option, from the help texts that the tool's parser makes.

Writes STAGED/options.md and a page for each verb; prints their names in the order of the navigation.
"""

import html
import pathlib
import re
import subprocess
import sys

INDENT = 28  # of descriptions in the help


def help_of(tool, words):
    return subprocess.run([tool, *words, "--help-all"], check=True, capture_output=True, encoding="utf-8").stdout


def entries(lines):
    """[(name, description)] of indented lines as the tool's help formatter writes them."""
    found = []
    for line in lines:
        if line.startswith(" " * INDENT):
            found[-1][1] = f"{found[-1][1]} {line.strip()}".strip()
        elif line[INDENT - 2 : INDENT] == "  ":
            found.append([line[:INDENT].strip(), line[INDENT:].strip()])
        else:
            found.append([line.strip(), ""])
    return found


def blocks(text):
    """Pairs of a heading ("Options", "Verbs", ..., or "") and the lines under it."""
    found = [["", []]]
    for line in text.rstrip("\n").split("\n"):
        heading = re.fullmatch(r"([A-Z][\w ,()/-]*):", line)
        if heading:
            found.append([heading[1], []])
        elif not line and found[-1][1]:
            found.append(["", []])
        elif line:
            found[-1][1].append(line)
    return [block for block in found if block[1]]


def verbs(text):
    return dict(entry for heading, lines in blocks(text) if heading == "Verbs" for entry in entries(lines))


def table(lines, prefix):
    rows = []
    for name, description in entries(lines):
        option = re.search(r"--[a-z][a-z-]*", name)
        mark = f' id="{prefix}{option[0]}"' if option else ""
        rows.append(
            f"<tr{mark}><td><code>{html.escape(name)}</code></td><td>{html.escape(description)}</td></tr>"
        )
    return '<table class="markdownTable entries">\n' + "\n".join(rows) + "\n</table>"


def body(text, prefix):
    """A help text as HTML, without its verbs."""
    parts = []
    for heading, lines in blocks(text):
        if heading == "Verbs":
            continue
        if heading:
            parts.append(f"<h3>{html.escape(heading)}</h3>")
        if heading and all(line.startswith("  ") for line in lines):
            parts.append(table(lines, prefix))
        elif not parts:
            parts.append(f"<p>{html.escape(' '.join(lines))}</p>")
        else:
            shown = html.escape("\n".join(lines))
            parts.append(f'<pre class="fragment">{shown}</pre>')
    return "\\htmlonly[block]\n" + "\n".join(parts) + "\n\\endhtmlonly\n"


def main():
    tool, staged = sys.argv[1], pathlib.Path(sys.argv[2])
    pages = {}
    top = help_of(tool, [])
    rows = []
    for verb, summary in verbs(top).items():
        text = help_of(tool, [verb])
        page = f"# cairn {verb} {{#options_{verb}}}\n\n" + body(text, verb)
        for part in verbs(text):
            page += f"\n## cairn {verb} {part} {{#options_{verb}-{part}}}\n\n"
            page += body(help_of(tool, [verb, part]), f"{verb}-{part}")
        pages[f"options_{verb}"] = page
        rows.append(f"- \\subpage options_{verb} : {html.escape(summary, quote=False)}")
    if not rows:
        sys.exit(f"{tool}: its help lists no verbs")
    version = subprocess.run([tool, "--version"], check=True, capture_output=True, encoding="utf-8").stdout.strip()
    index = "# Every verb and option {#options}\n\n"
    index += f"What `cairn --help` and `cairn VERB --help-all` print, of {version}.\n\n" + "\n".join(rows) + "\n\n" + body(top, "")
    for name, page in {"options": index, **pages}.items():
        file = staged / f"{name}.md"
        file.write_text(page, encoding="utf-8")
        print(file)


if __name__ == "__main__":
    main()
