# SPDX-License-Identifier: BSD-3-Clause
"""The stubs say of the module what is true, member by member."""

import ast
import inspect
import pathlib
import shutil
import subprocess
import unittest

import cairn

PACKAGE = pathlib.Path(cairn.__file__).parent
EXAMPLES = pathlib.Path(__file__).parent.parent / "examples"
TREE = ast.parse((PACKAGE / "__init__.pyi").read_text())
# What a build without a large library lacks.
OPTIONAL = {"merge", "MergeResult", "MergedMap", "Link", "simulate", "Simulation", "SimulatedFrame", "Odometry",
            "FrameReport", "MappedSequence", "map_sequence", "ImageLocator", "ImageLocation", "Atlas", "AtlasMap",
            "AtlasCommit", "AtlasRoute", "AtlasLinkResult", "AtlasOptimised", "AtlasCompaction", "AtlasSalvage",
            "Change", "ChangedPlace", "WorldDifference", "with_frames", "with_image_descriptors"}


def stub_parameters(function):
    """(positional names, keyword-only names)"""
    arguments = function.args
    positional = [a.arg for a in arguments.posonlyargs + arguments.args]
    return positional, [a.arg for a in arguments.kwonlyargs]


def true_parameters(function, is_method):
    text = getattr(function, "__text_signature__", None)
    if text is None:
        parameters = inspect.signature(function).parameters.values()
    else:
        lambda_ = ast.parse("lambda " + text[1:-1].replace("$self", "self") + ": 0", mode="eval").body
        return stub_parameters(lambda_)
    positional = [p.name for p in parameters if p.kind is not p.KEYWORD_ONLY]
    return positional, [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]


class Stubs(unittest.TestCase):
    def test_name_what_the_module_has(self):
        named = {node.name for node in TREE.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        has = set(cairn.__all__)
        self.assertEqual(has - named, set())
        self.assertEqual(named - has - OPTIONAL, set())

    def test_functions_take_what_they_say(self):
        for node in TREE.body:
            if isinstance(node, ast.FunctionDef) and hasattr(cairn, node.name):
                true = true_parameters(getattr(cairn, node.name), False)
                self.assertEqual(stub_parameters(node), true, node.name)

    def test_classes_have_the_members_that_they_say(self):
        for node in TREE.body:
            if not isinstance(node, ast.ClassDef) or not hasattr(cairn, node.name):
                continue
            cls = getattr(cairn, node.name)
            if issubclass(cls, Exception):
                continue
            members = {item.name: item for item in node.body if isinstance(item, ast.FunctionDef)}
            public = {name for name in vars(cls) if not name.startswith("_")}
            self.assertEqual({name for name in members if not name.startswith("_")}, public, node.name)
            for name, item in members.items():
                where = f"{node.name}.{name}"
                decorators = {getattr(d, "id", "") for d in item.decorator_list}
                is_property = isinstance(inspect.getattr_static(cls, name, None), property)
                self.assertEqual("property" in decorators, is_property, where)
                if is_property or name.startswith("__") and name != "__init__" or name == "_repr_html_":
                    continue
                stub = stub_parameters(item)
                self.assertEqual(stub, true_parameters(getattr(cls, name), True), where)

    def test_what_this_build_lacks_is_named_with_what_it_needs(self):
        with self.assertRaisesRegex(AttributeError, "no attribute 'mergers'$"):
            cairn.mergers
        for name in cairn._OPTIONAL:
            self.assertIn(name, OPTIONAL)
            with self.assertRaisesRegex(AttributeError, f"'{name}'; this build is without "):
                cairn.__getattr__(name)

    def test_everything_is_documented(self):
        for name in cairn.__all__:
            self.assertTrue(getattr(cairn, name).__doc__, name)

    @unittest.skipUnless(shutil.which("mypy"), "SKIPPED: mypy is not installed")
    def test_examples_are_typed(self):
        import os

        mypy = subprocess.run(
            ["mypy", "--strict", "--cache-dir", str(PACKAGE.parent / ".mypy_cache"), *map(str, sorted(EXAMPLES.glob("*.py")))],
            env={**os.environ, "MYPYPATH": str(PACKAGE.parent)}, capture_output=True, text=True)
        self.assertEqual(mypy.returncode, 0, mypy.stdout + mypy.stderr)


if __name__ == "__main__":
    unittest.main()
