"""Trajectories."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Sequence

import h5py
import numpy as np

from . import _scene
from ._dempm import Error
from ._scene import FilePath

if TYPE_CHECKING:
    import xarray

    from ._commands import Picture

#: Units of the arrays over time, and the names of their dimensions after the frames.
_FIELDS = {
    "position": ("m", ("point", "axis")),
    "velocity": ("m/s", ("point", "axis")),
    "stress": ("Pa", ("point", "component")),
    "pressure": ("Pa", ("point",)),
    "speed": ("m/s", ("point",)),
    "solid_fraction": ("", ("point",)),
    "coordination": ("", ("point",)),
    "inertial_number": ("", ("point",)),
}


class Derived:
    """An array computed from a field of the file, frame by frame as it is needed. Indexed as a numpy array."""

    def __init__(self, source: h5py.Dataset, formula: Callable[[np.ndarray], np.ndarray]):
        self._source = source
        self._formula = formula
        self.shape: tuple[int, ...] = source.shape[:-1]
        self.dtype: np.dtype = source.dtype
        self.ndim = len(self.shape)

    def __getitem__(self, index: Any) -> np.ndarray:
        indices = index if isinstance(index, tuple) else (index,)
        if len(indices) > self.ndim or any(i is Ellipsis or i is None for i in indices):
            return np.asarray(self)[index]
        return self._formula(self._source[index])

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        values = self._formula(self._source[()])
        return values if dtype is None else values.astype(dtype)

    def __repr__(self) -> str:
        return f"<array of shape {self.shape}, computed from {self._source.name.strip('/')}>"


#: Derived fields: their source and formula over its last axis.
_DERIVED: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    "pressure": ("stress", lambda stress: -0.5 * (stress[..., 0] + stress[..., 3])),
    "speed": ("velocity", lambda velocity: np.hypot(velocity[..., 0], velocity[..., 1])),
}


class Run:
    """A trajectory of a simulated or predicted run, which may still go on. F frames, P points.

    Fields are h5py datasets, read when indexed: `run.position[-1]` is the numpy array of the last frame,
    `run.position[:]` that of all frames. `run["budget/front"]` is any dataset of the file.
    """

    def __init__(self, path: FilePath):
        self.path = Path(path)
        self._removal: weakref.finalize[..., Run] | None = None
        try:
            self._file = h5py.File(self.path, "r")
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else "it is no HDF5 file, or damaged"
            raise Error(f"cannot read {self.path}: {reason}") from error
        if self._text("format") != "DEMPM trajectory":
            self._file.close()
            raise Error(f"{self.path}: this is no trajectory")
        self._scene: dict[str, Any] | None = None

    def __getitem__(self, name: str) -> Any:
        if name in _DERIVED:
            source, formula = _DERIVED[name]
            return Derived(self[source], formula)
        if name in self._file and isinstance(self._file[name], h5py.Dataset):
            return self._file[name]
        help = "list it in output.fields of the scene" if name in _FIELDS else f"it has {', '.join(self.keys())}"
        raise Error(f"{self.path} has no {name}: {help}")

    def __contains__(self, name: str) -> bool:
        return name in self.keys()

    def __len__(self) -> int:
        return self.frames

    def __repr__(self) -> str:
        place = "temporary" if self._removal else self.path
        return f"<Run {self.title!r}: {self.frames} frames of {self.points} points, {self.status}, {place}>"

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the file; removes it if it is temporary."""
        self._file.close()
        if self._removal:
            self._removal()

    def removes(self, folder: str) -> None:
        # With this object or the process, whichever ends first.
        self._removal = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    def keys(self) -> list[str]:
        """Names of all datasets, stored and derived."""
        names: list[str] = []
        shown = [name for name in self._file if name != "VTKHDF"]
        for name in shown:
            item = self._file[name]
            if isinstance(item, h5py.Dataset):
                names.append(name)
            else:
                names += [f"{name}/{child}" for child in item if isinstance(item[child], h5py.Dataset)]
        return names + [name for name, (source, _) in _DERIVED.items() if source in names]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self._file["time"].shape[0]

    @property
    def points(self) -> int:
        """Number of material points."""
        return self._file["position"].shape[1]

    @property
    def time(self) -> np.ndarray:
        """Times (F), s."""
        return self._file["time"][()]

    @property
    def position(self) -> h5py.Dataset:
        """Positions (F, P, 2), m."""
        return self["position"]

    @property
    def velocity(self) -> h5py.Dataset:
        """Velocities (F, P, 2), m/s."""
        return self["velocity"]

    @property
    def speed(self) -> Derived:
        """Absolute velocities (F, P), m/s."""
        return self["speed"]

    @property
    def stress(self) -> h5py.Dataset:
        """Cauchy stress (F, P, 4): xx, xy, yx, yy, Pa, tension positive."""
        return self["stress"]

    @property
    def pressure(self) -> Derived:
        """In-plane pressure (F, P): -(xx + yy) / 2, Pa."""
        return self["pressure"]

    @property
    def solid_fraction(self) -> h5py.Dataset:
        """Area of discs over area of the packing (F, P)."""
        return self["solid_fraction"]

    @property
    def coordination(self) -> h5py.Dataset:
        """Mean contacts per grain (F, P)."""
        return self["coordination"]

    @property
    def inertial_number(self) -> h5py.Dataset:
        """[Inertial number](formats.md#trajectory-hdf5) (F, P)."""
        return self["inertial_number"]

    @property
    def mass(self) -> np.ndarray:
        """Masses of the points (P), kg/m."""
        return self._file["points/mass"][()]

    @property
    def column(self) -> np.ndarray:
        """Column of each point (P)."""
        return self._file["points/column"][()]

    @property
    def walls(self) -> np.ndarray:
        """Fixed walls (W, 4): segments x1, y1, x2, y2, m."""
        walls = self._file.get("boundary/walls")
        return np.empty((0, 4)) if walls is None else walls[()]

    @property
    def boxes(self) -> np.ndarray:
        """Obstacles and plates (F, B, 4): x min, y min, x max, y max, m; NaN while absent."""
        boxes = self._file.get("boundary/boxes")
        return np.empty((self.frames, 0, 4)) if boxes is None else boxes[()]

    @property
    def budget(self) -> dict[str, np.ndarray]:
        """[Scalars of the scene](formats.md#budget), each (F): `front`, `kinetic_energy` and others."""
        return {name: values[()] for name, values in self._file["budget"].items()}

    @property
    def scene(self) -> dict[str, Any]:
        """The scene as a dictionary, with defaults: `run.scene["grains"]["friction"]`."""
        if self._scene is None:
            self._scene = _scene.complete(self.scene_text, f"{self.path}, scene")
        return self._scene

    @property
    def scene_text(self) -> str:
        """The text of the scene file."""
        return self._text("scene")

    @property
    def title(self) -> str:
        """Title of the scene."""
        return self._text("title")

    @property
    def status(self) -> str:
        """`finished`, `running`, `interrupted` or `failed: ...`."""
        return self._text("status")

    @property
    def warnings(self) -> list[str]:
        """Warnings of the run."""
        return self._text("warnings").splitlines()

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the file: device, precision, material, domain and others."""
        return {name: _plain(value) for name, value in self._file.attrs.items()}

    @property
    def wall_time(self) -> dict[str, float]:
        """Wall time of each phase, s."""
        group = self._file.get("wall_time")
        return {} if group is None else {name: float(value) for name, value in group.attrs.items()}

    def save(self, path: FilePath, overwrite: bool = False) -> Run:
        """Copies the file to `path` and opens the copy."""
        target = Path(path)
        if target.exists() and not overwrite:
            raise Error(f"{target}: is there already; overwrite=True replaces it")
        with tempfile.NamedTemporaryFile(dir=target.parent, suffix=".dempm-tmp", delete=False) as whole:
            pass
        try:
            shutil.copyfile(self.path, whole.name)
            os.replace(whole.name, target)
        finally:
            Path(whole.name).unlink(missing_ok=True)
        return Run(target)

    def plot(self, other: Run | FilePath | None = None, **options: Any) -> Picture:
        """Draws the run: [`dempm.plot`](#dempmplot)."""
        from ._commands import plot

        return plot(self, other, **options)

    def to_xarray(self, fields: Sequence[str] | None = None) -> xarray.Dataset:
        """Fields (by default all) and budget as an xarray dataset in memory, with units."""
        import xarray

        names = fields if fields is not None else [name for name in _FIELDS if name in self]
        dataset = xarray.Dataset(
            coords={
                "time": ("time", self.time, {"units": "s"}),
                "axis": ["x", "y"],
                "component": ["xx", "xy", "yx", "yy"],
            },
            attrs=self.attributes,
        )
        for name in names:
            if name not in _FIELDS:
                raise Error(f"{name} is no field over points; there are {', '.join(_FIELDS)}")
            units, dimensions = _FIELDS[name]
            dataset[name] = (("time", *dimensions), np.asarray(self[name]), {"units": units})
        dataset["mass"] = ("point", self.mass, {"units": "kg/m"})
        for name, values in self.budget.items():
            dataset[name] = ("time", values)
        return dataset

    def _text(self, name: str) -> str:
        value = self._file.attrs.get(name, "")
        return value.decode() if isinstance(value, bytes) else str(value)


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def open(path: FilePath) -> Run:
    """Opens a trajectory file (HDF5). Raises `dempm.Error` if it is none."""
    return Run(path)


def opened(make: Callable[[FilePath], None], output: FilePath | None, name: str) -> Run:
    """The run that `make` writes to `output`; without one, to a file that is removed with the run."""
    if output is not None:
        make(output)
        return Run(output)
    folder = tempfile.mkdtemp(prefix="dempm-")
    try:
        path = Path(folder, f"{name}.h5")
        make(path)
        run = Run(path)
    except BaseException:
        shutil.rmtree(folder)
        raise
    run.removes(folder)
    return run
