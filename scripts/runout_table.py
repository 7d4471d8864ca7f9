#!/usr/bin/env python3
"""Run-out of the columns of a data set, grouped by everything but the seed.

    python3 scripts/runout_table.py out/runout

For a column against the left wall, of width L and height H: the front is where 99 % of the mass lies to the
left of it at the end, at the last point, or where the last grain is that a layer connects to the pile; run-out
(front - L) / L; beside it 2.5 a and 3.25 a^0.7 of Staron & Hinch (2005), J. Fluid Mech. 545, 1, for discs. With `output.grains_every` also the slope of the flank, between 20 and 80 % of the final
height. Needs h5py and numpy.
"""

import pathlib
import re
import sys
import tomllib
from collections import defaultdict

import h5py
import numpy as np


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def slope(file, diameter):
    """Slope (degrees) of the flank: a line through the highest grains of strips three diameters wide."""
    if "grains" not in file:
        return np.nan
    x, y = file["grains/position"][-1].T
    top = y + file["grains/radius"][:]
    strip = (x / (3 * diameter)).astype(int)
    surface = np.array([((k + 0.5) * 3 * diameter, top[strip == k].max()) for k in np.unique(strip)])
    high = surface[:, 1].max()
    flank = surface[(surface[:, 1] >= 0.2 * high) & (surface[:, 1] <= 0.8 * high)]
    return np.degrees(np.arctan(-np.polyfit(*flank.T, 1)[0])) if len(flank) > 1 else np.nan


def measured(path):
    """Settings without the seed; run-out by the three fronts, final height at the wall over H, and slope."""
    with h5py.File(path) as file:
        if text(file.attrs["status"]) != "finished":
            raise SystemExit(f"{path}: {text(file.attrs['status'])}")
        scene = tomllib.loads(text(file.attrs["scene"]))
        position = file["position"][-1]
        mass = file["points/mass"][:]
        connected = file["budget/front_connected"][-1]
        grains = scene.get("grains", {})
        radii = grains.get("radius_min", 2.5e-3), grains.get("radius_max", 5e-3)
        angle = slope(file, sum(radii))
    order = np.argsort(position[:, 0])
    share = np.cumsum(mass[order]) / mass.sum()
    x = position[order, 0]
    width, height = scene["column"][0]["size"]
    front = x[np.searchsorted(share, 0.99)]
    near = position[position[:, 0] < 0.1 * width + x[0], 1]
    settings = (
        height / width,
        scene.get("discs", {}).get("floor", "rough"),
        grains.get("friction", 0.5),
        grains.get("rolling_friction", 0.0),
        grains.get("preparation_friction", 1e-3),
        grains.get("radius_max", 5e-3) / 5e-3,
    )
    fronts = front, x[-1], connected
    return settings, (*((x - width) / width for x in fronts), near.max() / height, angle)


def main():
    rows = defaultdict(list)
    for path in sorted(pathlib.Path(sys.argv[1]).rglob("*.h5")):
        if re.fullmatch(r"\d+\.h5", path.name):
            settings, values = measured(path)
            rows[settings].append(values)
    print("| a | floor | friction | rolling | preparation | size | runs | run-out, 99 % | last point | connected | height | slope | 2.5 a; 3.25 a^0.7 |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    for settings, values in sorted(rows.items()):
        a, floor, friction, rolling, preparation, size = settings
        mean, spread = np.mean(values, axis=0), np.std(values, axis=0, ddof=1) if len(values) > 1 else [np.nan] * 5
        told = [f"{m:.2f}" + (f" ± {s:.2f}" if np.isfinite(s) else "") for m, s in zip(mean, spread)]
        law = 2.5 * a if a < 2 else 3.25 * a**0.7
        print(f"| {a:g} | {floor} | {friction:g} | {rolling:g} | {preparation:g} | {size:g} | {len(values)} | {' | '.join(told)} | {law:.2f} |")


if __name__ == "__main__":
    main()
