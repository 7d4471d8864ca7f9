#!/usr/bin/env python3
"""Parallel efficiency of a scene on the CPU: runs with one and with several threads in alternation.

    python3 scripts/thread_efficiency.py scenes/discs.toml --duration 0.1

Efficiency is T(1) / (N T(N)), of the shortest times of each: other programs only make runs longer. Times are those of the
phase that computes, `dem` or `rve`; preparations are made by a first run and cached.
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import tempfile

#: Phases that are spread over threads; a scene has one of them.
PHASES = ("dem", "rve")


def seconds(program, scene, output, threads):
    """Time of the phase that computes, s."""
    command = [program, "run", scene, "-o", output, "--overwrite", "--device", "cpu", "--json", "--quiet"]
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    if run.returncode:
        raise SystemExit(run.stderr)
    phases = json.loads(run.stdout)["summary"]["wall_time"]
    return next(phases[name] for name in PHASES if name in phases)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=pathlib.Path)
    parser.add_argument("--program", default="target/release/dempm")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--duration", type=float, help="of the run, s; that of the scene by default")
    options = parser.parse_args()
    text = options.scene.read_text()
    if options.duration is not None:
        text = re.sub(r"(?m)^duration *=.*", f"duration = {options.duration!r}", text)
    counts = (1, options.threads)
    times = {threads: [] for threads in counts}
    with tempfile.TemporaryDirectory() as folder:
        scene, output = pathlib.Path(folder, "scene.toml"), pathlib.Path(folder, "run.h5")
        scene.write_text(text)
        seconds(options.program, scene, output, options.threads)
        for _ in range(options.repeats):
            for threads in counts:
                times[threads].append(seconds(options.program, scene, output, threads))
    for threads in counts:
        print(f"{threads} threads: {', '.join(f'{time:.2f}' for time in times[threads])} s")
    one, several = (min(times[threads]) for threads in counts)
    print(f"efficiency {one / (options.threads * several):.2f}")


if __name__ == "__main__":
    main()
