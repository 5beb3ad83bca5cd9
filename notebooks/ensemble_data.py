"""An ensemble of silo runs (benchmarks/ensemble): what each run shows as numbers, profiles and series, and their spread over seeds.

read_ensemble(DIR) gives an Ensemble. Intervals are those of a mean (95 %, Student's t), not of a single run; nan is an unknown value.
"""

import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np
from scipy import stats

from silo_data import Story, charts, extremes, mean, mean_of_rows, read_story
from charts import NothingToDraw

CONFIDENCE = 0.95
SECTORS = 16        # around the axis, in which the unevenness of a layer's pressure is taken
RATE_OVER = 1.0     # s, over which balls that leave are counted
BEFORE = 1.0        # s of rest shown before the opening
FULL = 0.9          # of the median packing fraction: a layer below it is not filled
HEAVY = 0.1         # of the largest pressure by theory: layers below it are not compared with it


# ------------------------------------------------------------------ spread

@dataclass
class Envelope:
    """Over runs, at each place."""
    n: np.ndarray     # runs that know a value
    mean: np.ndarray
    low: np.ndarray   # interval of the mean; nan below two runs
    high: np.ndarray
    min: np.ndarray
    max: np.ndarray


def half_width(squared_error, freedom):
    """Of the interval of a mean whose squared standard error was estimated with some degrees of freedom; nan below one."""
    known = np.asarray(freedom) >= 1
    return np.where(known, stats.t.ppf(0.5 + CONFIDENCE / 2, np.where(known, freedom, 1)) * np.sqrt(squared_error), np.nan)


def moments(rows):
    """Number, mean and squared standard error of the mean of what is finite in each column."""
    rows = np.asarray(rows, float)
    known = np.isfinite(rows)
    n = known.sum(axis=0)
    mean = np.where(n > 0, np.where(known, rows, 0).sum(axis=0) / np.maximum(n, 1), np.nan)
    squares = np.where(known, (rows - mean) ** 2, 0).sum(axis=0)
    return n, mean, np.where(n > 1, squares / np.maximum(n - 1, 1) / np.maximum(n, 1), np.nan)


def envelope(rows):
    """Of runs x places, or of one number a run."""
    rows = np.asarray(rows, float)
    n, mean, squared_error = moments(rows)
    half = half_width(squared_error, n - 1)
    known = np.isfinite(rows)
    return Envelope(n, mean, mean - half, mean + half, np.where(n > 0, np.where(known, rows, np.inf).min(axis=0), np.nan),
                    np.where(n > 0, np.where(known, rows, -np.inf).max(axis=0), np.nan))


@dataclass
class Difference:
    """Mean of one variant less that of another, with its interval."""
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @property
    def differs(self):
        """Whether the interval is known and does not hold 0."""
        return (self.low > 0) | (self.high < 0)


def difference(rows, base, paired):
    """Of runs x places. Paired: row by row, for runs that share what they began with. Else Welch's: variances of their own."""
    if paired:
        n, mean, squared_error = moments(np.asarray(rows, float) - np.asarray(base, float))
        half = half_width(squared_error, n - 1)
        return Difference(mean, mean - half, mean + half)
    (n, mean, error), (n_base, mean_base, error_base) = moments(rows), moments(base)
    with np.errstate(invalid="ignore", divide="ignore"):
        freedom = (error + error_base) ** 2 / (error ** 2 / (n - 1) + error_base ** 2 / (n_base - 1))
    # Without any spread nothing is left to estimate.
    half = np.where(error + error_base == 0, 0.0, half_width(error + error_base, freedom))
    return Difference(mean - mean_base, mean - mean_base - half, mean - mean_base + half)


# ------------------------------------------------------------------ runs

@dataclass
class Variant:
    name: str
    text: str
    stories: dict  # seed -> Story

    def rows(self, of, seeds=None):
        """of(story) of each run, or of some seeds in their order."""
        return np.array([of(self.stories[seed]) for seed in (self.stories if seeds is None else seeds)], float)

    def envelope(self, of):
        return envelope(self.rows(of))


