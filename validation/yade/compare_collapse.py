#!/usr/bin/env python3
"""Collapses of one column in dem and in YADE: differences beside the spread between perturbations.

    python3 validation/yade/compare_collapse.py DIRECTORY...

Each DIRECTORY holds the runs of one start, dem-K.csv and yade-K.csv. Means over the runs of each code;
spread: root mean square over starts of the standard deviation between runs of one start and code.
"""

import csv
import math
import pathlib
import statistics
import sys

STRIP = 0.1


def rows(path):
    with open(path) as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def profile(path):
    """Height (m) of the highest grain in each strip of STRIP metres, 0 to 1 m."""
    heights = [0.0] * round(1 / STRIP)
    for grain in rows(path):
        strip = int(grain["x"] / STRIP)
        if strip < len(heights):
            heights[strip] = max(heights[strip], grain["y"] + grain["r"])
    return heights


def figures(path):
    """What is compared of one run."""
    series = rows(path)
    first, last = series[0], series[-1]
    at = {round(row["time"], 2): row for row in series}
    kinetic = max(row["kinetic"] for row in series)
    found = {f"front at {t} s (m)": at[t]["front"] for t in (0.2, 0.4, 0.6)}
    found["front at the end (m)"] = last["front"]
    found["largest kinetic energy (J)"] = kinetic
    for t in (0.1, 0.3, 0.5):
        found[f"kinetic energy at {t} s (J)"] = at[t]["kinetic"]
    found["released energy (J)"] = first["potential"] - last["potential"]
    for k, height in enumerate(profile(path.with_name(path.stem + "-end.csv"))[:9]):
        found[f"height, {k * STRIP:.1f} to {(k + 1) * STRIP:.1f} m (m)"] = height
    return found


def main():
    runs = {
        (directory, code): [figures(p) for p in sorted(directory.glob(f"{code}-?.csv"))]
        for directory in map(pathlib.Path, sys.argv[1:])
        for code in ("dem", "yade")
    }
    counts = {code: sum(len(r) for (_, c), r in runs.items() if c == code) for code in ("dem", "yade")}
    print(f"| | dem ({counts['dem']} runs) | YADE ({counts['yade']} runs) | difference | spread |")
    print("|---|---|---|---|---|")
    starts = sorted({directory for directory, _ in runs})
    for name in next(iter(runs.values()))[0]:
        values = {key: [figure[name] for figure in found] for key, found in runs.items()}
        means = {
            code: statistics.mean(statistics.mean(values[start, code]) for start in starts)
            for code in ("dem", "yade")
        }
        variances = [statistics.variance(v) for v in values.values() if len(v) > 1]
        spread = math.sqrt(statistics.mean(variances))
        difference = means["dem"] - means["yade"]
        print(
            f"| {name} | {means['dem']:.4f} | {means['yade']:.4f} | {difference:+.4f} | {spread:.4f} |"
        )


if __name__ == "__main__":
    main()
