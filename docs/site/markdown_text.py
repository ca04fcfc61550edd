# SPDX-License-Identifier: BSD-3-Clause
"""Headings, anchors and links of Markdown, as GitHub reads them."""

import re

LINK = re.compile(r"(!?)\[((?:[^\[\]`]|`[^`]*`|\[[^\[\]]*\])*)\]\(([^()\s]+)\)")
FENCE = re.compile(r"^([ \t]*)(```+)(.*?)^\1```+[ \t]*$", re.M | re.S)
CODE = re.compile(r"(?<!`)(`+)(?!`)(.+?)(?<!`)\1(?!`)", re.S)


def without_code(text):
    """The text with its code blanked out; lines stay where they are."""

    def blank(match):
        return re.sub(r"[^\n]", " ", match[0])

    return CODE.sub(blank, FENCE.sub(blank, text))


def slug(heading):
    """The anchor that GitHub gives a heading."""
    words = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", words).replace(" ", "-")


def headings(text):
    """{line number, from 0: (level, words, anchor)} of all headings outside code blocks."""
    found, used = {}, {}
    lines = FENCE.sub(lambda match: "\n" * match[0].count("\n"), text).split("\n")
    for number, line in enumerate(lines):
        match = re.match(r"(#{1,6}) +(.*?)(?: +#+)?\s*$", line)
        if match:
            anchor = slug(match[2])
            repeated = used.get(anchor, 0)
            used[anchor] = repeated + 1
            found[number] = (len(match[1]), match[2], f"{anchor}-{repeated}" if repeated else anchor)
    return found
