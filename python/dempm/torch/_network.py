"""The TGNNS in plain PyTorch, with parameters named as in weights files."""

from __future__ import annotations

import json
import os
from typing import Sequence

import safetensors
import torch
from safetensors.torch import save_file
from torch import Tensor, nn

from .._dempm import Error
from .._scene import FilePath
from ._config import Config, Training
from ._features import Boxes, Graph, Scales, window_graphs


class Normalisation(nn.Module):
    """Means and standard deviations of a training set, in float64: of velocities (2), m/frame, of accelerations (2),
    m/frame², and of further node features (columns). Each is given as a tensor (2, columns): means, then deviations."""

    velocity_mean: Tensor
    velocity_std: Tensor
    acceleration_mean: Tensor
    acceleration_std: Tensor

    def __init__(
        self,
        velocity: Tensor,
        acceleration: Tensor,
        features: Tensor | None = None,
    ):
        super().__init__()
        for name, values in (("velocity", velocity), ("acceleration", acceleration), ("features", features)):
            if values is not None and values.numel() > 0:
                mean, std = values.double()
                self.register_buffer(f"{name}_mean", mean.clone())
                self.register_buffer(f"{name}_std", std.clone())

    def scales(self) -> Scales:
        """What the input features need, in single precision."""
        none = self.velocity_mean.new_empty(0)
        features = (getattr(self, f"features_{which}", none).float() for which in ("mean", "std"))
        return Scales(self.velocity_mean.float(), self.velocity_std.float(), *features)


class MLP(nn.Module):
    """Linear layers with LeakyReLU between them, then LayerNorm unless the network ends here."""

    def __init__(self, config: Config, inputs: int, outputs: int, norm: bool = True):
        super().__init__()
        sizes = [inputs, *[config.width] * config.hidden_layers, outputs]
        self.linears = nn.ModuleList(nn.Linear(a, b) for a, b in zip(sizes, sizes[1:]))
        self.slope = config.leaky_slope
        if norm:
            self.norm: nn.LayerNorm | None = nn.LayerNorm(outputs, eps=1e-5)
        else:
            self.norm = None

    def forward(self, *inputs: Tensor) -> Tensor:
        x = torch.cat(inputs, 1)
        for layer, linear in enumerate(self.linears):
            x = linear(x if layer == 0 else nn.functional.leaky_relu(x, self.slope))
        return x if self.norm is None else self.norm(x)


class MessageLayer(nn.Module):
    """Messages along the edges, and the update of the nodes by their sums."""

    def __init__(self, config: Config):
        super().__init__()
        self.message = MLP(config, 3 * config.width, config.width)
        self.update = MLP(config, 2 * config.width, config.width)

    def forward(self, nodes: Tensor, edges: Tensor, graph: Graph) -> tuple[Tensor, Tensor]:
        messages = self.message(nodes[graph.sender], nodes[graph.receiver], edges)
        received = torch.zeros_like(nodes).index_add(0, graph.receiver, messages)
        return self.update(nodes, received), messages


