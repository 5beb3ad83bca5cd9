"""How far off a code is after the horizon, what that costs, and what a wanted error costs."""

from dataclasses import dataclass, field
from statistics import median

import numpy as np

from command import Settings
from study_charts import cost_at
from turns import in_turns

ERRORS = (1e-3, 1e-4)   # that codes are compared at
LONG, VERY_LONG = 10.0, 30.0  # s: a peer's longer runs average the clock's moods themselves and are run twice, or once


@dataclass
class Errors:
    """Distances from the reference over its rms displacement, as benchmarks/errors.hpp has them."""
    rms: float
    median: float
    p99: float


class Judge:
    """Measures ends against the reference: over the balls that are above the outlet in it."""

    def __init__(self, case, reference):
        above = reference.position[:, 2] >= case.outlet_z
        self.ids, self.position = reference.ids[above], reference.position[above]
        start = rows_of(self.ids, *case.start_positions(), "the start")
        self.displacement = rms(np.linalg.norm(self.position - start, axis=1))

    def errors(self, result, name):
        """Raises ValueError where a ball is missing or is nowhere."""
        apart = self.apart(rows_of(self.ids, result.ids, result.position, name), self.position)
        return Errors(rms(apart), float(np.median(apart)), float(np.quantile(apart, 0.99)))

    def between(self, one, other):
        """The rms distance of two ends, on the same scale."""
        return rms(self.apart(rows_of(self.ids, one.ids, one.position, "one"), rows_of(self.ids, other.ids, other.position, "other")))

    def apart(self, one, other):
        return np.linalg.norm(one - other, axis=1) / self.displacement


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def rows_of(wanted, ids, position, name):
    """Positions of the wanted balls, whatever the order of `ids`."""
    order = np.argsort(ids)
    place = np.clip(np.searchsorted(ids, wanted, sorter=order), 0, len(ids) - 1)
    rows = order[place]
    if not np.array_equal(ids[rows], wanted):
        raise ValueError(f"{name}: {np.count_nonzero(ids[rows] != wanted)} balls of the reference are missing")
    if not np.isfinite(position[rows]).all():
        raise ValueError(f"{name}: positions that are no numbers")
    return position[rows]


@dataclass
class Point:
    """A code at one setting: its error and its clock."""
    code: str
    kernels: str            # of grainclock; "" for peers
    method: str
    knob: str               # "step" or "tolerance"
    value: float
    skin: float | None      # m, of peers
    run: object             # repetition -> Result
    seconds: list = field(default_factory=list)
    errors: Errors | None = None
    end: object = None      # Result of the first run
    from_lammps: float | None = None  # rms distance from LAMMPS at the same step

    def label(self):
        return " ".join(filter(None, (self.code, self.method, self.kernels)))

    def time(self):
        return median(self.seconds)


def peer_points(peer, case, steps, skin_at, horizon, folder):
    """A peer at every step of `steps`, the coarsest first."""
    def runner(step):
        settings = Settings(step, round(horizon / step), skin_at(step))
        return lambda turn: peer.run(case, settings, folder, with_end=turn == 0)
    return [Point(peer.name, "", "", "step", step, skin_at(step), runner(step)) for step in steps]


def study_points(study):
    """grainclock at every point of its study."""
    return [Point("grainclock", study.build.name, name, knob, value, None, lambda turn, i=index: study.point(i, turn))
            for index, (name, knob, value) in enumerate(study.points)]


def measure(points, judge, rounds):
    """Runs all points in turns. A peer whose error is below the smallest wanted is not refined further."""
    def task(point):
        return lambda turn: record(point, point.run(turn), judge)

    def wanted(key, results):
        point = points[key]
        if point.kernels:
            return True  # a study is whole or none
        if not point.seconds:
            return not is_fine_enough(points, point)
        return point.time() < (LONG if len(point.seconds) > 1 else VERY_LONG)

    # All codes' coarsest first, then all codes' next: neighbours in time are neighbours in the chart.
    order = sorted(range(len(points)), key=lambda k: sum(p.label() == points[k].label() for p in points[:k]))
    in_turns({k: task(points[k]) for k in order}, rounds, wanted)
    done = [point for point in points if point.seconds]
    add_distances_from_lammps(done, judge)
    return done


def record(point, result, judge):
    point.seconds.append(result.seconds)
    if point.errors is None:
        point.end, point.errors = result, judge.errors(result, f"{point.label()}, {point.knob} {point.value:g}")


def is_fine_enough(points, point):
    return any(p.label() == point.label() and p.errors and p.errors.rms < min(ERRORS) for p in points)


def add_distances_from_lammps(points, judge):
    ends = {point.value: point.end for point in points if point.code == "LAMMPS"}
    for point in points:
        if not point.kernels and point.code != "LAMMPS" and point.value in ends:
            point.from_lammps = judge.between(point.end, ends[point.value])


@dataclass(frozen=True)
class Cost:
    """What a code needs for an error; `extrapolated` at first order from its finest point."""
    label: str
    error: float
    seconds: float | None
    extrapolated: bool = False


def cost(label, error, points):
    """`points`: (error, seconds) pairs of one code."""
    seconds = cost_at(error, points)
    if seconds is not None or not points:
        return Cost(label, error, seconds)
    finest, dearest = min(points)
    return Cost(label, error, dearest * finest / error, extrapolated=True)


def costs(points):
    """Every code's cost at every wanted error."""
    pairs = {}
    for point in points:
        pairs.setdefault(point.label(), []).append((point.errors.rms, point.time()))
    return [cost(label, error, its) for error in ERRORS for label, its in pairs.items()]
