"""Windows of trajectories with the accelerations that follow, for training."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any, Iterator, NamedTuple, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from .. import _dempm
from .._dempm import Error
from .._run import Run
from .._scene import FilePath
from ._config import FEATURES, Config, Training
from ._features import Boxes, Graph, raw_features, window_graphs
from ._network import Normalisation

#: Smallest standard deviation, m/frame, below any motion of grains: keeps directions without motion finite.
NO_MOTION = 1e-9


#: Smallest standard deviation of what is known of the material: data of one material must not make another one look a
#: thousand deviations away.
LEAST_OF_MATERIAL = 0.1


class Window(NamedTuple):
    """An example: the graphs of a window, and what a network should say about it."""

    #: Graphs of the network's frames, the oldest first.
    graphs: list[Graph]
    #: Normalised accelerations after the window (points, 2).
    target: Tensor
    #: Positions of the window with noise (frames, points, 2), m.
    positions: Tensor


class Batch(NamedTuple):
    """Several windows side by side, as one graph for each frame without edges between windows."""

    graphs: list[Graph]
    #: Normalised accelerations (points of all windows, 2).
    target: Tensor
    #: Points of each window.
    points: list[int]


def collate(windows: Sequence[Window]) -> Batch:
    """A batch of windows: the `collate_fn` of a `DataLoader`."""
    points = [len(window.target) for window in windows]
    first = np.cumsum([0, *points[:-1]]).tolist()
    graphs = []
    for parts in zip(*(window.graphs for window in windows)):
        graphs.append(
            Graph(
                torch.cat([graph.nodes for graph in parts]),
                torch.cat([graph.edges for graph in parts]),
                torch.cat([graph.sender + offset for graph, offset in zip(parts, first)]),
                torch.cat([graph.receiver + offset for graph, offset in zip(parts, first)]),
            )
        )
    return Batch(graphs, torch.cat([window.target for window in windows]), points)


class Windows(Dataset[Window]):
    """All windows of the trajectories below a folder, as graphs with targets: a `torch.utils.data.Dataset`.

    `frames` is the length of a window, unless a `config` states it and the network's features. `stride`, `noise` and
    `mirror` are those of [training files](training.md#data), with PyTorch's random numbers. `without_gravity` makes
    targets relative to free fall. `normalisation` is measured unless given: the validation set takes that of the
    training set.

    Raises `dempm.Error` if there are no trajectories, one is too short, or they differ in domain or frame interval.
    """

    def __init__(
        self,
        folder: FilePath | Sequence[FilePath],
        frames: int = 6,
        *,
        config: Config | None = None,
        stride: int = 1,
        noise: float = 3e-4,
        mirror: bool = False,
        without_gravity: bool = False,
        normalisation: Normalisation | None = None,
    ):
        self.config = Config(frames=frames) if config is None else config
        self.stride, self.noise, self.mirror = stride, noise, mirror
        self.files = _files(folder)
        self._runs: list[Run | None] = [None] * len(self.files)
        first = self._run(0)
        self.domain: list[float] = [float(x) for x in first.attributes["domain"]]
        interval = float(first.attributes["frame_interval"])
        for number, path in enumerate(self.files):
            run = self._run(number)
            for key, value in (("domain", self.domain), ("frame_interval", interval)):
                if not np.array_equal(run.attributes[key], value):
                    raise Error(f"{path}: {key} is {run.attributes[key]}, but {value} in {self.files[0]}")
            if run.frames <= self._span:
                raise Error(f"{path}: {run.frames} frames are too few for windows of {self._span + 1}")
        #: What a weights file states about a network that learns from these windows.
        self.training = Training(interval * stride, without_gravity)
        self._scenes = [self._constant(number) for number in range(len(self.files))]
        self._starts = np.cumsum([0, *(self._run(k).frames - self._span for k in range(len(self.files)))])
        self.normalisation = self.measure() if normalisation is None else normalisation
        # Processes that load windows open the files themselves.
        self._runs = [None] * len(self.files)

    def __len__(self) -> int:
        return int(self._starts[-1])

    def __getitem__(self, index: int) -> Window:
        index = range(len(self))[index]
        number = int(np.searchsorted(self._starts, index, side="right")) - 1
        first = index - int(self._starts[number])
        scene = self._scenes[number]
        selected = slice(first, first + self._span + 1, self.stride)
        positions = torch.from_numpy(self._run(number).position[selected])
        boxes, fall = scene.boxes.later(first / self.stride + self.config.window - 1), scene.fall.clone()
        if self.mirror and torch.rand(()) < 0.5:
            positions[..., 0] = self.domain[0] - positions[..., 0]
            fall[0] = -fall[0]
            boxes = boxes.mirrored(self.domain[0])
        if self.noise > 0:
            positions = _noisy(positions, self.noise)
        window, (before, last, following) = positions[:-1], positions[-3:]
        acceleration = (following - last) - (last - before)
        norm = self.normalisation
        target = (acceleration - fall - norm.acceleration_mean) / norm.acceleration_std
        graphs = window_graphs(window, self.config, norm.scales(), self.domain, boxes, scene.statics)
        return Window(graphs, target.float(), window)

    def __iter__(self) -> Iterator[Window]:
        return (self[index] for index in range(len(self)))

    def __getstate__(self) -> dict[str, Any]:
        # Each worker of a loader opens the files itself.
        return {**self.__dict__, "_runs": [None] * len(self.files)}

    def measure(self) -> Normalisation:
        """Means and standard deviations of velocities and accelerations over all frames, with the noise, and of further
        node features over every tenth frame."""
        velocity, acceleration = _Spread(2), _Spread(2)
        features = _Spread(self.config.further_columns)
        reach = self.config.window - self.config.frames
        for number, scene in enumerate(self._scenes):
            positions = torch.from_numpy(self._run(number).position[()])
            for first in range(self.stride):
                steps = positions[first :: self.stride].diff(dim=0)
                velocity.add(steps)
                acceleration.add(steps.diff(dim=0) - scene.fall)
            if self.config.node_features:
                for frame in range(reach * self.stride, len(positions), 10):
                    frames = positions[frame - reach * self.stride : frame + 1 : self.stride].float()
                    features.add(raw_features(frames, self.config, scene.statics, scene.boxes, 0).double())
        if self.mirror:
            velocity.mirror([0])
            acceleration.mirror([0])
        column = 0
        for feature in self.config.node_features:
            if feature == "acceleration":
                features.mirror([column, column + 1])
            column += FEATURES[feature][0]
        spreads = [spread.mean_and_deviation() for spread in (velocity, acceleration, features)]
        for mean, deviation in spreads[:2]:
            deviation.copy_(deviation.hypot(torch.tensor(self.noise).double()).clamp(min=NO_MOTION))
        mean, deviation = spreads[2]
        deviation.copy_(torch.maximum(deviation, 1e-6 * mean.abs()).clamp(min=NO_MOTION))
        column = 0
        for feature in self.config.node_features:
            columns = slice(column, column + FEATURES[feature][0])
            if feature == "material":
                deviation[columns].clamp_(min=LEAST_OF_MATERIAL)
            elif feature == "surfaces":
                mean[columns], deviation[columns] = 0.0, 1.0
                deviation[column + 7 : column + 9] = spreads[0][1]
            column = columns.stop
        return Normalisation(*spreads)

    @property
    def _span(self) -> int:
        """Frames of a file from the first of a window to its target."""
        return self.config.window * self.stride

    def _run(self, number: int) -> Run:
        run = self._runs[number]
        if run is None:
            run = self._runs[number] = Run(self.files[number])
        return run

    def _constant(self, number: int) -> _Scene:
        run = self._run(number)
        place = f"{run.path}, scene"
        time = float(run.time[0])
        rows = _dempm.Constraints(run.scene_text, place).obstacles(time, self.training.frame_interval)
        boxes = Boxes(torch.tensor(rows, dtype=torch.float64).reshape(-1, 11))
        gravity = torch.tensor(np.array(run.attributes["gravity"]))
        fall = gravity * self.training.frame_interval**2 * float(self.training.without_gravity)
        return _Scene(boxes, fall, static_features(run, self.config))


@dataclasses.dataclass
class _Scene:
    """What is the same in all frames of a file."""

    #: Boxes, in the first frame.
    boxes: Boxes
    #: What is subtracted from accelerations (2), m/frame².
    fall: Tensor
    #: Static node features (points, columns).
    statics: Tensor


class _Spread:
    """Mean and standard deviation of the columns of many tables."""

    def __init__(self, columns: int):
        self._count = 0
        self._mean = torch.zeros(columns, dtype=torch.float64)
        #: Sum of squares about the mean.
        self._squares = torch.zeros(columns, dtype=torch.float64)

    def add(self, values: Tensor) -> None:
        """Adds values (..., columns) by the formula of Chan, Golub and LeVeque."""
        rows = values.reshape(-1, values.shape[-1])
        count, mean = len(rows), rows.mean(0)
        total, step = self._count + count, mean - self._mean
        self._squares += (rows - mean).square().sum(0) + step.square() * (self._count * count / total)
        self._mean += step * (count / total)
        self._count = total

    def mirror(self, columns: list[int]) -> None:
        """Adds the same values with the opposite sign to these columns."""
        for column in columns:
            self._squares[column] += self._count * self._mean[column].square()
            self._mean[column] = 0.0

    def mean_and_deviation(self) -> Tensor:
        """Means and standard deviations (2, columns)."""
        return torch.stack([self._mean, (self._squares / max(self._count, 1)).sqrt()])


def static_features(run: Run, config: Config) -> Tensor:
    """Static node features (points, columns) from the first frame of a run."""
    columns = [torch.empty(run.points, 0)]
    for feature in config.node_features:
        if feature == "initial-stress":
            xx, xy, yx, yy = torch.from_numpy(run.stress[0]).unbind(1)
            columns.append(torch.stack([-0.5 * (xx + yy), torch.hypot(0.5 * (xx - yy), 0.5 * (xy + yx))], 1))
        elif feature == "initial-solid-fraction":
            columns.append(torch.from_numpy(run.solid_fraction[0])[:, None])
        elif feature == "material":
            values = torch.tensor(_dempm.material(run.scene_text, f"{run.path}, scene"))
            columns.append(values.expand(run.points, -1))
    return torch.cat(columns, 1)


def _noisy(positions: Tensor, sigma: float) -> Tensor:
    """Adds a random walk to a window and its target, the last frame: each frame adds a normal deviate to the error of the
    velocity, so that the last velocity of the window is wrong by `sigma` (m/frame). The target moves along with the last
    position: the velocity after the step is the true one, and the acceleration to learn undoes the error."""
    velocities = len(positions) - 2
    steps = torch.randn(velocities, *positions.shape[1:], dtype=positions.dtype) * (sigma / velocities**0.5)
    error = steps.cumsum(0).cumsum(0)
    return positions + torch.cat([torch.zeros_like(error[:1]), error, error[-1:]])


def _files(folder: FilePath | Sequence[FilePath]) -> list[Path]:
    if isinstance(folder, (str, os.PathLike)):
        files = sorted(Path(folder).rglob("*.h5"))
        if not files:
            raise Error(f"{folder}: there are no trajectories (*.h5) in it")
        return files
    return [Path(file) for file in folder]