class Ensemble:
    """Variants that have a finished run, in the file's order; the first one is the base."""

    def __init__(self, variants, missing=0):
        self.variants, self.missing = {variant.name: variant for variant in variants if variant.stories}, missing
        if not self.variants:
            raise NothingToDraw("the ensemble has no finished member")

    @property
    def base(self):
        return next(iter(self.variants.values()))

    def __getitem__(self, name):
        if name not in self.variants:
            raise NothingToDraw(f"the ensemble has no finished run of the variant {name}")
        return self.variants[name]

    def is_paired(self, name):
        """Whether runs of one seed share the filling with the base, to the bit."""
        return all(np.array_equal(filled(self[name].stories[seed]), filled(self.base.stories[seed]), equal_nan=True) for seed in self.common(name))

    def common(self, name):
        return [seed for seed in self[name].stories if seed in self.base.stories]

    def difference(self, name, of):
        """Of a variant to the base."""
        if self.is_paired(name):
            seeds = self.common(name)
            return difference(self[name].rows(of, seeds), self.base.rows(of, seeds), True)
        return difference(self[name].rows(of), self.base.rows(of), False)


def filled(story):
    """Places of the content at the end of the first phase."""
    number = np.abs(story.frame_times - story.phases[0].end).argmin()
    with h5py.File(story.run, "r") as file:
        return file["particles/content/position/value"][number]


def read_ensemble(directory):
    """From a directory of benchmarks/ensemble/ensemble.py; members that are not finished are left out and counted."""
    directory = Path(directory)
    told = tomllib.loads((directory / "ensemble.toml").read_text(encoding="utf-8"))
    variants, missing = [], 0
    for name, variant in told["variant"].items():
        seeds = variant.get("seeds", told.get("seeds", []))
        done = [seed for seed in seeds if (directory / name / f"seed-{seed}" / "measures.h5").exists()]
        missing += len(seeds) - len(done)
        variants.append(Variant(name, variant.get("text", name), {seed: read_story(directory / name / f"seed-{seed}") for seed in done}))
    return Ensemble(variants, missing)


# ------------------------------------------------------------------ what a run shows: profiles over the layers

def at_rest(name):
    return lambda story: mean_of_rows(story[name][story.rest])


def in_flow(name):
    return lambda story: mean_of_rows(story[name][steady(story)])


def steady(story):
    """The discharge before the hammer without its first seconds, in which the pressure of the rest is freed."""
    mask = story.discharge & story.steady_flow()
    return mask if mask.any() else story.discharge


def whole(profile):
    """A profile of packing fractions without the layers that the content does not fill, those of its surface."""
    def of(story):
        values = profile(story)
        return np.where(values > FULL * np.nanmedian(values), values, np.nan)
    return of


def highest_over_static(story):
    found = extremes(story)
    return found.ratio(found.highest)


def flow_over_static(story):
    found = extremes(story)
    return found.ratio(in_flow("pressure_by_layer")(story))


def hammer_over_static(story):
    found = extremes(story)
    return found.ratio(found.hammer)


