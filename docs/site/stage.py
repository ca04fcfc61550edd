#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""stage.py ROOT STAGED SITE: makes the Markdown pages ready for Doxygen.

Doxygen 1.9 knows neither the anchors that GitHub gives headings nor links to files that are no page. So each page is
copied to STAGED with explicit anchors and with links to what the site has; pictures and other files that pages link
to are copied to SITE. Prints the staged pages in the order of the navigation.
"""

import pathlib
import re
import shutil
import sys

from markdown_text import CODE, FENCE, LINK, headings

# Pages of docs/ that no line names follow by name, before the last two.
ORDER = """
README.md docs/tutorial.md docs/guide.md docs/which_call.md docs/concepts.md docs/from_*.md docs/method.md docs/evidence.md
docs/paper.md docs/study.md docs/experiments.md docs/performance.md docs/formats.md docs/report_format.md
docs/python.md docs/ros2.md docs/cluster.md docs/architecture.md docs/*.md CONTRIBUTING.md CHANGELOG.md
""".split()
HIGHLIGHTED = {"cpp", "python"}


def page_name(path):
    """Of the page in the site. Doxygen has names such as concepts.html for pages of its own."""
    return "index" if path.name == "README.md" else f"page_{path.stem.lower()}"


class Stage:
    def __init__(self, root, staged, site):
        self.root, self.staged, self.site = root, staged, site
        self.pages = list(dict.fromkeys(path for name in ORDER for path in sorted(root.glob(name))))

    def target(self, page, link):
        """Where a link of a page leads in the site."""
        if re.match(r"[a-z]+:", link):
            return link
        file, _, anchor = link.partition("#")
        to = (page.parent / file).resolve() if file else page
        if to in self.pages:
            name = page_name(to)
            return f"{name}.html#{name}_{anchor}" if anchor else f"{name}.html"
        if not to.is_file():
            sys.exit(f"{page.relative_to(self.root)}: there is no {link}")
        copy = pathlib.Path("files") / to.relative_to(self.root)
        if to.suffix not in (".png", ".svg"):
            copy = copy.with_name(copy.name + ".txt")  # which every browser shows
        (self.site / copy).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(to, self.site / copy)
        return copy.as_posix()

    def prose(self, page, text):
        """Text between code blocks, with the links of the site."""

        def link(match):
            picture, words, to = match.groups()
            to = self.target(page, to)
            return f'<img src="{to}" alt="{words}"/>' if picture else f"[{words}]({to})"

        # Doxygen takes an apostrophe for the end of code that one backtick opened.
        text = CODE.sub(lambda match: f"``{match[2]}``" if "'" in match[2] else match[0], text)
        return LINK.sub(link, text)

    def stage(self, page):
        text = page.read_text(encoding="utf-8")
        name = page_name(page)
        lines = text.split("\n")
        for number, (level, words, anchor) in headings(text).items():
            if level == 1:
                anchor = "mainpage" if name == "index" else name
            else:
                anchor = f"{name}_{anchor}"
            lines[number] = f"{'#' * level} {words} {{#{anchor}}}"
        text = "\n".join(lines)
        staged, end = "", 0
        for block in FENCE.finditer(text):
            staged += self.prose(page, text[end : block.start()])
            language, _, code = block[3].partition("\n")
            language = language if language in HIGHLIGHTED else "unparsed"
            staged += f"{block[1]}```{{.{language}}}\n{code}{block[1]}```"
            end = block.end()
        staged += self.prose(page, text[end:])
        file = self.staged / f"{name}.md"
        file.write_text(staged, encoding="utf-8")
        return file


def main():
    stage = Stage(*(pathlib.Path(argument).resolve() for argument in sys.argv[1:]))
    for page in stage.pages:
        print(stage.stage(page))


if __name__ == "__main__":
    main()
