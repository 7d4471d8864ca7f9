"""Scenes, element tests and lists of scenes: files in TOML, or the same keys in a dictionary."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from pathlib import Path
from typing import Any, Iterator, Mapping, Union

from . import _dempm
from ._dempm import Error

FilePath = Union[str, "os.PathLike[str]"]
Values = Union[FilePath, Mapping[str, Any]]


def text_and_name(scene: Values) -> tuple[str, str]:
    """The text of a scene, and its name in messages."""
    if isinstance(scene, Mapping):
        return _dempm.toml_text(json.dumps(scene, default=_plain)), "dictionary"
    try:
        return Path(scene).read_text(encoding="utf-8"), os.fspath(scene)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise Error(f"cannot read the scene {os.fspath(scene)}: {reason}") from error


def values(file: Values) -> dict[str, Any]:
    """The keys of a file as a dictionary."""
    if isinstance(file, Mapping):
        return dict(file)
    return json.loads(_dempm.toml_values(text_and_name(file)[0]))


def complete(text: str, name: str) -> dict[str, Any]:
    """The keys of a scene as a dictionary, with the defaults of what it leaves out."""
    return json.loads(_dempm.scene_values(text, name))


@contextlib.contextmanager
def as_file(values: Values) -> Iterator[Path]:
    """A file with these keys; a temporary one for a dictionary."""
    if not isinstance(values, Mapping):
        yield Path(values)
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "scene.toml")
        file.write_text(text_and_name(values)[0], encoding="utf-8")
        try:
            yield file
        except Error as error:
            # Whoever gave a dictionary knows of no file.
            raise Error(str(error).replace(os.fspath(file), "dictionary")) from None


def _plain(value: Any) -> Any:
    """Values in JSON: numbers and arrays of numpy, and paths, as JSON has them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"a scene cannot hold {value!r}")