def uneven_around(mask_of):
    """By layer: how much the mean pressures (over the moments) of SECTORS sectors differ, standard deviation over mean. What stands in place
    counts in full, what comes and goes the less the more moments there are."""
    def of(story):
        pressure = story.wall["pressure"][mask_of(story)].mean(axis=0)
        sector = ((story.wall["angle"] + np.pi) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
        layer = np.clip(np.searchsorted(story.edges, story.wall["z"], "right") - 1, 0, len(story.middles) - 1)
        place, number = layer * SECTORS + sector, len(story.middles) * SECTORS
        force = np.bincount(place, pressure * story.wall["area"], number)
        with np.errstate(invalid="ignore", divide="ignore"):
            patch = (force / np.bincount(place, story.wall["area"], number)).reshape(-1, SECTORS)
            return patch.std(axis=1) / patch.mean(axis=1)
    return of


# ------------------------------------------------------------------ ... single numbers

def layer_above_transition(profile):
    return lambda story: profile(story)[story.transition]


def largest(profile):
    def of(story):
        values = profile(story)
        return np.nanmax(values) if np.isfinite(values).any() else np.nan
    return of


def over(profile, theory):
    """Largest ratio of a profile to that of theory at rest, where theory has some pressure."""
    def of(story):
        values = at_rest(theory)(story)
        heavy = values > HEAVY * np.nanmax(values, initial=0)
        return np.nanmax(profile(story)[heavy] / values[heavy]) if heavy.any() else np.nan
    return of


def over_shaft(profile, mask_of):
    """Mean of a profile over the layers of the shaft that stay covered."""
    def of(story):
        layers = (story.edges[:-1] >= story.joint - 1e-9) & story.covered(mask_of(story))
        return mean(profile(story)[layers])
    return of


def rest_of(story):
    return story.rest


def gone(story):
    return (1.0 - story.left) * len(story.radius)


def rate(story):
    """Balls/s over the steady discharge."""
    k = np.flatnonzero(steady(story))
    return (gone(story)[k[-1]] - gone(story)[k[0]]) / (story.time[k[-1]] - story.time[k[0]]) if len(k) > 1 else np.nan


def slowest_second(story):
    """Least rate over RATE_OVER in the steady discharge over the mean one."""
    time = story.time[steady(story)]
    return np.min([counted(story, t) for t in time[(time >= time[0] + RATE_OVER / 2) & (time <= time[-1] - RATE_OVER / 2)]], initial=np.inf) / rate(story)


def counted(story, time):
    """Balls/s about a time, over RATE_OVER."""
    ends = np.interp([time - RATE_OVER / 2, time + RATE_OVER / 2], story.time, gone(story))
    return (ends[1] - ends[0]) / RATE_OVER


def jitter(story):
    """Kinetic energy a ball at rest over the weight's work along a radius, m g r."""
    k = story.frame_of[story.rest]
    r = float(story.radius.mean())
    weight = story.scene["material"]["density"] * 4 / 3 * np.pi * np.mean(story.radius ** 3) * np.linalg.norm(story.scene["gravity"])
    return mean(story.kinetic_at_frames[k]) / (len(story.radius) * weight * r)


def energy_made(story):
    """What the steps made of nothing after the filling, over what the dashpots took: large beyond the stability bound. nan where the run does
    not tell."""
    with h5py.File(story.run, "r") as file:
        if "observables/dissipated" not in file:
            return np.nan
        of = lambda name: file[f"observables/{name}/value"][:]
        kept = ("kinetic_energy", "potential_energy", "elastic_energy", "dissipated", "first_impact", "removed_energy")
        total, taken = sum(of(name) for name in kept) - of("event_work") - of("switched_energy"), of("dissipated")
    first = np.abs(story.frame_times - story.phases[0].end).argmin()
    return (total[-1] - total[first]) / (taken[-1] - taken[first])


def at_end_of_discharge(name):
    def of(story):
        k = np.flatnonzero(story.discharge)
        return story[name][k[-1]] if k.size else np.nan
    return of


def of_rest(name, reduce=mean):
    return lambda story: reduce(story[name][story.rest])


def of_flow(name, reduce=mean):
    return lambda story: reduce(story[name][steady(story)])


def scaled(factor, of):
    return lambda story: factor * of(story)


def hammer_over_before(story):
    """Highest pressure of the layer above the transition in the hammer over its mean in the steady discharge."""
    return extremes(story).hammer[story.transition] / in_flow("pressure_by_layer")(story)[story.transition]


@dataclass(frozen=True)
class Quantity:
    """A number of a run; `text` with its unit."""
    text: str
    of: object
    digits: int


PRESSURE = "pressure_by_layer"
QUANTITIES = (
    Quantity("discharge  [balls/s]", rate, 1),
    Quantity("its slowest second over the mean", slowest_second, 2),
    Quantity("packing fraction at rest", of_rest("density"), 4),
    Quantity("... in the discharge", of_flow("density"), 4),
    Quantity("densest place over the mean, at rest  [%]", scaled(100, of_rest("density_peak_excess", np.nanmax)), 1),
    Quantity("... in the discharge  [%]", scaled(100, of_flow("density_peak_excess", np.nanmax)), 1),
    Quantity("balls in crystals at rest  [%]", scaled(100, of_rest("crystalline_share")), 1),
    Quantity("... at the end of the discharge  [%]", scaled(100, at_end_of_discharge("crystalline_share")), 1),
    Quantity("wall friction at rest", of_rest("wall_friction"), 3),
    Quantity("... in the discharge", of_flow("wall_friction"), 3),
    Quantity("lateral ratio at rest", of_rest("lateral_ratio"), 3),
    Quantity("jitter at rest  [1e-3 m g r]", scaled(1e3, jitter), 2),
    Quantity("energy made by the steps over that dissipated  [%]", scaled(100, energy_made), 2),
    Quantity("pressure above the transition at rest  [kPa]", scaled(1e-3, layer_above_transition(at_rest(PRESSURE))), 1),
    Quantity("... in the discharge  [kPa]", scaled(1e-3, layer_above_transition(in_flow(PRESSURE))), 1),
    Quantity("largest pressure of a layer at rest  [kPa]", scaled(1e-3, largest(at_rest(PRESSURE))), 1),
    Quantity("pressure over Janssen's at rest, most", over(at_rest(PRESSURE), "janssen_by_layer"), 2),
    Quantity("... over frictionless material's", over(at_rest(PRESSURE), "frictionless_by_layer"), 2),
    Quantity("... over water's", over(at_rest(PRESSURE), "water_by_layer"), 2),
    Quantity("highest dynamic over static pressure", largest(highest_over_static), 2),
    Quantity("mean dynamic over static, above the transition", layer_above_transition(flow_over_static), 2),
    Quantity("hammer over static, most", largest(hammer_over_static), 2),
    Quantity("hammer over before, above the transition", hammer_over_before, 2),
    Quantity("pressure uneven around at rest  [%]", scaled(100, over_shaft(uneven_around(rest_of), rest_of)), 1),
    Quantity("... in the discharge  [%]", scaled(100, over_shaft(uneven_around(steady), steady)), 1),
    Quantity("mode 1 of the flux between frames  [%]", scaled(100, of_flow("flux_asymmetry", lambda rows: mean(rows[:, 0]))), 1),
    Quantity("balls in compression chains, discharge  [%]", scaled(100, of_flow("chain_share")), 1),
    Quantity("nearly unloaded balls, discharge  [%]", scaled(100, of_flow("unloaded_share")), 2),
)


# ------------------------------------------------------------------ ... and series over time

def time_grid(ensemble):
    """s since the opening, as the base's first run has frames, from just before it to the end."""
    story = next(iter(ensemble.base.stories.values()))
    time = story.time - story.opened
    return time[time >= -BEFORE]


def series(name, time):
    return lambda story: np.interp(time, story.time - story.opened, story[name], np.nan, np.nan)


def pressure_above_transition(time):
    return lambda story: np.interp(time, story.time - story.opened, story[PRESSURE][:, story.transition], np.nan, np.nan)


def rate_over_time(time):
    """Balls/s where the whole span lies in the discharge."""
    def of(story):
        end = story.time[story.discharge][-1] - story.opened if story.discharge.any() else -np.inf
        within = (time >= RATE_OVER / 2) & (time <= end - RATE_OVER / 2)
        return np.array([counted(story, story.opened + t) if inside else np.nan for t, inside in zip(time, within)])
    return of


# ------------------------------------------------------------------ how rough a wall is

@dataclass
class Relief:
    """Where a wall stops a ball's centre that is pushed outwards, over places of the shaft."""
    rms: float    # m, standard deviation of the distance from the axis
    range: float  # m, between the farthest and the nearest
    slope: float  # rms slope of the wall as the ball's centre feels it
    slope_up: float  # its part along the axis


def relief(story, places=2000, seed=1):
    """Of the round shaft, felt by a mean ball of the content at random places away from the shaft's ends."""
    wall = story.fixed.kind == 1
    centre, ball = story.fixed.position[wall], story.fixed.radius[wall]
    radius, margin = float(story.radius.mean()), 4 * float(story.radius.mean())
    low, high = story.joint + margin, centre[:, 2].max() - margin
    random = np.random.default_rng(seed)
    angle, height = random.uniform(-np.pi, np.pi, places), random.uniform(low, high, places)
    found, slope, slope_up = [], [], []
    for a, z in zip(angle, height):
        near = np.abs(centre[:, 2] - z) < margin
        outward = np.array([np.cos(a), np.sin(a), 0.0])
        way = centre[near] - [0.0, 0.0, z]
        along, reach = way @ outward, ball[near] + radius
        # |s outward - way| = reach; the ball comes from the axis.
        root = reach ** 2 - (np.sum(way ** 2, axis=1) - along ** 2)
        able = (root > 0) & (along > 0)
        stops = along[able] - np.sqrt(root[able])
        first = int(np.argmin(stops))
        normal = (way[able][first] - stops[first] * outward) / reach[able][first]
        found.append(stops[first])
        slope.append((1 - (normal @ outward) ** 2) / (normal @ outward) ** 2)
        slope_up.append((normal[2] / (normal @ outward)) ** 2)
    return Relief(float(np.std(found)), float(np.ptp(found)), float(np.sqrt(np.mean(slope))), float(np.sqrt(np.mean(slope_up))))
