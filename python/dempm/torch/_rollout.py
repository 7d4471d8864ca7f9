"""Rollouts in PyTorch."""

from __future__ import annotations

import numpy as np
import torch

from .. import _dempm
from .._dempm import Error
from .._run import Run
from ._features import Boxes
from ._network import TGNNS
from ._windows import static_features


@torch.no_grad()
def rollout(model: TGNNS, run: Run, *, start: int = 0, frames: int | None = None) -> np.ndarray:
    """Positions (frames, points, 2), m: the first frames of `run` from `start` on, then predicted ones, as many as the
    run has unless `frames` says otherwise.

    Positions are in double precision; the network computes on the device of its parameters. Walls, boxes and plate
    confine the points as in `surrogate rollout`, and both agree to rounding. Raises `dempm.Error` if the network has no
    `training`, the frames do not fit it, or a position is not finite.
    """
    training = model.training_data
    if training is None:
        raise Error("the network states no frame_interval: load it from a weights file")
    interval = training.frame_interval
    stride = round(interval / float(run.attributes["frame_interval"]))
    if stride < 1 or abs(stride * float(run.attributes["frame_interval"]) / interval - 1) > 1e-6:
        raise Error(f"{run.path}: frames are {run.attributes['frame_interval']} s apart, those of the network {interval} s")
    window = model.config.window
    needed = max(window - training.before_start, 1) if start == 0 else window
    found = len(range(start, run.frames, stride))
    if found < needed:
        raise Error(f"{run.path}: the network needs {needed} initial frames, but there are {found} from {start} on")
    frames = found if frames is None else frames

    positions = [run.position[start + k * stride] for k in range(needed)]
    velocity = run.velocity[start]
    # Before the first frame, points move as in it.
    before = [positions[0] - velocity * (k * interval) for k in range(window - needed, 0, -1)]
    past = before + positions
    constraints = _dempm.Constraints(run.scene_text, f"{run.path}, scene")
    device = next(model.parameters()).device
    statics = static_features(run, model.config).to(device)
    domain = [float(x) for x in run.attributes["domain"]]
    fall = np.array(run.attributes["gravity"]) * interval**2 * float(training.without_gravity)
    begin = float(run.time[start])
    now = begin + (needed - 1) * interval
    rows = torch.tensor(constraints.obstacles(now, interval), dtype=torch.float64, device=device)
    boxes = Boxes(rows.reshape(-1, 11))
    for frame in range(needed, frames):
        seen = torch.from_numpy(np.stack(past[-window:]).astype(np.float32)).to(device)
        acceleration = model.accelerations(seen, domain, boxes, statics).cpu().numpy() + fall
        boxes = boxes.later(1)
        last = past[-1]
        # Semi-implicit Euler: v += a, x += v, per frame.
        free = last + ((last - past[-2]) + acceleration)
        if not np.isfinite(free).all():
            raise Error(f"frame {frame}: a position is not finite")
        times = [begin + (frame - 1) * interval, begin + frame * interval]
        past.append(np.array(constraints.confine(last.tolist(), free.tolist(), times)))
    return np.stack(past[len(before) :][:frames])
