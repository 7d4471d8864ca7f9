"""From positions to the inputs of a network: radius graphs, node and edge features, as in docs/weights.md.

All is computed in single precision in the order of the reference (surrogate/src/features), so that both differ by
rounding only.
"""

from __future__ import annotations

from typing import NamedTuple, Sequence

import torch
from torch import Tensor

from ._config import Config

#: Depth, in connection radii, to which points inside an obstacle still see its face.
SKIN = 1e-3


class Graph(NamedTuple):
    """The graph of one frame, or the graphs of several windows side by side. Edges are sorted by receiver, then sender."""

    #: Node features (points, columns).
    nodes: Tensor
    #: Edge features (edges, columns).
    edges: Tensor
    #: Sender w of each edge (edges).
    sender: Tensor
    #: Receiver v of each edge (edges).
    receiver: Tensor


class Scales(NamedTuple):
    """Means and standard deviations in single precision: of velocities (2) and of further node features (columns)."""

    velocity_mean: Tensor
    velocity_std: Tensor
    features_mean: Tensor
    features_std: Tensor


def radius_graph(positions: Tensor, radius: float) -> tuple[Tensor, Tensor]:
    """Receivers and senders, each (edges), of all pairs of `positions` (points, 2) at most `radius` (m) apart."""
    points = len(positions)
    number = torch.arange(points, device=positions.device)
    # Cells a little wider than the radius, numbered column by column, with an empty one between columns.
    cell = ((positions - positions.min(0).values) / (1.001 * radius)).floor().long()
    rows = int(cell[:, 1].max()) + 2
    place = cell[:, 0] * rows + cell[:, 1]
    place_sorted, order = place.sort(stable=True)
    pairs = []
    for column in (-1, 0, 1):
        middle = place + column * rows
        first = torch.searchsorted(place_sorted, middle - 1)
        last = torch.searchsorted(place_sorted, middle + 1, right=True)
        count = last - first
        receiver = number.repeat_interleave(count)
        within = torch.arange(len(receiver), device=positions.device) - (count.cumsum(0) - count)[receiver]
        sender = order[first[receiver] + within]
        distance = (positions[sender] - positions[receiver]).square().sum(1)
        near = (distance <= torch.tensor(radius, dtype=positions.dtype) ** 2) & (sender != receiver)
        pairs.append(receiver[near] * points + sender[near])
    pair = torch.cat(pairs).sort().values
    return pair // points, pair % points


def window_graphs(
    positions: Tensor,
    config: Config,
    scales: Scales,
    domain: Sequence[float],
    obstacles: Tensor,
    statics: Tensor,
) -> list[Graph]:
    """The graphs of a window, one for each frame of the network, the oldest first.

    `positions` are (`config.window`, points, 2), m, `domain` its width and height, m, `obstacles` (boxes, 2, 2) the
    lower and upper corners of fixed boxes, m, and `statics` (points, columns) the static node features.
    """
    positions = positions.float()
    oldest = config.window - config.frames
    graphs = []
    for frame in range(oldest, config.window):
        now, is_later = positions[frame], frame > oldest
        receiver, sender = radius_graph(now, config.connection_radius)
        nodes = [_walls(now, config, domain, obstacles), _further(positions[: frame + 1], config, scales, statics)]
        edges = [_separation(now, receiver, sender, config.connection_radius)]
        if is_later:
            velocity = now - positions[frame - 1]
            nodes.insert(0, (velocity - scales.velocity_mean) / scales.velocity_std)
            edges.insert(0, (velocity[sender] - velocity[receiver]) / scales.velocity_std)
        graphs.append(Graph(torch.cat(nodes, 1), torch.cat(edges, 1), sender, receiver))
    return graphs


def _separation(now: Tensor, receiver: Tensor, sender: Tensor, radius: float) -> Tensor:
    """Direction from receiver to sender, 0 if they coincide, and distance / radius."""
    displacement = now[sender] - now[receiver]
    distance = displacement.square().sum(1, keepdim=True).sqrt()
    return torch.cat([displacement / torch.where(distance > 0, distance, 1.0), distance / radius], 1)


def _walls(now: Tensor, config: Config, domain: Sequence[float], obstacles: Tensor) -> Tensor:
    """Distances to the nearest wall below and above along each axis, in radii. Faces of boxes are walls for the points
    in front of them."""
    radius = config.connection_radius
    skin = SKIN * radius
    columns = []
    for axis, length in enumerate(domain):
        x, across = now[:, axis], now[:, 1 - axis]
        below, above = x.clone(), length - x
        for low, high in obstacles if config.obstacles else ():
            beside = (across <= low[1 - axis] + skin) | (across >= high[1 - axis] - skin)
            for nearest, distance in ((below, x - high[axis]), (above, low[axis] - x)):
                faces = ~beside & (distance >= -skin)
                nearest[faces] = torch.minimum(nearest, distance.clamp(min=0))[faces]
        columns += [below, above]
    distances = torch.stack(columns, 1)
    if config.clamped_walls:
        return (distances / radius).clamp(-1, 1)
    return torch.where(distances > radius, 0.0, distances / radius)


def raw_features(frames: Tensor, config: Config, statics: Tensor) -> Tensor:
    """Further node features (points, columns) of the last of `frames` (frames, points, 2) in the order of the network."""
    now = frames[-1]
    columns, mine = [now.new_empty(len(now), 0)], 0
    for feature in config.node_features:
        if feature == "acceleration":
            columns.append((now - frames[-2]) - (frames[-2] - frames[-3]))
        elif feature == "overburden":
            columns.append(_overburden(now, config.connection_radius))
        else:
            count = 2 if feature == "initial-stress" else 1
            columns.append(statics[:, mine : mine + count])
            mine += count
    return torch.cat(columns, 1)


def _further(frames: Tensor, config: Config, scales: Scales, statics: Tensor) -> Tensor:
    return (raw_features(frames, config, statics) - scales.features_mean) / scales.features_std


def _overburden(now: Tensor, radius: float) -> Tensor:
    """Number of points above each, within half a radius to either side (points, 1)."""
    x, y = now[:, 0], now[:, 1]
    return torch.stack([((y > height) & ((x - place).abs() <= radius / 2)).sum() for place, height in now])[:, None].float()
