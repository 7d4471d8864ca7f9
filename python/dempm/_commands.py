"""The commands of `dempm`."""

from __future__ import annotations

import contextlib
import io
import json
import os
import tempfile
from pathlib import Path
from typing import Any, Mapping, NamedTuple, Sequence

import numpy as np

from . import _dempm, _scene
from ._progress import Watcher, command
from ._run import Run, opened
from ._scene import FilePath, Values
from .surrogate import rollout

#: Tables of a list of scenes.
_SPLITS = ("train", "valid", "test")


def run(
    scene: Values,
    output: FilePath | None = None,
    *,
    within: float | str | None = None,
    learned: FilePath | None = None,
    device: str = "auto",
    progress: bool = True,
    resume: bool = False,
    overwrite: bool = False,
    checkpoint_interval: float = 20.0,
) -> Run:
    """Simulates a scene.

    `scene` is a file or a dictionary with the [keys of one](scenes.md). `within` and `learned` replace its model by the
    one that `choose` takes; `run.scene["choice"]` states it.

    Ctrl-C, or *Interrupt* in a notebook, saves a checkpoint beside `output` and raises `KeyboardInterrupt`; the same
    call with `resume=True` continues with the same bits, but repeats predictions of a network.

    Raises `dempm.Error` if the scene is invalid, the output exists or a step fails. Warnings are Python warnings.
    """
    text, name = _scene.text_and_name(scene)
    if within is not None:
        choice = choose(scene, within, learned=learned, device=device)
        text = choice.scene_text
        if learned is not None and choice["candidates"][choice["taken"]]["family"] == "learned":
            values = json.loads(_dempm.toml_values(text))
            return rollout(learned, values, output, device=device, overwrite=overwrite or resume)
    elif learned is not None:
        raise ValueError("learned: with `within` only")
    with Watcher(progress) as watcher:
        return opened(
            lambda path: _dempm.run(text, name, path, device, resume, overwrite, checkpoint_interval, watcher),
            output,
            Path(name).stem,
        )


class Check(Mapping[str, Any]):
    """The cost of a scene: a dictionary that prints as `dempm check` does.

    | key | meaning |
    |---|---|
    | `points`, `frames`, `steps` | material points, frames after the first, MPM steps |
    | `step`, `step_limit` | MPM step, and the largest stable one, s |
    | `discs` | in all packings, or in the scene; `None` under a continuum law |
    | `seconds` | estimated wall time on this machine's CPU, s |
    | `memory`, `output` | bytes in memory, and in the trajectory before compression |
    | `warnings` | texts |
    """

    def __init__(self, numbers: dict[str, Any], text: str):
        self._numbers = numbers
        self._text = text

    def __getitem__(self, key: str) -> Any:
        return self._numbers[key]

    def __iter__(self) -> Any:
        return iter(self._numbers)

    def __len__(self) -> int:
        return len(self._numbers)

    def __repr__(self) -> str:
        return self._text


def check(scene: Values) -> Check:
    """Validates a scene and estimates its cost. Raises `dempm.Error` if it is invalid."""
    numbers, text = _dempm.check(*_scene.text_and_name(scene))
    return Check(json.loads(numbers), text)


class Choice(Mapping[str, Any]):
    """The model to take for a scene: a dictionary with the keys of [`dempm choose --json`](commands.md#json), which prints
    as `dempm choose` does. `scene_text` is the scene with that model.
    """

    def __init__(self, values: dict[str, Any], text: str, scene_text: str):
        self._values = values
        self._text = text
        #: The scene with the model that is taken, as the text of a file.
        self.scene_text = scene_text

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def __iter__(self) -> Any:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return self._text


def choose(
    scene: Values, within: float | str, *, learned: FilePath | None = None, device: str = "auto"
) -> Choice:
    """Finds the [cheapest model](choose.md) `within` a distance from the scene as discs: a number (RMS, m), or a text such
    as `5%` of the run-out. `learned` is the weights file of a further candidate. Raises `dempm.Error` if the scene is
    invalid or has no candidates.
    """
    model = None if learned is None else os.fspath(learned)
    values, text, chosen = _dempm.choose(*_scene.text_and_name(scene), str(within), device, model)
    return Choice(json.loads(values), text, chosen)


