#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_links.py markdown ROOT: do links between the Markdown files of the repository lead somewhere?
check_links.py site FOLDER: do those of the site that scripts/docs made, and does it need no network?

Checks files and anchors, and looks up nothing in any network. Prints each broken link with its file.
"""

import functools
import html
import os
import pathlib
import re
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "docs" / "site"))
sys.dont_write_bytecode = True

from markdown_text import headings, without_code  # noqa: E402

EXTERNAL = re.compile(r"^(?:[a-z][a-z0-9+.-]*:|//)", re.I)


def files_below(root, suffixes):
    for folder, folders, files in os.walk(root):
        folders[:] = sorted(name for name in folders if name not in ("build", "out", "node_modules", ".git"))
        for name in sorted(files):
            if name.endswith(suffixes):
                yield pathlib.Path(folder, name)


@functools.cache
def text_of(file):
    return file.read_text(encoding="utf-8", errors="replace")


@functools.cache
def anchors_of(file):
    text = text_of(file)
    if file.suffix == ".md":
        marks = {anchor for _, _, anchor in headings(text).values()}
        return marks | set(re.findall(r"<a (?:id|name)=\"([^\"]+)\"", without_code(text)))
    return {html.unescape(mark) for mark in re.findall(r"\s(?:id|name)=\"([^\"]*)\"", text)}


def complaint(file, link, root):
    """What is wrong with a link of a file, or None."""
    if EXTERNAL.match(link):
        return None
    path, _, anchor = link.partition("#")
    path = urllib.parse.unquote(path.split("?")[0])
    target = (file.parent / path).resolve() if path else file
    if not target.is_relative_to(root):
        return "leads out of the folder"
    if not target.exists():
        return "there is no such file"
    anchor = urllib.parse.unquote(anchor)
    if anchor and target.suffix in (".md", ".html") and anchor not in anchors_of(target):
        return f"{target.relative_to(root)} has no anchor #{anchor}"
    return None


def links_of_markdown(file):
    text = without_code(text_of(file))
    yield from re.findall(r"\]\(([^()\s]+)(?:\s+\"[^\"]*\")?\)", text)
    yield from re.findall(r"^ {0,3}\[[^\]]+\]:\s+(\S+)", text, re.M)
    yield from re.findall(r"<(?:a|img)\s[^>]*?(?:href|src)=\"([^\"]+)\"", text)
    for name in re.findall(r"\]\[([^\]]+)\]", text):
        if not re.search(rf"^ {{0,3}}\[{re.escape(name)}\]:", text, re.M | re.I):
            yield f"[{name}]"


def links_of_site(file):
    text = text_of(file)
    if file.suffix == ".html":
        text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
        for link in re.findall(r"<[^>]+?\s(?:href|src)=\"([^\"]*)\"", text):
            link = html.unescape(link)
            # What a script puts in place when it runs.
            if link and not link.startswith("javascript:"):
                yield link
    elif file.suffix == ".js" and not file.name.startswith("navtreeindex"):
        # The navigation and the index of the search are lists of links; navtreeindex is only looked up in.
        for link in re.findall(r"[\"']([\w./-]+\.html(?:#[^\"']*)?)[\"']", text):
            yield link
    elif file.suffix == ".css":
        yield from re.findall(r"url\([\"']?([^\"')]+)[\"']?\)", text)


def fetched_from_network(file):
    text = text_of(file)
    yield from re.findall(r"<(?:script|img|iframe|source)\s[^>]*?src=\"((?:https?:)?//[^\"]+)\"", text)
    yield from re.findall(r"<link\s[^>]*?href=\"((?:https?:)?//[^\"]+)\"", text)
    yield from re.findall(r"(?:@import\s+|url\()[\"']?((?:https?:)?//[^\"')]+)", text)


def check(root, files, links_of):
    count, broken = 0, 0
    for file in files:
        for link in links_of(file):
            count += 1
            wrong = complaint(file, link, root)
            if wrong:
                broken += 1
                print(f"{file.relative_to(root)}: {link}: {wrong}")
    return count, broken


def main():
    if len(sys.argv) != 3 or sys.argv[1] not in ("markdown", "site"):
        sys.exit(__doc__)
    root = pathlib.Path(sys.argv[2]).resolve()
    if sys.argv[1] == "markdown":
        files = list(files_below(root, (".md",)))
        count, broken = check(root, files, links_of_markdown)
    else:
        # Links of scripts are seen from the page that loads them, which is in the folder above for the search's.
        files = list(files_below(root, (".html", ".js", ".css")))
        count, broken = check(root, files, links_of_site)
        for file in files:
            for link in fetched_from_network(file):
                broken += 1
                print(f"{file.relative_to(root)}: {link}: is fetched from the network")
    print(f"{count} links in {len(files)} files, {broken} broken")
    if count == 0 or broken:
        sys.exit(1)


if __name__ == "__main__":
    main()
