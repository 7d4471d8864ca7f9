"""The learned simulator: predictions of a trained network."""

from __future__ import annotations

import os

from . import _dempm, _scene
from ._run import Run, keep, temporary
from ._scene import FilePath, Values

__all__ = ["rollout"]


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

    `scene` is a scene, a file or a dictionary, whose first frames are simulated; or a `Run`, whose frames from
    `start` on are taken. `frames` counts those of the result. `mirror` averages with the prediction of the mirror
    image. Without `output` the trajectory lies in a temporary file that is gone with the `Run`.

    Raises `dempm.Error` if the network does not fit or the prediction fails.
    """
    arguments = ["rollout", os.fspath(model), f"--device={device}"]
    folder = None
    if output is None:
        folder, output = temporary("rollout")
    arguments.append(f"--output={os.fspath(output)}")
    if frames is not None:
        arguments.append(f"--frames={frames}")
    if mirror:
        arguments.append("--mirror")
    if overwrite:
        arguments.append("--overwrite")
    if isinstance(scene, Run):
        _dempm.command("surrogate", [*arguments, f"--from={scene.path}", f"--start={start}"])
    else:
        with _scene.as_file(scene) as file:
            _dempm.command("surrogate", [*arguments, f"--scene={file}"])
    return keep(Run(output), folder)
