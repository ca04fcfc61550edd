#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_calls.py TOOL DOCUMENT: does each call that docs/which_call.md names exist?

Commands: their verb and options are in the tool's help. Headers exist, and the functions and classes beside them are
declared there. Python: functions, methods and keywords are in the type stubs.
"""

import ast
import functools
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


@functools.cache
def help_of(tool, words):
    run = subprocess.run([tool, *words, "--help-all"], capture_output=True, text=True)
    return run.stdout if run.returncode == 0 else ""


def wrong_with_command(tool, code):
    words = code.split()[1:]
    verb = []
    while words and re.search(rf"^  {re.escape(words[0])}  ", help_of(tool, tuple(verb)).partition("\nVerbs:")[2], re.M):
        verb.append(words.pop(0))
    if not verb:
        return "no such verb"
    listed = help_of(tool, tuple(verb))
    for option in re.findall(r"(?<!\S)--?[a-z][a-z-]*", " ".join(words)):
        if not re.search(rf"^  (?:-\w, )?{re.escape(option)}[ ,\n]", listed, re.M):
            return f"cairn {' '.join(verb)} has no option {option}"
    return None


def header_text(path):
    places = [ROOT / "src" / path, ROOT / path.removeprefix("cairn/")]
    return next((place.read_text(encoding="utf-8") for place in places if place.is_file()), None)


def is_declared(code, text):
    parts = [part for part in code.removesuffix("()").split("::") if part not in ("cairn", "pcl_adapter")]
    names = [rf"\b{part}\b" for part in parts]
    names[-1] += r"\(" if code.endswith("()") else ""
    return all(re.search(name, text) for name in names)


def wrong_with_cpp(cell, headers_above):
    """A cell such as "`align()` in `cairn/alignment/align.hpp`"; what has no header is in one above in the document."""
    stated = dict(re.findall(r"`([^`]+)` in `([^`]+\.hpp)`", cell))
    for code, path in stated.items():
        text = header_text(path)
        if text is None:
            return f"there is no {path}"
        if not is_declared(code, text):
            return f"{code} is not in {path}"
    headers_above += stated.values()
    for code in re.findall(r"`([^`]+)`", cell):
        if code not in stated and code not in stated.values():
            if not any(is_declared(code, header_text(path)) for path in headers_above):
                return f"{code} is in no header named so far"
    return None


class Stubs:
    def __init__(self):
        tree = ast.parse((ROOT / "python/cairn/__init__.pyi").read_text(encoding="utf-8"))
        self.functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
        self.classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}

    def member(self, cls, name):
        body = self.classes[cls].body if cls in self.classes else []
        return next((item for item in body if isinstance(item, ast.FunctionDef) and item.name == name), None)

    def wrong_with(self, node, scope=None):
        """An expression; gives the name of its class, or raises LookupError with what is wrong."""
        if isinstance(node, ast.Call):
            function = self.find(node.func)
            arguments = function.args.args + function.args.kwonlyargs
            for keyword in node.keywords:
                if keyword.arg not in {argument.arg for argument in arguments}:
                    raise LookupError(f"{ast.unparse(node.func)} has no keyword {keyword.arg}")
            if function.name == "__init__":
                return ast.unparse(node.func).split(".")[-1]
            return ast.unparse(function.returns)
        return ast.unparse(self.find(node).returns)

    def find(self, node):
        name = node.attr
        owner = ast.unparse(node.value)
        if owner == "cairn":
            found = self.functions.get(name) or self.member(name, "__init__")
        else:
            cls = owner.removeprefix("cairn.")
            cls = cls if cls in self.classes else self.wrong_with(node.value)
            found = self.member(cls, name)
        if found is None:
            raise LookupError(f"there is no {owner}.{name}")
        return found


def main():
    tool, document = sys.argv[1:]
    stubs, failures, calls, headers = Stubs(), [], 0, []
    for number, line in enumerate(pathlib.Path(document).read_text(encoding="utf-8").split("\n"), 1):
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) < 3 or cells[0] in ("task", "---"):
            continue
        wrong = [wrong_with_cpp(cells[1], headers)]
        calls += len(re.findall("`", cells[1])) // 2
        for code in re.findall(r"`([^`]+)`", " ".join(cells[2:])):
            calls += 1
            if code.startswith("cairn "):
                wrong.append(wrong_with_command(tool, code))
            elif re.match(r"cairn\.|[A-Z]", code):
                try:
                    stubs.wrong_with(ast.parse(code, mode="eval").body)
                except LookupError as error:
                    wrong.append(str(error))
        failures += [f"{document}:{number}: {one}" for one in wrong if one]
    print("\n".join([*failures, f"{calls} calls, {len(failures)} wrong"]))
    sys.exit(1 if failures or not calls else 0)


if __name__ == "__main__":
    main()
