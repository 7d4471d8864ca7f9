"""The learned simulator in PyTorch, against the one in Rust."""

import json

import numpy as np
import pytest
from conftest import LAW, ROOT

import dempm

torch = pytest.importorskip("torch", reason="PyTorch is not installed: make test TORCH=1 installs it")

from torch.utils.data import DataLoader  # noqa: E402

from dempm.torch import TGNNS, Config, Training, Windows, collate, radius_graph, rollout  # noqa: E402

MODELS = sorted((ROOT / "models").glob("*.safetensors"))

#: A column that runs into a box while a plate comes down: walls, faces of the box, its friction and the motion of the
#: plate matter.
BARRIER = {
    **LAW,
    "duration": 0.5,
    "obstacle": [{"corner": [0.625, 0.0], "size": [0.125, 0.25]}],
    "plate": {"corner": [0.1, 0.8], "size": [0.2, 0.1], "velocity": [0.3, -1.0], "start": 0.045},
}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Three columns under a continuum law, 21 frames each."""
    folder = tmp_path_factory.mktemp("data")
    scene = {**BARRIER, "duration": 0.2, "output": {"fields": ["stress"]}}
    sizes = {"column.0.size": [[0.5, 0.5], [0.375, 0.5], [0.5, 0.75]]}
    dempm.dataset({"scene": scene, "train": [{"grid": sizes}]}, folder, device="cpu")
    return folder


def deviation(model, run):
    """Largest distance (m) of positions predicted from the windows of a rollout to the next frame of the rollout."""
    worst = 0.0
    window = model.config.window
    for frame in range(window, run.frames):
        predicted = rollout(model, run, start=frame - window, frames=window + 1)[-1]
        worst = max(worst, np.abs(predicted - run.position[frame]).max())
    return worst


@pytest.mark.parametrize("file", MODELS, ids=lambda file: file.stem)
def test_predictions_are_those_of_the_rust_rollout(file):
    run = dempm.surrogate.rollout(file, BARRIER, frames=40, device="cpu")
    model = TGNNS.from_safetensors(file)
    # Sums of single precision in another order. A frame's error is 1e-8 m; where positions round to other
    # single-precision numbers, of 1.2e-7 m at 1 m, it is some of these.
    assert deviation(model, run) < 1e-6
    positions = rollout(model, run, frames=model.config.window + 10)
    assert np.array_equal(positions[0], run.position[0])
    assert np.abs(positions - run.position[: len(positions)]).max() < 1e-6


CONFIGS = {
    "paper": Config(width=16, hidden_layers=1, frames=3),
    "residual layers": Config(width=16, frames=3, residual_layers=2),
    "edge messages": Config(width=16, frames=4, message_layers=0, edge_message=True),
    "all features": Config(
        width=16,
        frames=3,
        obstacles=True,
        node_features=("overburden", "initial-stress", "acceleration", "surfaces", "material"),
    ),
}


@pytest.mark.parametrize("name", CONFIGS)
def test_a_network_made_here_is_the_same_in_rust(name, data, tmp_path):
    torch.manual_seed(1)
    windows = Windows(data, config=CONFIGS[name])
    model = TGNNS(windows.config, windows.normalisation)
    for layer in model.residual_layers:
        torch.nn.init.ones_(layer.update.norm.weight)  # they begin as nothing
    file = tmp_path / "random.safetensors"
    model.save(file, windows.training)
    true = dempm.open(windows.files[0])
    run = dempm.surrogate.rollout(file, true, device="cpu")
    model = TGNNS.from_safetensors(file)
    # A random network moves points far: a single-precision number of the acceleration is as large as 1e-8 m.
    positions = rollout(model, true, frames=model.config.window + 2)
    assert np.abs(positions - run.position[: len(positions)]).max() < 1e-6
    assert np.abs(positions[-1] - positions[-2]).max() > 1e-4


def test_targets_continue_the_trajectory(data):
    windows = Windows(data, frames=4, noise=0.0)
    assert len(windows) == 3 * (21 - 4)
    norm = windows.normalisation
    for index in (0, 20, len(windows) - 1):
        window = windows[index]
        run = dempm.open(windows.files[index // 17])
        first = index % 17
        assert np.array_equal(window.positions, run.position[first : first + 4])
        before, last = window.positions[-2:]
        acceleration = window.target.double() * norm.acceleration_std + norm.acceleration_mean
        following = last + (last - before) + acceleration
        # The target is in single precision.
        assert np.abs(following.numpy() - run.position[first + 4]).max() < 1e-8
    with pytest.raises(IndexError):
        windows[len(windows)]


def test_statistics_are_those_of_the_data_set(data):
    norm = Windows(data, frames=4, noise=0.0).normalisation
    metadata = json.loads((data / "metadata.json").read_text())
    # Sums of double precision in another order.
    for mine, theirs in (
        (norm.velocity_mean, "vel_mean"),
        (norm.velocity_std, "vel_std"),
        (norm.acceleration_mean, "acc_mean"),
        (norm.acceleration_std, "acc_std"),
    ):
        assert mine.numpy() == pytest.approx(metadata[theirs], rel=1e-9, abs=1e-15)


def test_noise_is_on_the_last_velocity_and_the_target_undoes_it(data):
    torch.manual_seed(1)
    sigma = 1e-3
    quiet, noisy = Windows(data, frames=5, noise=0.0), Windows(data, frames=5, noise=sigma)
    errors, left = [], []
    for index in range(0, len(quiet), 4):
        truth, example = quiet[index].positions, noisy[index]
        norm = noisy.normalisation
        acceleration = example.target.double() * norm.acceleration_std + norm.acceleration_mean
        velocity, true_velocity = (x[-1] - x[-2] for x in (example.positions, truth))
        true_acceleration = quiet[index].target.double() * quiet.normalisation.acceleration_std
        true_acceleration = true_acceleration + quiet.normalisation.acceleration_mean
        errors.append(velocity - true_velocity)
        left.append(velocity + acceleration - (true_velocity + true_acceleration))
    errors = torch.cat(errors)
    # Of 1500 deviates the deviation is known to 2 %.
    assert float(errors.std() / sigma) == pytest.approx(1.0, abs=0.06)
    assert torch.cat(left).abs().max() < 1e-8


def test_windows_of_a_batch_do_not_see_each_other(data):
    windows = Windows(data, frames=4, noise=0.0)
    torch.manual_seed(1)
    model = TGNNS(Config(width=16, frames=4), windows.normalisation)
    chosen = [windows[0], windows[20], windows[-1]]
    batch = collate(chosen)
    alone = torch.cat([model(window.graphs) for window in chosen])
    assert batch.points == [len(window.target) for window in chosen]
    # Sums of single precision.
    assert torch.allclose(model(batch.graphs), alone, atol=1e-5)


def test_a_network_learns_a_batch_of_a_loader_with_workers(data):
    torch.manual_seed(1)
    windows = Windows(data, frames=3, mirror=True)
    loader = DataLoader(windows, batch_size=4, shuffle=True, collate_fn=collate, num_workers=1)
    batch = next(iter(loader))
    model = TGNNS(Config(width=32, hidden_layers=1, message_layers=1, frames=3), windows.normalisation)
    optimiser = torch.optim.Adam(model.parameters(), 3e-3)
    losses = []
    for _ in range(60):
        loss = (model(batch.graphs) - batch.target).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    # 240 points can be learnt by heart.
    assert losses[-1] < 0.5 * losses[0]


def test_a_mirrored_window_is_the_window_of_the_mirrored_run(data, monkeypatch):
    windows = Windows(data, config=Config(width=8, frames=3, obstacles=True), noise=0.0)
    straight = windows[5]
    windows.mirror = True
    monkeypatch.setattr(torch, "rand", lambda *_: torch.tensor(0.0))
    image = windows[5]
    assert torch.allclose(image.positions[..., 0], 2.0 - straight.positions[..., 0])
    # Columns: velocity x, y; walls left, right, below, above.
    node, image_node = straight.graphs[-1].nodes, image.graphs[-1].nodes
    assert torch.allclose(node[:, [2, 3]], image_node[:, [3, 2]], atol=1e-5)
    assert torch.allclose(node[:, 4:], image_node[:, 4:], atol=1e-5)
    norm = windows.normalisation
    physical = [x.target * norm.acceleration_std + norm.acceleration_mean for x in (straight, image)]
    assert torch.allclose(physical[0][:, 0], -physical[1][:, 0], atol=1e-8)


@pytest.mark.parametrize("points", [1, 2, 300])
def test_the_graph_has_all_pairs_within_the_radius(points):
    torch.manual_seed(points)
    positions = torch.rand(points, 2) * torch.tensor([2.0, 0.5])
    receiver, sender = radius_graph(positions, 0.2)
    # Every pair, in double precision; none is within 1e-7 m of the radius.
    distance = torch.cdist(positions.double(), positions.double())
    assert ((distance - 0.2).abs() > 1e-7).all()
    expected = ((distance <= 0.2) & ~torch.eye(points, dtype=torch.bool)).nonzero()
    assert torch.equal(torch.stack([receiver, sender], 1), expected)


def test_errors(data, tmp_path):
    with pytest.raises(dempm.Error, match="no such file"):
        TGNNS.from_safetensors(tmp_path / "none.safetensors")
    with pytest.raises(dempm.Error, match="no weights file"):
        TGNNS.from_safetensors(ROOT / "README.md")
    with pytest.raises(dempm.Error, match="no trajectories"):
        Windows(tmp_path)
    with pytest.raises(dempm.Error, match="too few for windows of 41"):
        Windows(data, frames=40)
    with pytest.raises(dempm.Error, match="'colour'"):
        Config(node_features=("colour",))
    model = TGNNS(Config(width=8, frames=3))
    with pytest.raises(dempm.Error, match="frame_interval"):
        rollout(model, dempm.open(Windows(data, frames=3).files[0]))
    model.training_data = Training(0.013)
    with pytest.raises(dempm.Error, match="0.01 s apart, those of the network 0.013 s"):
        rollout(model, dempm.open(Windows(data, frames=3).files[0]))
