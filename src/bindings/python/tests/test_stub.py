"""The stub of the extension names what is there, and everything that is there."""

import ast
import inspect
import pathlib

from phyture import _phyture


def public(names):
    return {name for name in names if not name.startswith("_")}


def test_stub_and_extension_have_the_same_names():
    stub = pathlib.Path(_phyture.__file__).parent / "_phyture.pyi"
    nodes = ast.parse(stub.read_text(encoding="utf-8")).body
    classes = {node.name: node for node in nodes if isinstance(node, ast.ClassDef)}
    functions = {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    found = public(dir(_phyture)) - {"panics"}
    assert set(classes) | functions == found
    for name, node in classes.items():
        members = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
        if name != "Error":
            assert public(members) == public(dir(getattr(_phyture, name))), name
            assert inspect.getdoc(getattr(_phyture, name))


def test_the_package_is_typed():
    assert (pathlib.Path(_phyture.__file__).parent / "py.typed").exists()