def element(test: Values, grains: Mapping[str, Any] | None = None) -> dict[str, np.ndarray]:
    """Drives a packing along a path, as an [element test](element-tests.md).

    `grains` replaces keys of `[grains]`, such as `{"friction": 0.3}`. Returns the
    [columns of the path](element-tests.md#csv), each (rows). Raises `dempm.Error` if the test is wrong or a stage fails.
    """
    values = _scene.values(test)
    values["grains"] = {**values.get("grains", {}), **(grains or {})}
    if not isinstance(test, Mapping) and "packing" in values:
        values["packing"] = str(Path(test).resolve().parent / values["packing"])
    with _scene.as_file(values) as file:
        table = _dempm.element(file)
    path = np.genfromtxt(io.StringIO(table), delimiter=",", names=True)
    return {name: np.atleast_1d(path[name]) for name in path.dtype.names or ()}


def dataset(
    scenes: Values,
    output: FilePath,
    *,
    only: Sequence[str] = (),
    device: str = "auto",
    jobs: int | None = None,
    overwrite: bool = False,
) -> list[Run]:
    """Simulates many scenes into the folder `output`: `paper`, or a [list](datasets.md).

    Base scenes of a dictionary are dictionaries, or files relative to the current folder. Finished runs stay,
    interrupted ones continue. `only` picks splits or scenes: `["test/col2x2"]`. Returns the runs in the order of their
    files. Raises `dempm.Error` if the list is wrong or scenes failed.
    """
    options: list[str] = [f"--device={device}", *(f"--only={name}" for name in only)]
    if jobs is not None:
        options.append(f"--jobs={jobs}")
    options.append("--overwrite" if overwrite else "--resume")
    with contextlib.ExitStack() as stack:
        values = _list_of_scenes(scenes, stack) if isinstance(scenes, Mapping) else scenes
        file = stack.enter_context(_scene.as_file(values))
        command("dempm", "dataset", file, f"--output={os.fspath(output)}", *options)
    return [Run(path) for path in sorted(Path(output).rglob("*.h5"))]


def _list_of_scenes(scenes: Mapping[str, Any], stack: contextlib.ExitStack) -> dict[str, Any]:
    """A list that can lie in any folder: base scenes have absolute paths, and keys joined by dots are tables."""

    def block(table: Mapping[str, Any]) -> dict[str, Any]:
        changes: dict[str, Any] = {key: _nested(table[key]) for key in ("set", "list", "grid") if key in table}
        if "scene" in table:
            changes["scene"] = str(stack.enter_context(_scene.as_file(table["scene"])).absolute())
        return {**table, **changes}

    blocks = {split: [block(table) for table in scenes[split]] for split in _SPLITS if split in scenes}
    return {**block(scenes), **blocks}


def _nested(table: Mapping[str, Any]) -> dict[str, Any]:
    """`{"column.0.size": x}` as `{"column": {"0": {"size": x}}}`."""
    nested: dict[str, Any] = {}
    for key, value in table.items():
        *path, last = key.split(".")
        inner = nested
        for part in path:
            inner = inner.setdefault(part, {})
        inner[last] = value
    return nested


class Picture(NamedTuple):
    """A picture, which a notebook shows."""

    #: The bytes of a PNG file.
    png: bytes

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"<Picture of {len(self.png)} bytes>"

    def save(self, path: FilePath) -> None:
        """Writes the picture (PNG)."""
        Path(path).write_bytes(self.png)


def plot(run: Run | FilePath, other: Run | FilePath | None = None, **options: Any) -> Picture:
    """Draws frames of a run, or of two: side by side, overlaid or subtracted (`compare`). A notebook shows the picture,
    `save(path)` writes it (PNG), `png` are its bytes.

    Options are those of [`dempm plot`](commands.md#dempm) with `_` for `-`: `plot(run, field="pressure",
    times=[0.5, 1.0], width=1200)`. Raises `dempm.Error` if a frame or field is missing.
    """
    files = [one.path if isinstance(one, Run) else Path(one) for one in (run, other) if one is not None]
    arguments: list[FilePath] = [*files]
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            arguments.append(flag)
        elif isinstance(value, (list, tuple, np.ndarray)):
            arguments.append(f"{flag}={','.join(map(str, value))}")
        elif value is not False and value is not None:
            arguments.append(f"{flag}={value}")
    with tempfile.TemporaryDirectory() as folder:
        png = Path(folder, "plot.png")
        command("dempm", "plot", *arguments, f"--output={png}")
        return Picture(png.read_bytes())
