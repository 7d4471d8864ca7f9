#!/usr/bin/env python3
"""Runs the notebooks of the Python package and keeps their outputs.

Usage: run_notebooks.py [FOLDER [OLD NEW]]. Without a folder the notebooks themselves are written again. NEW replaces
the text OLD in their sources. It needs the package with its extras notebook and xarray, and nbclient.
"""

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).resolve().parent.parent / "python/notebooks"


def main(folder=NOTEBOOKS, old="", new=""):
    for file in sorted(NOTEBOOKS.glob("*.ipynb")):
        notebook = nbformat.read(file, as_version=4)
        for cell in notebook.cells:
            cell.source = cell.source.replace(old, new)
        NotebookClient(notebook, timeout=600, kernel_name="python3", coalesce_streams=True).execute()
        for cell in notebook.cells:
            # When cells ran is no result.
            cell.metadata.pop("execution", None)
        nbformat.write(notebook, Path(folder) / file.name)


if __name__ == "__main__":
    main(*sys.argv[1:])
