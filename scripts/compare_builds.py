#!/usr/bin/env python3
"""Show that two builds compute the same: the same small commands with both, every output compared.

    scripts/compare_builds.py BEFORE AFTER [--device cuda] [--keep FOLDER]

BEFORE and AFTER are folders with the programs `dempm` and `surrogate` (target/release of two
commits). Trajectories, weights, predictions, exports, element tests and tables must agree bit for
bit; only wall times, dates and versions may differ. Needs numpy and h5py. Exit code 1 if anything
differs. About three minutes on two cores.
"""

import argparse
import csv
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parent.parent

SCENE = """
title = "{title}"
seed = {seed}
duration = {duration}
frame_interval = 0.01
step = 1.0e-4
[domain]
size = [2.0, 1.0]
cell = 0.125
{domain}
[[column]]
corner = {corner}
size = [0.5, 0.5]
{column}
[material]
{material}
{more}
"""

PACKINGS = 'kind = "rve"\nprecision = "{precision}"'
SMALL = "[rve]\ndiscs = 50\n"
BOX = "[[obstacle]]\ncorner = [0.75, 0.0]\nsize = [0.25, 0.25]\n"
PLATE = "[plate]\ncorner = [1.0, 0.0]\nsize = [0.25, 0.5]\nvelocity = [-1.0, 0.0]\nstart = 0.01\n"


def scene(title, material, more="", seed=1, duration=0.1, corner=(0.0, 0.0), column="", domain=""):
    return SCENE.format(
        title=title, material=material, more=more, seed=seed, duration=duration,
        corner=list(corner), column=column, domain=domain,
    )  # fmt: skip


# One scene for each thing that the solver can do.
SCENES = {
    "f32": scene("f32", PACKINGS.format(precision="f32"), SMALL),
    "f64": scene("f64", PACKINGS.format(precision="f64"), SMALL, duration=0.03),
    "box": scene("box", PACKINGS.format(precision="f32"), BOX + SMALL, seed=2),
    "plate": scene(
        "plate", PACKINGS.format(precision="f32"), PLATE + SMALL, corner=(0.375, 0.0), seed=3
    ),
    "kinds": scene("kinds", PACKINGS.format(precision="f32") + "\npackings = 3", SMALL, seed=4),
    "fall": scene(
        "fall", PACKINGS.format(precision="f32"), SMALL, corner=(0.5, 0.25),
        column="velocity = [1.0, -2.0]",
    ),
    "points": scene(
        "points", PACKINGS.format(precision="f32"), SMALL + '[numerics]\nwall_contact = "points"\n'
    ),
    "mu-i": scene("mu-i", 'kind = "mu-i"', duration=0.4),
    "elastic": scene("elastic", 'kind = "elastic"'),
    "usf": scene("usf", 'kind = "mu-i"', '[numerics]\nscheme = "usf"\nbasis = "cubic"\n'),
    "usl": scene("usl", 'kind = "mu-i"', '[numerics]\nscheme = "usl"\nbasis = "gimp"\n'),
    "apic": scene("apic", 'kind = "mu-i"', '[numerics]\ntransfer = "apic"\n'),
    "average": scene("average", 'kind = "mu-i"', "[numerics]\ncell_average = true\n"),
}  # fmt: skip

DATA_SET = """
scene = "mu-i.toml"
[[train]]
grid.column.0.corner = [[0.0, 0.0], [0.25, 0.0], [0.75, 0.0], [0.5, 0.25]]
[[valid]]
list.column.0.corner = [[0.125, 0.0]]
[[test]]
list.column.0.corner = [[0.375, 0.0]]
"""

TRAINING = """
steps = 60
batch = 2
log_every = 10
ema = 0.9
[model]
width = 16
hidden_layers = 1
message_layers = 2
frames = {frames}
connection_radius = 0.15
{model}
[data]
noise = 3.0e-4
mirror = true
[schedule]
rate = 2.0e-3
warm_up = 5
[pushforward]
steps = 2
start = 30
[validation]
every = 20
"""
NETWORKS = {"tgnns": (4, ""), "gns": (4, 'kind = "gns"')}


