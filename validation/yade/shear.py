"""Constant-volume simple shear of a dumped packing in YADE.

    yade -x -n -j1 shear.py PACKING.csv PATH.csv SHEAR_RATE STRAIN DT KN DENSITY THICKNESS FRICTION ALPHA

PACKING.csv is written by `dempm element --dump-packing`. The discs are spheres held in the plane,
with the mass, the moment of inertia and the constant contact stiffness kn = kt of the discs. Both
codes use Cundall damping ALPHA and no dashpot; YADE damps with the velocity half a step later.
Granular ratcheting correction is off: forces act at r - overlap / 2, as in dem.

PATH.csv has the columns of `dempm element` that YADE can fill; stresses are tension positive. The
last line of the output is the time spent stepping, without sampling, and the number of disc-steps.
"""

import csv
import math
import sys
import time

from yade import *
from yade import utils

packing_path, path_path = sys.argv[1:3]
shear_rate, strain, dt, kn, density, thickness, friction, alpha = map(float, sys.argv[3:11])
ROWS = 500
SAMPLES_PER_ROW = 5

with open(packing_path) as file:
    lines = list(csv.reader(file))
hxx, hxy, hyx, hyy = map(float, lines[0][1:])
discs = [tuple(map(float, line)) for line in lines[1:]]

# Deep enough that no sphere meets its image across the plane.
depth = 0.1
O.periodic = True
O.cell.hSize = Matrix3(hxx, hxy, 0, hyx, hyy, 0, 0, 0, depth)
for x, y, r in discs:
    # Two springs of stiffness E D in series give kn for every pair; poisson is kt / kn.
    material = FrictMat(
        young=kn / r, poisson=1.0, frictionAngle=math.atan(friction), density=density
    )
    body = utils.sphere((x, y, depth / 2), r, material=material)
    mass = density * math.pi * r * r * thickness
    body.state.mass = mass
    body.state.inertia = Vector3(1, 1, 1) * (0.5 * mass * r * r)
    body.state.blockedDOFs = "zXY"
    # Discs turn with the cell from the start, as in dem.
    body.state.angVel = Vector3(0, 0, -shear_rate / 2)
    O.bodies.append(body)

O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()], verletDist=0.3 * max(d[2] for d in discs)),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False)],
        [Ip2_FrictMat_FrictMat_FrictPhys()],
        [Law2_ScGeom_FrictPhys_CundallStrack()],
    ),
    NewtonIntegrator(damping=alpha),
]
O.dt = dt
O.cell.homoDeform = 2
O.cell.velGrad = Matrix3(0, shear_rate, 0, 0, 0, 0, 0, 0, 0)

steps = round(strain / shear_rate / dt)
period = steps // (ROWS * SAMPLES_PER_ROW)
solid = sum(math.pi * r * r for _, _, r in discs)
samples = []
sampling = 0.0


def sample():
    global sampling
    start = time.perf_counter()
    s = utils.getStress() * (depth / thickness)
    contacts = sum(1 for i in O.interactions if i.isReal)
    area = O.cell.volume / depth
    sample = [O.time, 0.0, shear_rate * O.time, 0.0, 0.0, s[0, 0], s[0, 1], s[1, 0], s[1, 1]]
    samples.append(sample + [solid / area, 2 * contacts / len(discs)])
    sampling += time.perf_counter() - start


# Inside the run: to stop and to start again costs YADE much longer than a step.
O.engines += [PyRunner(command="sample()", iterPeriod=period, initRun=False)]
start = time.perf_counter()
# The engines of the last step come before its sample is due.
O.run(steps + 1, True)
elapsed = time.perf_counter() - start - sampling

with open(path_path, "w") as file:
    file.write("t,exx,exy,eyx,eyy,sxx,sxy,syx,syy,solid_fraction,coordination\n")
    for k in range(0, len(samples) - SAMPLES_PER_ROW + 1, SAMPLES_PER_ROW):
        chunk = samples[k : k + SAMPLES_PER_ROW]
        mean = [sum(column) / len(chunk) for column in zip(*chunk)]
        # As in dem: time and strain at the end of the row, averages over it.
        row = chunk[-1][:5] + mean[5:]
        file.write(",".join(f"{x:.9e}" for x in row) + "\n")
print(f"stepping {elapsed:.6f} s, {O.iter * len(discs)} disc-steps")
