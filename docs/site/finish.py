#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""finish.py SITE TAGS PAGE...: makes names in the code of pages links to what describes them.

`AlignOptions`, `align()` and `cairn/alignment/align.hpp` lead to the C++ reference (TAGS is Doxygen's tag file), on the
page of Python to the Python reference; `cairn align` and `cairn align --pairs` to the page of that verb. Also mends links of Doxygen 1.9 that lead nowhere.
"""

import html
import pathlib
import re
import sys
import xml.etree.ElementTree as xml

CODE = re.compile(r"<code>([^<]*)</code>")
# Links and headings stay as they are.
KEPT = re.compile(r"(<a [^>]*>.*?</a>|<h\d.*?</h\d>|<div class=\"toc\">.*?</ul>\s*</div>|<title>.*?</title>)", re.S)


def of_cpp(tags):
    targets = {}
    for compound in xml.parse(tags).getroot():
        kind, name, file = (compound.get("kind"), compound.findtext("name"), compound.findtext("filename"))
        if kind == "file":
            path = compound.findtext("path") + name
            targets[path] = file if file.endswith(".html") else file + ".html"
        elif kind in ("class", "struct", "concept"):
            shown = name.removeprefix("cairn::")
            targets[shown] = file
            for member in compound.findall("member"):
                if member.get("kind") in ("function", "variable"):
                    inner = f"{shown}::{member.findtext('name')}" + ("()" if member.get("kind") == "function" else "")
                    targets.setdefault(inner, f"{member.findtext('anchorfile')}#{member.findtext('anchor')}")
        elif kind in ("group", "namespace"):
            for member in compound.findall("member"):
                if member.get("kind") in ("function", "enumeration", "typedef"):
                    shown = member.findtext("name") + ("()" if member.get("kind") == "function" else "")
                    # Of overloads the first.
                    targets.setdefault(shown, f"{member.findtext('anchorfile')}#{member.findtext('anchor')}")
                    for value in member.findall("enumvalue"):
                        targets[f"{shown}::{value.text}"] = f"{value.get('file')}#{value.get('anchor')}"
    targets.update({f"cairn::{name}": target for name, target in targets.items() if "/" not in name})
    return targets


def of_marks(site, page, pattern):
    """{anchor: target} of the anchors of a page."""
    file = site / page
    if not file.is_file():
        return {}
    return {mark: f"{page}#{mark}" for mark in re.findall(rf'id="({pattern})"', file.read_text(encoding="utf-8"))}


def of_python(site):
    targets = {}
    for mark, target in of_marks(site, "python_api.html", r"python_api_[\w.]+").items():
        name = mark.removeprefix("python_api_")
        for shown in (name, f"{name}()", f"cairn.{name}", f"cairn.{name}()"):
            targets[shown] = target
    return targets


def of_tool(site):
    targets = {}
    for file in sorted(site.glob("options_*.html")):
        verb = file.stem.removeprefix("options_")
        targets[f"cairn {verb}"] = file.name
        for mark, target in of_marks(site, file.name, r"[a-z_-]+").items():
            words, dashes, option = mark.partition("--")
            if dashes and words.split("-")[0] == verb:
                targets[f"cairn {words.replace('-', ' ')} --{option}"] = target
            elif mark.startswith("options_"):
                targets["cairn " + mark.removeprefix("options_").replace("-", " ")] = target
    return targets


def replace(file, pattern, by):
    text = file.read_text(encoding="utf-8")
    changed = re.sub(pattern, lambda match: by(match, text), text)
    if changed != text:
        file.write_text(changed, encoding="utf-8")


def mend(site):
    """Links that Doxygen makes although what they lead to stands elsewhere, or nowhere."""
    place = {}
    for file in site.glob("group__*.html"):
        for mark in re.findall(r'id="(gg?a[0-9a-f]+)"', file.read_text(encoding="utf-8")):
            place[mark] = file.name
    for file in site.glob("*_8hpp.js"):  # the tree's functions of a header, which its module describes
        replace(file, r'"[^"#]*#(gg?a[0-9a-f]+)"', lambda m, _: f'"{place[m[1]]}#{m[1]}"' if m[1] in place else m[0])
    for file in site.glob("*.html"):  # sections that have private members only
        replace(
            file,
            r'<a href="#([a-z-]+)">[^<]*</a>(?: &#124;)?\s*',
            lambda m, text: m[0] if re.search(rf'(?:name|id)="{m[1]}"', text) else "",
        )


def breaking(code):
    """Code that a line may break after the parts of a path, not within an option."""
    code = re.sub(r"(?<=\w)(/|::)(?=\w)", r"\1<wbr>", code)
    return re.sub(r"(?<![\w-])--?[a-z][a-z-]*", r'<span class="option">\g<0></span>', code)


def main():
    site, tags = pathlib.Path(sys.argv[1]), sys.argv[2]
    mend(site)
    cpp, python, tool = of_cpp(tags), of_python(site), of_tool(site)
    for page in sys.argv[3:]:
        known = {**(python if page in ("page_python", "python_api") else cpp), **tool}
        # Elsewhere the Python reference is meant where the module is named.
        known.update({name: target for name, target in python.items() if name.startswith("cairn.")})

        def link(match):
            # `cairn align a.map` is that verb too, `align(source, target)` that function.
            words = html.unescape(match[1]).replace("cairn help ", "cairn ")
            target = known.get(words) or known.get(re.sub(r"\(.+$", "()", words))
            if not target and words.startswith("cairn "):
                target = known.get(" ".join(words.split()[:3])) or known.get(" ".join(words.split()[:2]))
            code = f"<code>{breaking(match[1])}</code>"
            if not target or target.split("#")[0] == f"{page}.html" or page.startswith("options"):
                return code
            return f'<a class="el" href="{target}">{code}</a>'

        file = site / f"{page}.html"
        parts = KEPT.split(file.read_text(encoding="utf-8"))
        parts[::2] = [CODE.sub(link, part) for part in parts[::2]]
        file.write_text("".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
