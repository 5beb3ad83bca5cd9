#!/usr/bin/python3
"""Writes the start states pair.csv, chain.csv and pile.csv of the small studies; they are kept in the repository.

Balls as in the paper's silo: radii uniform in [0.215, 0.225] m. The random numbers are Python's own generator
with fixed seeds, so that the files come out the same everywhere.
"""
import math
import pathlib
import random

SMALLEST, LARGEST = 0.215, 0.225  # m
K_BALL = 1e7  # N/m
K_WALL = 1e9  # N/m


def radius(rng):
    return rng.uniform(SMALLEST, LARGEST)


def pair():
    """32 pairs far apart, each about to collide with an approach speed and at a moment of its own."""
    rng = random.Random(1)
    for p in range(32):
        r0, r1 = radius(rng), radius(rng)
        speed = 0.2 * 10.0 ** rng.random()  # m/s, approach: 0.2 to 2
        gap = speed * rng.uniform(0.0, 4e-3)  # m: touches within the first 4 ms
        axis = [rng.gauss(0.0, 1.0) for _ in range(3)]
        length = math.sqrt(sum(a * a for a in axis))
        axis = [a / length for a in axis]
        centre = (2.0 * (p % 8), 2.0 * (p // 8), 0.0)
        for side, r in ((-1.0, r0), (1.0, r1)):
            offset = 0.5 * side * (r0 + r1 + gap)
            yield ("content", [c + offset * a for c, a in zip(centre, axis)], [-0.5 * side * speed * a for a in axis], r)


def chain():
    """24 balls in a row between two fixed ones, pressed together by 4 kN, with a pulse coming in from one end."""
    rng = random.Random(2)
    press = 4e3  # N
    radii = [radius(rng) for _ in range(26)]
    x = 0.0
    for b, r in enumerate(radii):
        at_end = b in (0, len(radii) - 1)
        velocity = 0.2 * math.exp(-(((b - 4) / 2.0) ** 2)) if not at_end else 0.0  # m/s
        yield ("wall" if at_end else "content", [x, 0.0, 0.0], [velocity, 0.0, 0.0], r)
        if b + 1 < len(radii):
            stiffness = K_WALL if b in (0, len(radii) - 2) else K_BALL
            x += r + radii[b + 1] - press / stiffness


def pile():
    """48 loose balls that fall onto a floor of 9 x 9 fixed ones."""
    rng = random.Random(3)
    d = 0.45  # m
    for layer in range(3):
        for i in range(4):
            for j in range(4):
                at = [d * (i + 0.5 * (layer % 2)), d * (j + 0.5 * (layer % 2)), 0.46 + 0.36 * layer]
                at = [a + rng.uniform(-0.004, 0.004) for a in at]
                velocity = [rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), -rng.uniform(0.3, 1.5)]
                yield ("content", at, velocity, radius(rng))
    for i in range(9):
        for j in range(9):
            yield ("wall", [0.42 * (i - 2.3), 0.42 * (j - 2.3), 0.0], [0.0, 0.0, 0.0], radius(rng))


def write(name, balls):
    lines = ["id,kind,x,y,z,vx,vy,vz,radius"]
    for ball, (kind, position, velocity, r) in enumerate(balls):
        lines.append(",".join([str(ball), kind] + ["%.17g" % value for value in [*position, *velocity, r]]))
    pathlib.Path(__file__).with_name(name + ".csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    for scene in (pair, chain, pile):
        write(scene.__name__, scene())
