"""Run by YADE itself, in a folder with start.npz and plan.json: steps the balls and leaves end.npz.

The law is that of ViscElPhys, clamped at zero by YADE. YADE puts the values of two materials in series, 1/k = 1/k_1 + 1/k_2,
so that the wall, which is stiffer than the ball's half, gets the negative value that makes the pair's one right.
"""

import json
import time

import numpy as np

from yade import (Bo1_Sphere_Aabb, ForceResetter, Ig2_Sphere_Sphere_ScGeom, InsertionSortCollider, InteractionLoop,
                  Ip2_ViscElMat_ViscElMat_ViscElPhys, Law2_ScGeom_ViscElPhys_Basic, NewtonIntegrator, O, ViscElMat)
from yade.utils import sphere

# Bodies meet if their masks share a bit, unless both have the bit that is to be left out.
ALL, FIXED = 1, 2


def in_series_to(first, pair):
    """The value that gives `pair` in series with `first`."""
    return 1.0 / (1.0 / pair - 1.0 / first)


def material(k, c, density):
    return O.materials.append(ViscElMat(density=density, kn=k, cn=c, ks=0.0, cs=0.0, frictionAngle=0.0))


def add_bodies(start, plan):
    k, c = 2 * plan["k_ball"], 2 * plan["c_ball"]
    ball = material(k, c, plan["density"])
    fixed = material(in_series_to(k, plan["k_wall"]), in_series_to(c, plan["c_wall"]), plan["density"])
    O.bodies.append([sphere(tuple(map(float, x)), float(r), material=ball if moves else fixed, fixed=not moves,
                            mask=ALL if moves else ALL | FIXED)
                     for x, r, moves in zip(start["position"], start["radius"], start["moves"])])
    for body, velocity, moves in zip(O.bodies, start["velocity"], start["moves"]):
        if moves:
            body.state.vel = tuple(map(float, velocity))


def forces(rows):
    return np.array([O.forces.f(int(row)) for row in rows])


def start_half_a_step_back(rows, step, gravity, force):
    """YADE keeps velocities at half steps: without this its start would be off by half a step."""
    for row, f in zip(rows, force):
        state = O.bodies[int(row)].state
        state.vel = tuple(np.array(state.vel) - 0.5 * step * (f / state.mass + gravity))


def main():
    with open("plan.json", encoding="utf-8") as file:
        plan = json.load(file)
    start = np.load("start.npz")
    add_bodies(start, plan)
    O.engines = [ForceResetter(),
                 InsertionSortCollider([Bo1_Sphere_Aabb()], verletDist=plan["skin"], avoidSelfInteractionMask=FIXED),
                 InteractionLoop([Ig2_Sphere_Sphere_ScGeom()], [Ip2_ViscElMat_ViscElMat_ViscElPhys()],
                                 [Law2_ScGeom_ViscElPhys_Basic()]),
                 NewtonIntegrator(damping=0.0, gravity=tuple(plan["gravity"]))]
    rows = np.flatnonzero(start["moves"])
    O.dt = 0.0
    O.step()  # finds the contacts and their forces and moves nothing
    force = forces(rows)
    start_half_a_step_back(rows, plan["step"], np.array(plan["gravity"]), force)
    O.dt = plan["step"]
    began = time.perf_counter()
    if plan["steps"]:
        O.run(plan["steps"], True)
    seconds = time.perf_counter() - began
    np.savez("end.npz", seconds=seconds, force=force, position=np.array([O.bodies[int(row)].state.pos for row in rows]))


main()
