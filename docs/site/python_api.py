#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""python_api.py STUB STAGED [PYTHON FOLDER]: the page of the Python module.

Names, arguments and types come from the stub. The built module, which PYTHON imports from FOLDER, has the docstrings
and the defaults; without it the page has neither, and says so. Writes and prints STAGED/python_api.md.
"""

import ast
import html
import json
import os
import pathlib
import re
import subprocess
import sys
import textwrap

DOCUMENTATION = """
import inspect, json, cairn
found = {}
def keep(name, value):
    found[name] = [inspect.getdoc(value) or "", getattr(value, "__text_signature__", None) or ""]
for name in cairn.__all__:
    value = getattr(cairn, name)
    keep(name, value)
    if inspect.isclass(value):
        for member, inner in vars(value).items():
            keep(name + "." + member, getattr(inner, "__func__", inner))
found[""] = [cairn.__doc__, ""]
print(json.dumps(found))
"""


def documentation(python, folder):
    """{qualified name: [docstring, signature as text]} of the built module."""
    environment = {**os.environ, "PYTHONPATH": folder}
    run = subprocess.run([python, "-c", DOCUMENTATION], check=True, stdout=subprocess.PIPE, env=environment)
    return json.loads(run.stdout)


def defaults(signature):
    """{argument: default} of a signature such as "(map, *, k=20)"."""
    if not signature:
        return {}
    text = "lambda " + signature[1:-1].replace("$self", "self") + ": 0"
    arguments = ast.parse(text, mode="eval").body.args
    positional = arguments.posonlyargs + arguments.args
    known = zip(positional[len(positional) - len(arguments.defaults) :], arguments.defaults)
    known = [*known, *zip(arguments.kwonlyargs, arguments.kw_defaults)]
    return {argument.arg: ast.unparse(value) for argument, value in known if value is not None}


def plain(annotation):
    """A type for readers: without the names that the stub keeps for itself."""
    text = ast.unparse(annotation)
    text = text.replace("_Path", "path").replace("_Progress", "bool or callable").replace("_Floats", "NDArray[float64]")
    return re.sub(r"\b(np|ma)\.", "", text)


def argument(node, default, known):
    text = node.arg
    if node.annotation:
        text += ": " + plain(node.annotation)
    if default is not None:
        value = ast.unparse(default)
        text += " = " + known.get(node.arg, value) if value == "..." else f" = {value}"
    return text


def signature(node, name, known):
    args = node.args
    positional = args.posonlyargs + args.args
    missing = [None] * (len(positional) - len(args.defaults))
    parts = [argument(a, d, known) for a, d in zip(positional, [*missing, *args.defaults]) if a.arg != "self"]
    if args.kwonlyargs:
        parts.append("*")
        parts += [argument(a, d, known) for a, d in zip(args.kwonlyargs, args.kw_defaults)]
    result = "" if name.endswith("__init__") or node.returns is None else " -> " + plain(node.returns)
    short = f"({', '.join(parts)}){result}"
    if len(short) < 90:
        return short
    return "(\n" + "".join(f"    {part},\n" for part in parts) + f"){result}"


def text_of(doc):
    """A docstring as HTML; columns that were aligned by hand stay so."""
    parts = []
    for paragraph in re.split(r"\n\s*\n", doc.strip("\n")):
        if not paragraph.strip():
            continue
        code = paragraph.startswith("    ")
        paragraph = textwrap.dedent(paragraph)
        escaped = html.escape(paragraph, quote=False)
        escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
        if code or re.search(r"\S   *\S", paragraph):
            parts.append(f'<pre class="fragment">{escaped}</pre>')
        else:
            parts.append(f"<p>{escaped}</p>")
    return "\n".join(parts)


class Page:
    def __init__(self, docs):
        self.docs = docs

    def doc(self, name):
        return self.docs.get(name, ["", ""])[0]

    def function(self, node, name, shown):
        known = defaults(self.docs.get(name, ["", ""])[1])
        code = html.escape(shown + signature(node, name, known), quote=False)
        mark = f' id="python_api_{name}"' if "." in name else ""
        doc = self.doc(name)
        # The docstring that Python gives every object does not describe this one.
        if name.endswith("__") and doc.startswith("Initialize self"):
            doc = ""
        return f'<pre class="fragment signature"{mark}>{code}</pre>\n{text_of(doc)}\n'

    def class_(self, node):
        bases = [ast.unparse(base) for base in node.bases]
        page = text_of(self.doc(node.name))
        if bases:
            page += f"<p>Is a {' and a '.join(f'<code>{base}</code>' for base in bases)}.</p>\n"
        rows, functions = [], ""
        for item in node.body:
            if isinstance(item, ast.AnnAssign):
                rows.append((item.target.id, plain(item.annotation), ""))
                continue
            if not isinstance(item, ast.FunctionDef) or item.name == "_repr_html_":
                continue
            name = f"{node.name}.{item.name}"
            decorators = {ast.unparse(decorator) for decorator in item.decorator_list}
            if "property" in decorators:
                rows.append((item.name, plain(item.returns), self.doc(name)))
            elif item.name == "__init__":
                if "Error" not in node.name:
                    functions += self.function(item, name, node.name)
            elif item.name == "__len__":
                functions += f'<pre class="fragment signature">len({node.name.lower()}) -&gt; int</pre>\n'
            elif item.name == "__getitem__":
                functions += f'<pre class="fragment signature">{node.name.lower()}[index]</pre>\n'
            elif not item.name.startswith("__"):
                shown = f"{node.name}.{item.name}" if "staticmethod" in decorators else item.name
                functions += self.function(item, name, shown)
        page += functions
        if rows:
            page += '<table class="markdownTable entries"><tr><th>property</th><th>type</th><th></th></tr>\n'
            for name, kind, doc in rows:
                kind = html.escape(kind)
                page += f'<tr id="python_api_{node.name}.{name}"><td><code>{name}</code></td>'
                page += f"<td><code>{kind}</code></td><td>{text_of(doc)}</td></tr>\n"
            page += "</table>\n"
        return page


def main():
    stub, staged = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    docs = documentation(*sys.argv[3:5]) if len(sys.argv) > 3 else {}
    tree = ast.parse(stub.read_text(encoding="utf-8"))
    page = Page(docs)
    text = "# Python reference {#python_api}\n\n"
    if docs:
        text += f"\\htmlonly[block]\n{text_of(docs[''][0])}\n\\endhtmlonly\n\n"
    else:
        text += "From the type stubs alone: the module was not built, so descriptions and defaults are missing.\n\n"
    for heading, kind, body in (("Functions", ast.FunctionDef, lambda n: page.function(n, n.name, f"cairn.{n.name}")),
                                ("Classes", ast.ClassDef, page.class_)):
        text += f"## {heading} {{#python_api_{heading.lower()}}}\n\n"
        for node in tree.body:
            if isinstance(node, kind):
                text += f"### {node.name} {{#python_api_{node.name}}}\n\n"
                text += f"\\htmlonly[block]\n{body(node)}\n\\endhtmlonly\n\n"
    file = staged / "python_api.md"
    file.write_text(text, encoding="utf-8")
    print(file)


if __name__ == "__main__":
    main()
