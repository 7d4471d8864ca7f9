"""The learned simulator in PyTorch: windows of trajectories as graphs, the network in plain PyTorch, and rollouts.

    from torch.utils.data import DataLoader
    from dempm.torch import TGNNS, Windows, collate, rollout

    data = Windows("data/train", frames=6, noise=3e-4)
    model = TGNNS(data.config, data.normalisation)
    for batch in DataLoader(data, batch_size=2, shuffle=True, collate_fn=collate):
        loss = (model(batch.graphs) - batch.target).square().sum() / batch.target.square().sum()
        ...
    model.save("mine.safetensors", data.training)  # for `surrogate rollout` and `eval`

    model = TGNNS.from_safetensors("models/tgnns-tiny.safetensors")
    positions = rollout(model, dempm.open("column.h5"))  # (frames, points, 2), m

It needs `torch` and `safetensors`: `pip install 'dempm[torch]'`.
"""

try:
    import safetensors as _safetensors  # noqa: F401
    import torch as _torch  # noqa: F401
except ImportError as error:
    raise ImportError(f"dempm.torch needs {error.name}: pip install 'dempm[torch]'") from error

from ._config import Config, Training
from ._features import Boxes, Graph, radius_graph
from ._network import TGNNS, Normalisation
from ._rollout import rollout
from ._windows import Batch, Window, Windows, collate

__all__ = [
    "Batch",
    "Boxes",
    "Config",
    "Graph",
    "Normalisation",
    "TGNNS",
    "Training",
    "Window",
    "Windows",
    "collate",
    "radius_graph",
    "rollout",
]
