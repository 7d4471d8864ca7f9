"""Collapse of a column of discs in YADE, from the start that `cargo run --example column` writes.

    yade -n -x -j 1 validation/yade/collapse.py DIRECTORY PERTURBATION

reads DIRECTORY/start.csv and writes DIRECTORY/yade-PERTURBATION.csv (time series) and
DIRECTORY/yade-PERTURBATION-end.csv (grains). PERTURBATION is the seed of displacements of 1e-9 m.
"""

import csv
import json
import math
import random
import sys

from yade import *  # noqa: F403

directory, seed = sys.argv[-2], int(sys.argv[-1])
with open(f"{directory}/grains.json") as file:
    grains = json.load(file)
with open(f"{directory}/start.csv") as file:
    rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]

kn, kt = grains["normal_stiffness"], grains["tangential_stiffness"]
zeta = grains["damping_ratio"]


def mass(r):
    return grains["grain_density"] * math.pi * r * r * grains["thickness"]


def material(m, friction):
    """YADE combines the constants of two bodies as springs in series, so each gets twice those of a pair.

    A dashpot of 2 zeta sqrt(2 kn m) is exact for two equal masses, and 5 % too strong for radii of 1 : 2.
    """
    return O.materials.append(
        ViscElMat(
            kn=2 * kn,
            ks=2 * kt,
            cn=2 * zeta * math.sqrt(2 * kn * m),
            cs=0,
            frictionAngle=math.atan(friction),
            density=1,
        )
    )


# In series with a body of (1 + sqrt 2) times the dashpot of a mean grain, that of a grain alone remains.
mean = sum(mass(row["r"]) for row in rows) / len(rows)
fixed_mass = mean * (1 + math.sqrt(2)) ** 2
random.seed(seed)
moving = []
for row in rows:
    m = mass(row["r"])
    fixed = row["fixed"] == 1
    shift = (0, 0) if fixed else (random.uniform(-1e-9, 1e-9), random.uniform(-1e-9, 1e-9))
    body = sphere(
        (row["x"] + shift[0], row["y"] + shift[1], 0),
        row["r"],
        material=material(fixed_mass if fixed else m, grains["friction"]),
        fixed=fixed,
    )
    body.state.mass = m
    body.state.inertia = (0.5 * m * row["r"] ** 2,) * 3
    if not fixed:
        body.state.blockedDOFs = "zXY"
        moving.append(O.bodies.append(body))
    else:
        O.bodies.append(body)
O.bodies.append(wall(0, axis=0, sense=1, material=material(fixed_mass, 0)))

O.engines = [
    ForceResetter(),
    InsertionSortCollider(
        [Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()], verletDist=0.3 * grains["radius_max"]
    ),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom(), Ig2_Wall_Sphere_ScGeom()],
        [Ip2_ViscElMat_ViscElMat_ViscElPhys()],
        [Law2_ScGeom_ViscElPhys_Basic()],
    ),
    NewtonIntegrator(gravity=(0, -9.81, 0), damping=0),
]
O.dt = grains["dt"]

steps = round(grains["sampling"] / O.dt)
with open(f"{directory}/yade-{seed}.csv", "w") as file:
    print("time,front,kinetic,potential", file=file)
    for _ in range(round(grains["duration"] / grains["sampling"]) + 1):
        states = [O.bodies[k].state for k in moving]
        kinetic = sum(
            0.5 * s.mass * s.vel.squaredNorm() + 0.5 * s.inertia[2] * s.angVel[2] ** 2
            for s in states
        )
        potential = sum(9.81 * s.mass * s.pos[1] for s in states)
        # The foremost position that 99 % of the mass stays behind.
        total, behind, front = sum(s.mass for s in states), 0, 0
        for s in sorted(states, key=lambda s: s.pos[0]):
            behind, front = behind + s.mass, s.pos[0]
            if behind >= 0.99 * total:
                break
        print(f"{O.time},{front},{kinetic},{potential}", file=file, flush=True)
        O.run(steps, wait=True)
with open(f"{directory}/yade-{seed}-end.csv", "w") as file:
    print("x,y,r", file=file)
    for k in moving:
        x, y, _ = O.bodies[k].state.pos
        print(f"{x},{y},{O.bodies[k].shape.radius}", file=file)
