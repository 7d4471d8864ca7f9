"""From positions to the inputs of a network: radius graphs, node and edge features, as in docs/weights.md.

All is computed in single precision in the order of the reference (surrogate/src/features), so that both differ by
rounding only.
"""

from __future__ import annotations

from typing import NamedTuple, Sequence

import torch
from torch import Tensor

from ._config import FEATURES, Config

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


class Boxes(NamedTuple):
    """Rigid boxes as a network sees them, for a window of frames."""

    #: Of each (boxes, 11), in float64: lower and upper corner while it rests, m; velocity when it moves, m/frame; frames
    #: from its start to the newest of the window; friction coefficients of left, right, bottom and top face.
    rows: Tensor

    def of_kind(self, fixed: bool) -> Boxes:
        """Those that never move, or the others."""
        return Boxes(self.rows[(self.rows[:, 4:6] == 0).all(1) == fixed])

    def placed(self, back: int) -> tuple[Tensor, Tensor, Tensor]:
        """Lower and upper corners, m, and velocities, m/frame, in single precision, each (boxes, 2), `back` frames before
        the newest of the window."""
        moved = (self.rows[:, 6:7] - back).clamp(min=0.0)
        velocity = self.rows[:, 4:6]
        low, high = (corner + velocity * moved for corner in (self.rows[:, 0:2], self.rows[:, 2:4]))
        return low.float(), high.float(), torch.where(moved > 0, velocity, 0.0).float()

    def friction(self) -> Tensor:
        """Friction coefficients (boxes, 4) of left, right, bottom and top face, in single precision."""
        return self.rows[:, 7:].float()

    def later(self, frames: float) -> Boxes:
        """The same for a window whose newest frame is so many frames later."""
        rows = self.rows.clone()
        rows[:, 6] += frames
        return Boxes(rows)

    def mirrored(self, width: float) -> Boxes:
        """The same with left and right exchanged in a domain of this width, m."""
        rows = self.rows[:, [2, 1, 0, 3, 4, 5, 6, 8, 7, 9, 10]]
        rows[:, [0, 2]] = width - rows[:, [0, 2]]
        rows[:, 4] = -rows[:, 4]
        return Boxes(rows)


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
    boxes: Boxes,
    statics: Tensor,
) -> list[Graph]:
    """The graphs of a window, one for each frame of the network, the oldest first.

    `positions` are (`config.window`, points, 2), m, `domain` its width and height, m, `boxes` those of the
    newest frame, and `statics` (points, columns) the static node features.
    """
    positions = positions.float()
    oldest = config.window - config.frames
    graphs = []
    for frame in range(oldest, config.window):
        now, is_later = positions[frame], frame > oldest
        receiver, sender = radius_graph(now, config.connection_radius)
        frames, back = positions[: frame + 1], config.window - 1 - frame
        further = raw_features(frames, config, statics, boxes, back)
        nodes = [
            _walls(now, config, domain, boxes),
            (further - scales.features_mean) / scales.features_std,
        ]
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


def _walls(now: Tensor, config: Config, domain: Sequence[float], boxes: Boxes) -> Tensor:
    """Distances to the nearest wall below and above along each axis, in radii. Faces of boxes are walls for the points
    in front of them."""
    radius = config.connection_radius
    skin = SKIN * radius
    fixed = boxes.of_kind(fixed=True) if config.obstacles else Boxes(boxes.rows[:0])
    low_corners, high_corners, _ = fixed.placed(0)
    columns = []
    for axis, length in enumerate(domain):
        x, across = now[:, axis], now[:, 1 - axis]
        below, above = x.clone(), length - x
        for low, high in zip(low_corners, high_corners):
            beside = (across <= low[1 - axis] + skin) | (across >= high[1 - axis] - skin)
            for nearest, distance in ((below, x - high[axis]), (above, low[axis] - x)):
                faces = ~beside & (distance >= -skin)
                nearest[faces] = torch.minimum(nearest, distance.clamp(min=0))[faces]
        columns += [below, above]
    distances = torch.stack(columns, 1)
    if config.clamped_walls:
        return (distances / radius).clamp(-1, 1)
    return torch.where(distances > radius, 0.0, distances / radius)


def raw_features(frames: Tensor, config: Config, statics: Tensor, boxes: Boxes, back: int) -> Tensor:
    """Further node features (points, columns) of the last of `frames` (frames, points, 2) in the order of the network.
    It is `back` frames before the one that `boxes` are given for."""
    now = frames[-1]
    columns, mine = [now.new_empty(len(now), 0)], 0
    for feature in config.node_features:
        if feature == "acceleration":
            columns.append((now - frames[-2]) - (frames[-2] - frames[-3]))
        elif feature == "overburden":
            columns.append(_overburden(now, config.connection_radius))
        elif feature == "surfaces":
            columns.append(_surfaces(now, boxes, back, config.connection_radius))
        else:
            count = FEATURES[feature][0]
            columns.append(statics[:, mine : mine + count])
            mine += count
    return torch.cat(columns, 1)


def _overburden(now: Tensor, radius: float) -> Tensor:
    """Number of points above each, within half a radius to either side (points, 1)."""
    x, y = now[:, 0], now[:, 1]
    return torch.stack([((y > height) & ((x - place).abs() <= radius / 2)).sum() for place, height in now])[:, None].float()


def _surfaces(now: Tensor, boxes: Boxes, back: int, radius: float) -> Tensor:
    """The nearest surface of a fixed box and of a moving one (points, 10), as docs/training.md describes."""
    columns = []
    for kind in (True, False):
        some = boxes.of_kind(fixed=kind)
        low, high, velocity = some.placed(back)
        if len(low) == 0:
            columns.append(now.new_zeros(len(now), 4 if kind else 6))
            continue
        distance, normal, face = _contacts(now, low, high)
        nearest = distance.argmin(1)
        each = torch.arange(len(now), device=now.device)
        distance, normal, face = (values[each, nearest] for values in (distance, normal, face))
        reached = distance <= radius
        closeness = torch.where(reached, (1 - distance / radius).clamp(max=2.0), 0.0)[:, None]
        friction = some.friction()[nearest, face][:, None]
        moving = [] if kind else [closeness * velocity[nearest]]
        columns += [closeness, closeness * normal, *moving, closeness * friction]
    return torch.cat(columns, 1)


def _contacts(now: Tensor, low: Tensor, high: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """How points lie to boxes: distance to the surface (points, boxes), negative inside; outward normal (points, boxes, 2);
    face (points, boxes), in the order left, right, bottom, top."""
    point = now[:, None]
    offset = point - torch.minimum(torch.maximum(point, low), high)
    outside = offset.square().sum(2).sqrt()
    upright = offset[..., 1].abs() >= offset[..., 0].abs()
    beyond = torch.where(upright, offset[..., 1], offset[..., 0]) > 0
    depths = torch.stack([point - low, high - point], 3).flatten(2)
    depth, inner = depths.min(2)
    is_out = outside > 0
    face = torch.where(is_out, 2 * upright + 1 * beyond, inner)
    outward = torch.tensor([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]], device=now.device)[face]
    normal = torch.where(is_out[..., None], offset / torch.where(is_out, outside, 1.0)[..., None], outward)
    return torch.where(is_out, outside, -depth), normal, face
