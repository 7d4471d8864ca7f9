"""What a weights file states about a network besides its weights."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from .._dempm import Error

#: Columns of the further node features, and how many frames before its own each needs.
FEATURES = {
    "acceleration": (2, 2),
    "overburden": (1, 0),
    "initial-stress": (2, 0),
    "initial-solid-fraction": (1, 0),
    "surfaces": (10, 0),
    "material": (4, 0),
}


@dataclasses.dataclass(frozen=True)
class Config:
    """The architecture of a network: the keys of [`[model]`](training.md#model), by default the paper's Baseline."""

    kind: str = "tgnns"
    dimensions: int = 2
    width: int = 128
    hidden_layers: int = 2
    message_layers: int = 2
    residual_layers: int = 0
    frames: int = 6
    edge_message: bool = False
    leaky_slope: float = 0.1
    connection_radius: float = 0.25
    gns_layers: int = 10
    node_features: tuple[str, ...] = ()
    obstacles: bool = False
    clamped_walls: bool = False

    def __post_init__(self) -> None:
        if self.kind != "tgnns":
            raise Error(f"a network of kind {self.kind!r}: dempm.torch has the TGNNS only")
        if self.dimensions != 2:
            raise Error(f"dimensions is {self.dimensions}, but must be 2")
        for feature in self.node_features:
            if feature not in FEATURES:
                raise Error(f"node_features: there is no {feature!r}, only {', '.join(FEATURES)}")

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Config:
        """From the keys of weights and training files."""
        known = {field.name for field in dataclasses.fields(cls)}
        for key in values:
            if key not in known:
                raise Error(f"model: there is no key {key!r}")
        return cls(**{**values, "node_features": tuple(values.get("node_features", ()))})

    def to_dict(self) -> dict[str, Any]:
        """The keys of weights files."""
        values = {**dataclasses.asdict(self), "node_features": list(self.node_features)}
        if not self.residual_layers:
            del values["residual_layers"]  # which older versions do not know
        return values

    @property
    def format(self) -> int:
        """Version of the format of its weights files."""
        if self.residual_layers:
            return 3
        return 2 if {"surfaces", "material"} & set(self.node_features) else 1

    @property
    def window(self) -> int:
        """Frames of positions that a prediction needs: those of the network, and earlier ones for node features."""
        return self.frames + max((FEATURES[name][1] for name in self.node_features), default=0)

    @property
    def further_columns(self) -> int:
        """Columns of the further node features."""
        return sum(FEATURES[name][0] for name in self.node_features)


@dataclasses.dataclass(frozen=True)
class Training:
    """What a network was trained on: the keys of `extra.training` of [weights files](weights.md#metadata)."""

    #: Time between frames, s.
    frame_interval: float
    #: Whether accelerations are relative to free fall.
    without_gravity: bool = False
    #: Largest number of frames of a window before the first of a run.
    before_start: int = 0
    #: Training steps made.
    steps: int = 0

    @classmethod
    def from_json(cls, text: str) -> Training:
        """Reads the keys that this class has."""
        values = json.loads(text)
        return cls(**{field.name: values[field.name] for field in dataclasses.fields(cls) if field.name in values})

    def to_json(self) -> str:
        """The keys as weights files have them."""
        return json.dumps(dataclasses.asdict(self))