def commands(device):
    """What is run with each build, in a folder that holds the inputs."""
    on = ["--device", device]
    for name in SCENES:
        yield ["dempm", "run", f"{name}.toml", *on]
    yield ["dempm", "dataset", "set.toml", "-o", "set", *on]
    for test in ["biaxial", "simple-shear", "isotropic"]:
        yield ["dempm", "element", f"{test}.toml"]
    for form in ["npz", "vtk"]:
        yield ["dempm", "export", "f32.h5", "--to", form, "-o", f"export.{form}"]
    for form in ["gns", "lagrangebench"]:
        yield ["dempm", "export", "set", "--to", form, "-o", f"export-{form}"]
    for name in ["box", "fall"]:
        yield ["dempm", "plot", f"{name}.h5", "-o", f"{name}.png"]
    for name in NETWORKS:
        yield ["surrogate", "train", f"{name}.toml", "--data", "set", "-o", name, *on]
        yield [
            "surrogate", "rollout", f"{name}/last.safetensors", "--scene", "mu-i.toml",
            "-o", f"{name}.h5", *on,
        ]  # fmt: skip
    yield ["surrogate", "eval", "tgnns/last.safetensors", "--data", "set/test", "-o", "eval", *on]
    yield ["surrogate", "stats", "set"]
    tiny = str(ROOT / "models/tgnns-tiny.safetensors")
    yield ["surrogate", "rollout", tiny, "--scene", "box.toml", "-o", "shipped.h5", *on]


def make(programs, folder, device):
    """Runs all commands in `folder`; the outputs and what was printed stay there."""
    for name, text in SCENES.items():
        (folder / f"{name}.toml").write_text(text)
    (folder / "set.toml").write_text(DATA_SET)
    for name, (frames, model) in NETWORKS.items():
        (folder / f"{name}.toml").write_text(TRAINING.format(frames=frames, model=model))
    for test in (ROOT / "scenes/element").glob("*.toml"):
        text = test.read_text().replace("[rve.preparation]", "[rve]\ndiscs = 60\n[rve.preparation]")
        (folder / test.name).write_text(text)
    environment = dict(os.environ, DEMPM_CACHE_DIR=str(folder / ".cache"))
    for command in commands(device):
        program, *arguments = command
        done = subprocess.run(
            [programs / program, *arguments],
            cwd=folder, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stderr}")
        print(".", end="", flush=True)
    print()


TIMES = re.compile(r"wall|second|time_s|_s$|_ms$|^ms|elapsed|created|versions|rate_per|device|\bs\b")


def hdf5(path):
    """Every data set and attribute of a trajectory, but what says when and where it was made."""
    values = {}

    def add(name, item):
        if isinstance(item, h5py.Dataset):
            values[name] = (item.dtype.str, item.shape, item[()].tobytes())
        for key, value in item.attrs.items():
            place = f"{name}@{key}"
            if not any(word in place for word in ["created", "wall_time", "versions", "device"]):
                value = np.asarray(value)
                values[place] = (value.dtype.str, value.shape, value.tobytes())

    with h5py.File(path) as file:
        add("/", file)
        file.visititems(add)
    return values


def table(path):
    """A CSV file by columns, without times."""
    rows = list(csv.reader(path.open()))
    keep = [k for k, name in enumerate(rows[0]) if not TIMES.search(name)] if rows else []
    return {f"row {i}": [row[k] for k in keep if k < len(row)] for i, row in enumerate(rows)}


def contents(path):
    """Named parts of a file that must be alike."""
    if path.suffix == ".h5":
        return hdf5(path)
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=True) as file:
            return {k: repr(file[k].tolist()) for k in file.files if "wall" not in k}
    if path.suffix == ".csv":
        return table(path)
    if path.suffix == ".json":
        values = json.loads(path.read_text())
        return {k: v for k, v in values.items() if not TIMES.search(k)} if isinstance(
            values, dict) else {"": values}  # fmt: skip
    return {"bytes": hashlib.sha256(path.read_bytes()).hexdigest()}


# Pictures and logs are for people; checkpoints end with their runs.
PASSED_OVER = {".png", ".svg", ".toml", ".log", ".ckpt", ".lock", ".html", ".md"}


def files(folder):
    found = (p for p in sorted(folder.rglob("*")) if p.is_file())
    return {
        str(p.relative_to(folder)): p
        for p in found
        if p.suffix not in PASSED_OVER and ".cache" not in p.parts
    }


def compare(before, after):
    """Prints what differs; returns the number of files that do."""
    first, second = files(before), files(after)
    different = 0
    for name in sorted(first.keys() | second.keys()):
        if name not in first or name not in second:
            print(f"{name}: only {'before' if name in first else 'after'}")
            different += 1
            continue
        a, b = contents(first[name]), contents(second[name])
        parts = [key for key in sorted(a.keys() | b.keys()) if a.get(key) != b.get(key)]
        if parts:
            print(f"{name}: {', '.join(parts[:6])}{' ...' if len(parts) > 6 else ''}")
            different += 1
    print(f"{len(first)} files compared, {different} differ")
    return different


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--keep", type=Path, help="keep the outputs in this folder")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or Path(temporary)
        for name in ["before", "after"]:
            made = folder / name
            if arguments.keep and made.exists():
                continue
            made.mkdir(parents=True)
            make(getattr(arguments, name).resolve(), made, arguments.device)
        sys.exit(1 if compare(folder / "before", folder / "after") else 0)


if __name__ == "__main__":
    main()
