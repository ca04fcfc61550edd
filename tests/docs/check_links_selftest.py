#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_links.py passes folders without fault, and names each kind of broken link in others."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).parent / "check_links.py"


class CheckLinks(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def check(self, mode, files):
        for name, text in files.items():
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        run = subprocess.run([sys.executable, CHECK, mode, self.folder], capture_output=True, text=True)
        return run.returncode, run.stdout

    def assert_passes(self, mode, files, links):
        code, output = self.check(mode, files)
        self.assertEqual(code, 0, output)
        self.assertIn(f"{links} links", output)

    def assert_breaks(self, mode, files, *complaints):
        code, output = self.check(mode, files)
        self.assertEqual(code, 1, output)
        for complaint in complaints:
            self.assertIn(complaint, output)
        self.assertIn(f" {len(complaints)} broken", output)

    def test_passes_markdown_without_fault(self):
        self.assert_passes("markdown", {
            "README.md": "# A\n[a page](docs/page.md#what-cant-be-said-c), [net](https://example.org/x)\n## A\n",
            "docs/page.md": "# P\n## What can't `be` said, C++?\n[up](../README.md#a-1) ![p](p.svg)\n",
            "docs/p.svg": "<svg/>",
        }, 4)

    def test_sees_broken_links_of_markdown(self):
        self.assert_breaks("markdown", {
            "README.md": "# A\n[no file](docs/none.md) [no anchor](#b) ![no picture](p.png)\n\n",
            "page.md": "[other anchor](README.md#c) [out](../../x.md) [by name][missing]\n",
        }, "README.md: docs/none.md", "README.md: #b", "README.md: p.png", "page.md: README.md#c",
            "page.md: ../../x.md", "page.md: [missing]")

    def test_reads_no_links_in_code(self):
        self.assert_passes("markdown", {
            "a.md": "# A\n[here](#a)\n```\n[x](none.md)\n# B\n```\n`[x](none.md)` and ``[`x`](none.md)``\n",
        }, 1)

    def test_takes_no_heading_from_code(self):
        self.assert_breaks("markdown", {"a.md": "[x](#b)\n```\n# B\n```\n"}, "a.md: #b")

    def test_fails_if_there_is_nothing_to_check(self):
        self.assertEqual(self.check("markdown", {"a.md": "no link\n"})[0], 1)

    def test_passes_a_site_without_fault(self):
        self.assert_passes("site", {
            "index.html": '<a href="b.html#x">b</a><img src="i/p.svg"><a href="https://example.org">net</a>',
            "b.html": '<p id="x"></p><a href="#x">x</a>',
            "i/p.svg": "<svg/>",
            "navtreedata.js": 'var T = [["B", "b.html#x", null]];',
        }, 5)

    def test_sees_broken_links_of_a_site(self):
        self.assert_breaks("site", {
            "index.html": '<a class="el" href="none.html">x</a><a href="b.html#y">y</a><img alt="" src="p.png">',
            "b.html": '<p id="x"></p>',
            "navtreedata.js": 'var T = [["B", "b.html#z", null]];',
            "search/all_0.js": "var d = ['../c.html'];",
            "s.css": "a { background: url(q.png) }",
        }, "none.html", "b.html#y", "p.png", "b.html#z", "../c.html", "q.png")

    def test_sees_what_a_site_fetches_from_the_network(self):
        self.assert_breaks("site", {
            "index.html": '<a href="#a" id="a">x</a><script src="https://example.org/m.js"></script>'
                          '<link rel="stylesheet" href="//example.org/s.css">',
            "s.css": "@import 'https://example.org/f.css';",
        }, "https://example.org/m.js: is fetched", "//example.org/s.css: is fetched",
            "https://example.org/f.css: is fetched")


if __name__ == "__main__":
    unittest.main()