class TGNNS(nn.Module):
    """The temporal graph network simulator: one message-passing layer for each frame of the window on that frame's
    graph, further layers on the last graph, and a decoder. There are no residual connections but those of
    `residual_layers`.

    A new network has random weights; `normalisation` and `training` are those of its `Windows`."""

    def __init__(self, config: Config, normalisation: Normalisation | None = None, training: Training | None = None):
        super().__init__()
        self.config = config
        #: What it was trained on; `None` unless it comes from a file.
        self.training_data = training
        d, w, f = config.dimensions, config.width, config.further_columns
        self.node_encoder_first = MLP(config, 2 * d + f, w)
        self.node_encoder_later = MLP(config, 3 * d + f, w)
        self.edge_encoder_first = MLP(config, d + 1, w)
        self.edge_encoder_later = MLP(config, 2 * d + 1, w)
        self.node_fusion = MLP(config, 2 * w, w)
        if config.edge_message:
            self.edge_fusion = MLP(config, w + 2 * d + 1, w)
        self.frame_layers = nn.ModuleList(MessageLayer(config) for _ in range(config.frames))
        self.message_layers = nn.ModuleList(MessageLayer(config) for _ in range(config.message_layers))
        self.residual_layers = nn.ModuleList(MessageLayer(config) for _ in range(config.residual_layers))
        for layer in self.residual_layers:
            nn.init.zeros_(layer.update.norm.weight)  # they begin as nothing
        self.decoder = MLP(config, w, d, norm=False)
        if normalisation is None:
            unit = torch.tensor([[0.0, 0.0], [1.0, 1.0]])
            features = torch.tensor([[0.0], [1.0]]).expand(2, f)
            normalisation = Normalisation(unit, unit, features)
        self.normalisation = normalisation

    @classmethod
    def from_safetensors(cls, path: FilePath) -> TGNNS:
        """Reads a [weights file](weights.md). Raises `dempm.Error` if it is none, or of another kind."""
        try:
            with safetensors.safe_open(os.fspath(path), framework="pt") as file:
                about = json.loads(file.metadata()["surrogate"])
                parameters = {name: file.get_tensor(name) for name in file.keys()}
            training = Training.from_json(about["extra"]["training"])
        except FileNotFoundError as error:
            raise Error(f"{os.fspath(path)}: there is no such file") from error
        except (safetensors.SafetensorError, KeyError, TypeError, ValueError) as error:
            raise Error(f"{os.fspath(path)}: this is no weights file of DEMPM: {error}") from error
        network = cls(Config.from_dict(about["config"]), training=training)
        try:
            network.load_state_dict(parameters)
        except RuntimeError as error:
            raise Error(f"{os.fspath(path)}: {error}") from error
        return network

    def save(self, path: FilePath, training: Training) -> None:
        """Writes a [weights file](weights.md)."""
        config = self.config.to_dict()
        about = {"format": self.config.format, "config": config, "extra": {"training": training.to_json()}}
        parameters = {name: value.detach().cpu().contiguous() for name, value in self.state_dict().items()}
        save_file(parameters, os.fspath(path), metadata={"surrogate": json.dumps(about)})

    def forward(self, graphs: Sequence[Graph]) -> Tensor:
        """Normalised accelerations (points, 2) from the graphs of a window, or of several side by side."""
        graph = graphs[0]
        nodes = self.node_encoder_first(graph.nodes)
        nodes, messages = self.frame_layers[0](nodes, self.edge_encoder_first(graph.edges), graph)
        for layer, graph, before in zip(list(self.frame_layers)[1:], graphs[1:], graphs):
            nodes = self.node_fusion(nodes, self.node_encoder_later(graph.nodes))
            nodes, messages = layer(nodes, self._later_edges(messages, graph, before), graph)
        for layer in self.message_layers:
            nodes, messages = layer(nodes, messages, graph)
        for layer in self.residual_layers:
            update, messages = layer(nodes, messages, graph)
            nodes = nodes + update
        return self.decoder(nodes)

    def _later_edges(self, messages: Tensor, graph: Graph, before: Graph) -> Tensor:
        """Edge states of a later frame: fused with the message of the frame before along edges that persist."""
        states = self.edge_encoder_later(graph.edges)
        if not self.config.edge_message or len(before.sender) == 0:
            return states
        points = len(graph.nodes)
        old, new = (g.receiver * points + g.sender for g in (before, graph))
        place = torch.searchsorted(old, new).clamp(max=len(old) - 1)
        persists = old[place] == new
        fused = self.edge_fusion(messages[place[persists]], graph.edges[persists])
        return states.index_copy(0, persists.nonzero()[:, 0], fused)

    def accelerations(
        self,
        positions: Tensor,
        domain: Sequence[float],
        boxes: Boxes | None = None,
        statics: Tensor | None = None,
    ) -> Tensor:
        """Accelerations (points, 2) in float64, m/frame², after a window of positions (`config.window`, points, 2), m.

        `domain` is (width, height), m; `boxes` are those of the newest frame; `statics` (points, columns) static node
        features. A network `without_gravity` leaves free fall to the caller.
        """
        boxes = Boxes(positions.new_empty(0, 11, dtype=torch.float64)) if boxes is None else boxes
        statics = positions.new_empty(positions.shape[1], 0) if statics is None else statics
        norm = self.normalisation
        graphs = window_graphs(positions, self.config, norm.scales(), domain, boxes, statics.float())
        return self(graphs).double() * norm.acceleration_std + norm.acceleration_mean
