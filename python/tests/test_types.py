"""The type hints of the native module are about what it has."""

import ast

from conftest import ROOT

from dempm import _dempm


def test_the_stub_names_what_the_native_module_has():
    stub = ast.parse((ROOT / "python/dempm/_dempm.pyi").read_text())
    named = {node.name: node for node in stub.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    # A protocol describes arguments and exists in the stub only.
    named.pop("Watcher")
    native = {name for name in dir(_dempm) if not name.startswith("__")}
    assert named.keys() == native
    for name, node in named.items():
        if isinstance(node, ast.FunctionDef):
            expected = [argument.arg for argument in node.args.args]
            assert getattr(_dempm, name).__text_signature__ == f"({', '.join(expected)})"
