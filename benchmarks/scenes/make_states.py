#!/usr/bin/python3
"""Start states of the small studies: without arguments writes pair.csv, chain.csv and pile.csv beside this script, which
are kept in the repository; with a name, one of OTHERS, prints what make_starts.sh goes on with. `fines` reads the packing
that it fills from the standard input.

Balls as in the paper's silo: radii uniform in [0.215, 0.225] m. The random numbers are Python's own generator
with fixed seeds, so that the files come out the same everywhere.
"""
import csv
import math
import pathlib
import random
import sys

SMALLEST, LARGEST = 0.215, 0.225  # m
K_BALL = 1e7  # N/m
K_WALL = 1e9  # N/m
REST = [0.0, 0.0, 0.0]  # m/s


def radius(rng):
    return rng.uniform(SMALLEST, LARGEST)


def direction(rng):
    axis = [rng.gauss(0.0, 1.0) for _ in range(3)]
    length = math.sqrt(sum(a * a for a in axis))
    return [a / length for a in axis]


def jittered(rng, at, most):
    return [a + rng.uniform(-most, most) for a in at]


def pair():
    """32 pairs far apart, each about to collide with an approach speed and at a moment of its own."""
    rng = random.Random(1)
    for p in range(32):
        r0, r1 = radius(rng), radius(rng)
        speed = 0.2 * 10.0 ** rng.random()  # m/s, approach: 0.2 to 2
        gap = speed * rng.uniform(0.0, 4e-3)  # m: touches within the first 4 ms
        axis = direction(rng)
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
                at = jittered(rng, at, 0.004)
                velocity = [rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), -rng.uniform(0.3, 1.5)]
                yield ("content", at, velocity, radius(rng))
    for i in range(9):
        for j in range(9):
            yield ("wall", [0.42 * (i - 2.3), 0.42 * (j - 2.3), 0.0], REST, radius(rng))


def gas():
    """4,096 balls that fly about, each as fast as any other on average."""
    rng = random.Random(4)
    for site in range(16**3):
        at = [0.47 * ((site // 16**k) % 16) for k in range(3)]  # m
        yield ("content", jittered(rng, at, 0.01), [rng.gauss(0.0, 2.0) for _ in range(3)], radius(rng))


def stream():
    """2,744 balls side by side move down upon one large fixed ball and jostle each other."""
    rng = random.Random(5)
    for site in range(14**3):
        i, j, k = site % 14, site // 14 % 14, site // 196
        at = [0.45 * (i - 6.5), 0.45 * (j - 6.5), 0.45 * k + 0.83]  # m
        yield ("content", jittered(rng, at, 0.003), jittered(rng, [0.0, 0.0, -2.0], 0.4), radius(rng))
    yield ("wall", [0.0, 0.0, 0.0], REST, 0.6)


# The box that large balls fill and that fines must not leave: its own balls overlap, gaps between them are narrower
# than a fine.
SIDE, HEIGHT, SPACING = 6.6, 6.0, 0.32  # m
FINE = 0.22 / 8.0  # m, radius
FINES = 48


def box():
    """2,250 large balls above the floor of a box, to settle there."""
    rng = random.Random(6)
    for site in range(2250):
        at = [0.44 * (site % 15) + 0.22, 0.44 * (site // 15 % 15) + 0.22, 0.46 * (site // 225) + 0.3]
        yield ("content", jittered(rng, at, 0.01), REST, radius(rng))
    across, up = round(SIDE / SPACING), round(HEIGHT / SPACING)
    for i in range(across + 3):
        for j in range(across + 3):
            yield ("wall", [SPACING * (i - 1), SPACING * (j - 1), -0.22], REST, 0.22)
    for i in range(across + 2):
        for k in range(up):
            along, z = SPACING * i - 0.22, SPACING * k
            for at in ([along, -0.22, z], [SIDE - along, SIDE + 0.22, z], [-0.22, SIDE - along, z], [SIDE + 0.22, along, z]):
                yield ("wall", at, REST, 0.22)


def fines():
    """The settled balls of box() and small ones at rest in their pores."""
    rng = random.Random(7)
    balls = []
    for row in csv.DictReader(sys.stdin):
        at, velocity = [[float(row[key]) for key in keys] for keys in (("x", "y", "z"), ("vx", "vy", "vz"))]
        balls.append((row["kind"], at, velocity, float(row["radius"])))
    top = max(at[2] for kind, at, _, _ in balls if kind == "content")
    found = 0
    while found < FINES:
        at = [rng.uniform(0.0, SIDE), rng.uniform(0.0, SIDE), rng.uniform(0.5, top)]
        if all(math.dist(at, other) > r + 1.1 * FINE for _, other, _, r in balls):
            balls.append(("content", at, REST, FINE))
            found += 1
    yield from balls


KEPT = {"pair": pair, "chain": chain, "pile": pile}
OTHERS = {"gas": gas, "stream": stream, "box": box, "fines": fines}


def text(balls):
    lines = ["id,kind,x,y,z,vx,vy,vz,radius"]
    for ball, (kind, position, velocity, r) in enumerate(balls):
        lines.append(",".join([str(ball), kind] + ["%.17g" % value for value in [*position, *velocity, r]]))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    if len(sys.argv) == 2 and sys.argv[1] in OTHERS:
        sys.stdout.write(text(OTHERS[sys.argv[1]]()))
    elif len(sys.argv) == 1:
        for name, scene in KEPT.items():
            pathlib.Path(__file__).with_name(name + ".csv").write_text(text(scene()))
    else:
        sys.exit(f"make_states.py: give nothing or one of {', '.join(OTHERS)}")
