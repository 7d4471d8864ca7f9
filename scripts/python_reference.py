#!/usr/bin/env python3
"""Writes the reference part of docs/python.md from the docstrings of the package; `--check` only compares.

It reads the sources, so it needs neither the built package nor PyTorch.
"""

import ast
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "python/dempm"
PAGE = ROOT / "docs/python.md"
MARK = "<!-- From here on written by scripts/python_reference.py. -->\n"
# Modules and what of them is public, in the order of the page.
MODULES = {
    "dempm": ["run", "open", "Run", "plot", "check", "Check", "choose", "Choice", "element", "dataset",
              "calibrate", "Calibration"],
    "dempm.surrogate": ["rollout", "train"],
    "dempm.torch": ["Windows", "collate", "TGNNS", "rollout", "Config"],
}
# Classes whose objects one only gets.
MADE = {"Run", "Check", "Choice", "Calibration"}


def definitions(module):
    """Public functions and classes of a module by name, wherever they are defined."""
    base = PACKAGE.joinpath(*module.split(".")[1:])
    tree = parsed(base / "__init__.py" if base.is_dir() else base.with_suffix(".py"))
    imported = [node.module for node in tree.body if isinstance(node, ast.ImportFrom) and node.level == 1]
    sources = [base / f"{name}.py" for name in imported if name]
    trees = [tree, *(parsed(source) for source in sources if source.exists())]
    return ast.get_docstring(tree), {node.name: node for tree in trees for node in tree.body if hasattr(node, "name")}


def parsed(source):
    """The tree of a file, in which fields of classes carry the comments `#: ...` above them."""
    text = source.read_text()
    lines, tree = text.splitlines(), ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.AnnAssign):
            comment = []
            for line in reversed(lines[: node.lineno - 1]):
                if not line.strip().startswith("#:"):
                    break
                comment.insert(0, line.strip()[2:].strip())
            node.comment = " ".join(comment)
    return tree


def signature(name, function, drop_self=False):
    """The call as one would write it, with defaults and without types: `run(scene, output=None, *, device="auto")`."""
    arguments = function.args
    positional = arguments.posonlyargs + arguments.args
    defaults = [None] * (len(positional) - len(arguments.defaults)) + arguments.defaults
    said = [
        argument.arg if default is None else f"{argument.arg}={ast.unparse(default)}"
        for argument, default in zip(positional, defaults)
    ][drop_self:]
    if arguments.kwonlyargs:
        said.append("*")
        said += [
            argument.arg if default is None else f"{argument.arg}={ast.unparse(default)}"
            for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults)
        ]
    if arguments.kwarg:
        said.append(f"**{arguments.kwarg.arg}")
    return f"{name}({', '.join(said)})".replace("'", '"')


def is_property(function):
    return any(getattr(decorator, "id", None) == "property" for decorator in function.decorator_list)


def is_private(name):
    return name.startswith("_")


def members(node):
    """Rows of the attributes, properties and methods of a class: the name as one writes it, and its meaning."""
    for inner in node.body:
        if isinstance(inner, ast.AnnAssign) and inner.comment:
            yield f"`.{inner.target.id}`", inner.comment
    for inner in node.body:
        if not isinstance(inner, ast.FunctionDef) or is_private(inner.name) or not ast.get_docstring(inner):
            continue
        text = " ".join(ast.get_docstring(inner).split())
        if is_property(inner):
            yield f"`.{inner.name}`", text
        else:
            static = any(getattr(d, "id", None) == "classmethod" for d in inner.decorator_list)
            prefix = node.name if static else ""
            yield f"`{prefix}.{signature(inner.name, inner, drop_self=True)}`", text


def reference():
    text = []
    for module, names in MODULES.items():
        about, found = definitions(module)
        level = "##"
        if module != "dempm":
            text += [f"## {module}", about]
            level = "###"
        for name in names:
            node = found[name]
            text.append(f"{level} {module}.{name}")
            call = node if isinstance(node, ast.FunctionDef) else constructor(node)
            if call:
                said = signature(f"{module}.{name}", call, drop_self=call is not node)
                text.append(f"```python\n{said}\n```")
            text.append(ast.get_docstring(node))
            if isinstance(node, ast.ClassDef):
                rows = [f"| {said} | {meaning} |" for said, meaning in members(node)]
                text.append("\n".join(["| member | meaning |", "|---|---|", *rows]) if rows else "")
    return "\n\n".join(fenced(part) for part in text if part) + "\n"


def constructor(node):
    """The constructor of a class that one makes oneself."""
    makes = [inner for inner in node.body if getattr(inner, "name", "") == "__init__"]
    return makes[0] if makes and node.name not in MADE else None


def fenced(text):
    """Indented code of a docstring in fences, which show its colours."""
    lines, inside, result = text.splitlines(), False, []
    for k, line in enumerate(lines):
        is_code = line.startswith("    ")
        more = any(later.startswith("    ") for later in lines[k:]) and not line.strip()
        if is_code and not inside:
            result.append("```python")
            inside = True
        elif inside and not is_code and not (more and lines[k + 1].startswith("    ")):
            result.append("```")
            inside = False
        result.append(line[4:] if inside else line)
    return "\n".join(result + ["```"] * inside)


def main():
    page = PAGE.read_text()
    head, mark, old = page.partition(MARK)
    if not mark:
        print(f"{PAGE}: the line {MARK.strip()} is missing")
        return 1
    new = f"\n{reference()}"
    if "--check" not in sys.argv:
        PAGE.write_text(head + mark + new)
    elif old != new:
        print("docs/python.md is not that of the docstrings: run scripts/python_reference.py")
        return 1
    else:
        print("the reference of the Python package is current")
    return 0


if __name__ == "__main__":
    sys.exit(main())
