"""Runs that several tests read."""

import sys
from pathlib import Path

import pytest

import dempm

ROOT = Path(__file__).resolve().parents[2]
#: Programs of the environment that the package is installed in.
BIN = Path(sys.executable).parent

#: A column of 64 packings of 32 discs for 0.1 s: a second on two cores.
SCENE = {
    "title": "Coarse column",
    "duration": 0.1,
    "domain": {"size": [2.0, 1.0], "cell": 0.125},
    "column": [{"size": [0.5, 0.5]}],
    "material": {"kind": "rve", "packings": 2},
    "rve": {"discs": 32},
}

#: The same under a continuum law, in no time.
LAW = {**{key: SCENE[key] for key in ("title", "duration", "domain", "column")}, "material": {"kind": "mu-i"}}


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> dempm.Run:
    path = tmp_path_factory.mktemp("run") / "coarse.h5"
    with pytest.warns(UserWarning, match="2 packings of 32 discs make a noisy material"):
        return dempm.run(SCENE, path, device="cpu")


@pytest.fixture(scope="session")
def learned() -> dempm.Run:
    """A prediction of the network that ships, 30 frames of the scene that it has learnt."""
    model, scene = ROOT / "models/tgnns-tiny.safetensors", ROOT / "scenes/column-paper.toml"
    return dempm.surrogate.rollout(model, scene, frames=30, device="cpu")
