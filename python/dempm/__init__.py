"""Granular flow by MPM x DEM: scenes are run, trajectories read, and learned simulators rolled out.

    import dempm

    run = dempm.run("scenes/column.toml")
    run.position[-1]        # (points, 2), m
    dempm.plot(run)

Quantities are SI, per metre out of plane. Whatever a command reports as its error is raised as `dempm.Error` with
the same text.
"""

from . import surrogate
from ._calibrate import Calibration, calibrate
from ._commands import Check, Choice, Picture, check, choose, dataset, element, plot, run
from ._dempm import Error, __version__
from ._run import Run, open

__all__ = [
    "Calibration",
    "Check",
    "Choice",
    "Error",
    "Picture",
    "Run",
    "__version__",
    "calibrate",
    "check",
    "choose",
    "dataset",
    "element",
    "open",
    "plot",
    "run",
    "surrogate",
]
