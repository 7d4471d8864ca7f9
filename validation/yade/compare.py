#!/usr/bin/env python3
"""dem against YADE: one packing, one shear path, stresses and speed side by side.

    python3 validation/yade/compare.py [--dempm target/release/dempm] [--yade yade] [--discs 400]

Needs the Debian package `yade`. Both run on one thread. Dense packing at 20 kPa, no history;
constant-volume simple shear at 1/s to a strain of 0.5; Cundall damping 0.2, no dashpot.
"""

import argparse
import csv
import json
import math
import os
import pathlib
import re
import subprocess
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
KN, DENSITY, THICKNESS, FRICTION, ALPHA = 1e5, 2650.0, 7.5e-3, 0.5, 0.2
R_MIN, MACRO_STEP, SHEAR_RATE, STRAIN, ROWS = 2.5e-3, 1e-4, 1.0, 0.5, 500

TEST = """
macro_step = {macro_step}
sampling = {sampling}
{packing}

[grains]
damping_ratio = 0.0
local_damping = {alpha}

[rve]
discs = {discs}

[rve.preparation]
pressure = 20e3

[[stage]]
kind = "constant-volume-shear"
shear_rate = {shear_rate}
strain = {strain}
"""


def rows(path):
    with open(path) as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def invariants(row):
    p = -0.5 * (row["sxx"] + row["syy"])
    q = math.hypot(0.5 * (row["sxx"] - row["syy"]), 0.5 * (row["sxy"] + row["syx"]))
    return p, q


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--dempm", default="target/release/dempm")
    parser.add_argument("--yade", default="yade")
    parser.add_argument("--discs", type=int, default=400)
    parser.add_argument("--json", help="file for speeds and paths")
    args = parser.parse_args()
    m_min = DENSITY * math.pi * R_MIN**2 * THICKNESS
    substeps = math.ceil(MACRO_STEP / (0.2 * math.sqrt(m_min / KN)))
    dt = MACRO_STEP / substeps
    environment = {**os.environ, "RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}

    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)

        def write(name, packing, strain):
            text = TEST.format(
                macro_step=MACRO_STEP,
                sampling=STRAIN / SHEAR_RATE / ROWS,
                packing=packing,
                discs=args.discs,
                alpha=ALPHA,
                shear_rate=SHEAR_RATE,
                strain=strain,
            )
            (folder / name).write_text(text)
            return folder / name

        def dempm(test, output, *more):
            start = time.perf_counter()
            command = [args.dempm, "element", str(test), "-o", str(output), *map(str, more)]
            subprocess.run(command, check=True, env=environment, stderr=subprocess.DEVNULL)
            return time.perf_counter() - start

        packing = folder / "packing.csv"
        dempm(write("make.toml", "", 1e-4), folder / "made.csv", "--dump-packing", packing)
        # The time to start and to read is measured by a path of one macro step.
        loaded = 'packing = "packing.csv"'
        idle = dempm(write("idle.toml", loaded, 1e-4), folder / "idle.csv")
        test = write("ours.toml", loaded, STRAIN)
        speeds = {}
        for precision in ["f32", "f64"]:
            seconds = dempm(test, folder / f"{precision}.csv", "--precision", precision)
            disc_steps = args.discs * substeps * STRAIN / SHEAR_RATE / MACRO_STEP
            speeds[precision] = disc_steps / (seconds - idle)

        numbers = [SHEAR_RATE, STRAIN, dt, KN, DENSITY, THICKNESS, FRICTION, ALPHA]
        command = [args.yade, "-x", "-n", "-j1", str(HERE / "shear.py"), str(packing)]
        command += [str(folder / "yade.csv"), *map(str, numbers)]
        output = subprocess.run(command, check=True, env=environment, capture_output=True, text=True)
        seconds, disc_steps = re.search(r"stepping (\S+) s, (\d+) disc", output.stdout).groups()
        speeds["yade"] = int(disc_steps) / float(seconds)

        paths = {name: rows(folder / f"{name}.csv") for name in ["f64", "f32", "yade"]}
        paths["f64"].pop(0)
        paths["f32"].pop(0)

    if args.json:
        path = {k: [[row["exy"], *invariants(row)] for row in rows] for k, rows in paths.items()}
        pathlib.Path(args.json).write_text(json.dumps({"speed": speeds, "path": path}))
    print(f"{args.discs} discs, DEM step {dt:.3e} s")
    for name, speed in speeds.items():
        print(f"{name:5} {speed:.2e} disc-steps/s, {speed / speeds['yade']:.1f} x YADE")
    print("strain   p f64    p f32    p YADE  (kPa)   q/p f64  f32   YADE")
    for k in [0, 1, 4, 9, 19, 49, 99, 199, 299, 399, 499]:
        pq = {name: invariants(path[k]) for name, path in paths.items()}
        ps = " ".join(f"{pq[n][0] / 1e3:8.3f}" for n in paths)
        qs = " ".join(f"{pq[n][1] / pq[n][0]:6.3f}" for n in paths)
        print(f"{paths['f64'][k]['exy']:.4f} {ps}         {qs}")
    for first, last in [(0, 5), (5, 100), (100, 500)]:
        for other in ["yade", "f32"]:
            differences = [
                abs(invariants(a)[0] - invariants(b)[0]) / invariants(a)[0]
                for a, b in zip(paths["f64"][first:last], paths[other][first:last])
            ]
            mean = sum(differences) / len(differences)
            strains = [paths["f64"][k - 1]["exy"] if k else 0.0 for k in (first, last)]
            print(
                f"strain {strains[0]:.3f} to {strains[1]:.3f}: "
                f"mean |p_{other} / p_f64 - 1| = {mean:.4f}"
            )


if __name__ == "__main__":
    main()
