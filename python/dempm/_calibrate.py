"""Grains that behave like a measured material."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any, Mapping

import numpy as np

from . import _scene
from ._progress import command
from ._scene import FilePath, Values


class Calibration:
    """The [results](calibration.md#results) of a calibration.

    `dempm.run({**scene, "grains": found.grains})` runs a scene of the calibrated grains.
    """

    #: Folder of the files.
    folder: Path
    #: The table `[grains]` of a scene, with the posterior mean.
    grains: dict[str, Any]
    #: The table `[mu-i]` of a scene; `None` if no law was fitted.
    law: dict[str, Any] | None
    #: For each free key `mean`, `sd`, `interval` (95 %), `determined` (`well`, `weakly` or `not`), and `correlation` with
    #: the others.
    parameters: dict[str, dict[str, Any]]
    #: What is determined, in words.
    identifiability: list[str]
    #: All sets of parameters: arrays of `round`, `member`, every free key and `misfit`, standard deviations.
    members: dict[str, np.ndarray]

    def __init__(self, folder: FilePath):
        self.folder = Path(folder)
        calibrated = _scene.values(self.folder / "calibrated.toml")
        posterior = _scene.values(self.folder / "posterior.toml")
        self.grains = calibrated["grains"]
        self.law = calibrated.get("mu-i")
        self.parameters = posterior["parameter"]
        self.identifiability = posterior["identifiability"]
        table = np.genfromtxt(self.folder / "members.csv", delimiter=",", names=True)
        self.members = {name: table[name] for name in table.dtype.names or ()}

    def __repr__(self) -> str:
        found = ", ".join(f"{key} {one['mean']:.3g} ± {one['sd']:.1g}" for key, one in self.parameters.items())
        return f"<Calibration: {found}>"


def calibrate(
    targets: Values,
    output: FilePath,
    *,
    law: str | None = None,
    device: str = "auto",
    resume: bool = False,
    overwrite: bool = False,
) -> Calibration:
    """Finds grains whose packings behave like a measured material: [calibration](calibration.md).

    Tables named in a dictionary are relative to the current folder. `output` is the folder of the results.
    `law="mu-i"` also fits this law. After Ctrl-C, `resume=True` continues from the last whole round with the same bits.
    Raises `dempm.Error` if a key or a table is wrong, or the grains cannot be simulated.
    """
    values = _absolute(targets) if isinstance(targets, Mapping) else targets
    options = [f"--output={os.fspath(output)}", f"--device={device}", *([f"--law={law}"] if law is not None else [])]
    options += [name for name, on in (("--resume", resume), ("--overwrite", overwrite)) if on]
    with _scene.as_file(values) as file:
        command("dempm", "calibrate", file, *options)
    return Calibration(output)


def _absolute(targets: Mapping[str, Any]) -> dict[str, Any]:
    """Targets that can lie in any folder."""
    tables = [
        {**target, "data": str(Path(target["data"]).absolute())} if "data" in target else target
        for target in targets.get("target", [])
    ]
    return {**targets, "target": tables}
