"""The learned simulator, by its programs."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from . import _scene
from ._progress import command
from ._run import Run, opened
from ._scene import FilePath, Values

__all__ = ["rollout", "train"]


def train(
    config: Values, data: FilePath, output: FilePath, *, device: str = "auto", resume: bool = False, overwrite: bool = False
) -> Path:
    """Trains a network on the trajectories in `data/train`, validates it on those in `data/valid`, and returns the
    path of the best.

    `config` is a [training file](training.md) or a dictionary. `output` is the folder of models, log and checkpoint.
    Ctrl-C saves a checkpoint, from which `resume=True` continues. Raises `dempm.Error` if a key is wrong or the data do
    not fit.
    """
    with _scene.as_file(config) as file:
        folders = [f"--data={os.fspath(data)}", f"--output={os.fspath(output)}"]
        switches = [name for name, on in (("--resume", resume), ("--overwrite", overwrite)) if on]
        command("surrogate", "train", file, *folders, f"--device={device}", *switches)
    return Path(output, "best.safetensors")


def rollout(
    model: FilePath,
    scene: Values | Run,
    output: FilePath | None = None,
    *,
    start: int = 0,
    frames: int | None = None,
    mirror: bool = False,
    device: str = "auto",
    overwrite: bool = False,
) -> Run:
    """Predicts a trajectory with a [weights file](weights.md).

    The first frames of `scene` are simulated; those of a `Run` are taken from `start` on. The result has `frames`
    frames. `mirror` averages with the prediction of the mirror image. Raises `dempm.Error` if the network does not fit or
    the prediction fails.
    """
    options = [f"--device={device}"]
    if frames is not None:
        options.append(f"--frames={frames}")
    options += [f"--{name}" for name, on in (("mirror", mirror), ("overwrite", overwrite)) if on]

    def predict(path: FilePath) -> None:
        with contextlib.ExitStack() as stack:
            if isinstance(scene, Run):
                start_from = [f"--from={scene.path}", f"--start={start}"]
            else:
                start_from = [f"--scene={stack.enter_context(_scene.as_file(scene))}"]
            command("surrogate", "rollout", model, *start_from, f"--output={os.fspath(path)}", *options)

    return opened(predict, output, "rollout")
