#!/usr/bin/env python3
"""Writes the tables of scenes/calibrate that are means over packings of known grains: `sand-biaxial.csv` and
`sand-shear.csv`.

    scripts/sand_tables.py [program]       # target/release/dempm

Four packings of 400 discs with friction 0.8, rolling friction 0.4 and normal stiffness 2e5 N/m at 100 kPa, prepared with
friction 0.001, in tests at the inertial numbers 1.25e-4 (biaxial) and 2.5e-4, to a little beyond the peak.
"""

import csv
import math
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent / "scenes/calibrate"
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "target/release/dempm"
SEEDS = range(101, 105)
HEAD = """seed = {seed}
sampling = {sampling}
[grains]
friction = 0.8
rolling_friction = 0.4
normal_stiffness = 2e5
[rve]
free_solid_fraction = 0.0
[rve.preparation]
pressure = 100e3
[[stage]]
pressure = 100e3
"""
#: Shear rate (1/s) of an inertial number of 2.5e-4.
RATE = 2.5e-4 / 7.5e-3 * math.sqrt(100e3 / 2650)
TESTS = {
    "biaxial": (f'kind = "biaxial"\nshortening_rate = {0.25 * RATE}\nstrain = 0.07\n', 0.0025 / 0.25 / RATE),
    "shear": (f'kind = "constant-pressure-shear"\nshear_rate = {RATE}\nstrain = 0.12\n', 0.005 / RATE),
}
#: Columns of the tables, and their values in a row of a path.
COLUMNS = {
    "biaxial": {
        "axial_strain [%]": lambda row: 100 * (1 - math.exp(row["eyy"])),
        "deviatoric_stress [kPa]": lambda row: 1e-3 * (row["sxx"] - row["syy"]),
        "volumetric_strain [%]": lambda row: 100 * (1 - math.exp(row["exx"] + row["eyy"])),
    },
    "shear": {
        "shear_strain [%]": lambda row: 100 * row["exy"],
        "shear_stress [kPa]": lambda row: 1e-3 * row["sxy"],
        "volumetric_strain [%]": lambda row: 100 * (1 - math.exp(row["exx"] + row["eyy"])),
    },
}


def path(test, seed):
    """Rows of a path, as dictionaries of numbers."""
    stage, sampling = TESTS[test]
    with tempfile.TemporaryDirectory() as folder:
        file, output = Path(folder, "test.toml"), Path(folder, "path.csv")
        file.write_text(HEAD.format(seed=seed, sampling=sampling) + stage)
        subprocess.run([PROGRAM, "element", file, "--output", output, "--quiet"], check=True)
        with output.open() as lines:
            rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(lines)]
    # Stresses of a row are means over its interval: so are strains.
    for before, row in reversed(list(zip(rows, rows[1:]))):
        row.update({name: (before[name] + row[name]) / 2 for name in ("exx", "exy", "eyy")})
    return rows


for test, columns in COLUMNS.items():
    paths = [path(test, seed) for seed in SEEDS]
    lines = [f"# {test.capitalize()} test at 100 kPa: mean of {len(SEEDS)} packings of 400 discs with friction 0.8,",
             "# rolling_friction 0.4 and normal_stiffness 2e5 N/m (scripts/sand_tables.py).", ",".join(columns)]
    for rows in zip(*paths):
        means = [sum(of(row) for row in rows) / len(rows) for of in columns.values()]
        lines.append(",".join(f"{mean:.4f}" for mean in means))
    (FOLDER / f"sand-{test}.csv").write_text("\n".join(lines) + "\n")
    print(f"sand-{test}.csv: {len(lines) - 3} rows")
