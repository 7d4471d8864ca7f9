#!/usr/bin/env python3
"""Critical state of packings over the coefficient of rolling friction, as a table.

    python3 scripts/rolling_table.py [PATH-OF-DEMPM]

Simple shear at 20 kPa and an inertial number of 1e-3 to a shear strain of 1.5, six packings of 200 discs each: means
over the last third. Two minutes on two cores. Needs numpy.
"""

import concurrent.futures
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np

ROLLING = [0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0]
FRICTION = [0.5, 1.0]
SEEDS = range(1, 7)
RATE = 1e-3 / 7.5e-3 * (20e3 / 2650) ** 0.5

TEST = """
sampling = {sampling}
seed = {seed}
[grains]
friction = {friction}
rolling_friction = {rolling}
[rve]
discs = 200
[rve.preparation]
pressure = 20e3
[[stage]]
kind = "constant-pressure-shear"
pressure = 20e3
shear_rate = {rate}
strain = 1.5
"""


def sheared(dempm, folder, friction, rolling, seed):
    """sin phi, solid fraction and contacts per disc in the last third."""
    name = pathlib.Path(folder) / f"{friction}-{rolling}-{seed}.toml"
    name.write_text(TEST.format(sampling=0.02 / RATE, seed=seed, friction=friction, rolling=rolling, rate=RATE))
    done = subprocess.run(
        [dempm, "element", name, "-o", name.with_suffix(".csv"), "--precision", "f32"],
        capture_output=True, text=True, check=True,
    )
    line = re.search(r"last third: (.*)", done.stderr).group(1)
    return [float(re.search(rf"{word} ([0-9.]+)", line).group(1)) for word in ("sin phi", "solid fraction", "coordination")]


def main():
    dempm = sys.argv[1] if len(sys.argv) > 1 else "dempm"
    cases = [(friction, rolling) for friction in FRICTION for rolling in ROLLING]
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(2) as pool:
        runs = {
            case: [pool.submit(sheared, dempm, folder, *case, seed) for seed in SEEDS] for case in cases
        }
        print("| friction | rolling friction | sin phi | angle | solid fraction | contacts |")
        print("|---|---|---|---|---|---|")
        for (friction, rolling), tests in runs.items():
            values = np.array([test.result() for test in tests])
            (sine, solid, contacts), spread = values.mean(axis=0), values[:, 0].std(ddof=1)
            angle = np.degrees(np.arcsin(sine))
            print(f"| {friction:g} | {rolling:g} | {sine:.3f} ± {spread:.3f} | {angle:.1f}° | {solid:.3f} | {contacts:.2f} |")


if __name__ == "__main__":
    main()
