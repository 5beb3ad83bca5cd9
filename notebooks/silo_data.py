"""What a silo's run and its measures hold, by name, and what is read off them: for silo_charts.py and silo_words.py.

read_story(RUN, MEASURES) gives a Story. What the measures mean, and their thresholds, stands in silo/*.hpp and silo/moment.cpp.
"""

import sys
import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
import charts
from charts import Frame, NothingToDraw

BUSY = 0.25      # share of the content that must still be there for a moment of the emptying to count in a statement
SETTLED = 0.95   # of the mean packing fraction at rest: from there on falling content counts as a heap
YOUNG = 5.0      # s, that flow takes to build up after the outlet is opened
MEAN_OVER = 10.0 # s, of running means
FLOOR = 0.1      # of the largest static pressure: layers below it have no ratio of dynamic to static
OVER = 0.1       # share by which a pressure must exceed its static value to count as overpressure
LATE = 0.1       # of the time between frames, by which a phase's end can follow the frame that fulfils its condition
PATCH = 1.5      # half width and half height of the patch of Fig. 9 in mean ball diameters
BESIDE = 4.0     # mean ball diameters above and below a bridge: kBeside of silo/moment.cpp


# ------------------------------------------------------------------ reading

@dataclass
class Phase:
    name: str
    begin: float  # s
    end: float    # s
    is_open: bool
    contact: dict  # constants of the contact law

    def holds(self, time):
        """Frames after its beginning, up to its end."""
        return (time > self.begin + 1e-9) & (time <= self.end + 1e-9)


def end_of(phase, begin, every, time, discharged, balls):
    """When a phase of a run that does not record phases ended [s]. Where a condition ended it, that is the first frame off the phase's
    grid, or the one on it at which the balls that left fulfil the condition; runs notice it a few steps later (LATE)."""
    if "duration" in phase:
        return begin + phase["duration"]
    later = time > begin + 1e-9
    counted = (time - begin) / every
    off_grid = time[later & (np.abs(counted - np.round(counted)) > 1e-4)]
    before = discharged[~later].max(initial=0)
    kind, _, share = phase["until"].partition(":")
    wanted = {"discharged": before + float(share or 0) * (balls - before), "empty": balls}.get(kind, np.inf)
    fulfilled = time[later & (discharged >= wanted)]
    if fulfilled.size and not (off_grid.size and off_grid[0] <= fulfilled[0] + LATE * every):
        return fulfilled[0]
    return off_grid[0] if off_grid.size else min(time[-1], begin + phase.get("max_duration", np.inf))


def read_phases(scene, time, discharged, balls, recorded=None):
    """`recorded`: number of the phase of each frame, where the run tells; else ends are found."""
    phases, begin = [], 0.0
    for k, phase in enumerate(scene.get("phase", [])):
        if begin >= time[-1]:
            break
        every = phase.get("every", scene.get("output", {}).get("every", phase.get("duration", 1.0)))
        end = end_of(phase, begin, every, time, discharged, balls) if recorded is None else time[recorded <= k][-1]
        contact = {**scene["contact"], **phase.get("contact", {})}
        phases.append(Phase(phase.get("name", ""), begin, end, phase.get("outlet") == "open", contact))
        begin = end
    return phases


def at_frames(file, name):
    """An observable's values in the frames of a run: it may be recorded between them, too."""
    observable = file["observables"][name]
    rows = np.searchsorted(observable["step"][:], file["particles/content/position/step"][:])
    return observable["value"][:][rows]


class Story:
    """A run, and what `grainclock measure` read off its frames. Times in s; all series have a row per measured frame."""

    def __init__(self, run, measures):
        self.run, self.measures = Path(run), Path(measures)
        with h5py.File(run, "r") as file:
            told = charts.read_provenance(file)
            self.scene, self.seed = tomllib.loads(told["scene"]), told.get("seed", "?")
            self.version = f"{told.get('version', '?')} ({told.get('git_revision', '?')[:12]})"
            content, fixed_balls = file["particles/content"], file["particles/wall"]
            self.frame_times = content["position/time"][:]
            self.radius, self.ids = content["radius"][:], content["id"][:]
            fixed_place = fixed_balls["position"][:]
            self.fixed = Frame(fixed_place, np.zeros_like(fixed_place), fixed_balls["radius"][:], fixed_balls["kind"][:].astype(int))
            self.fixed_ids = fixed_balls["id"][:]
            self.discharged_at_frames = at_frames(file, "discharged")
            recorded = at_frames(file, "phase") if "phase" in file["observables"] else None
            self.kinetic_at_frames = at_frames(file, "kinetic_energy")
        with h5py.File(measures, "r") as file:
            self.time = file["time"][:]
            self.series = {name: dataset[:] for name, dataset in file["series"].items()}
            self.edges = file["series"].attrs["layer_edges"]
            self.edges_of_forces = file["series"].attrs.get("force_edges")
            self.wall = {name: dataset[:] for name, dataset in file["wall"].items()}
        self.phases = read_phases(self.scene, self.frame_times, self.discharged_at_frames, len(self.radius), recorded)

    def __getitem__(self, name):
        if name not in self.series:
            raise NothingToDraw(f"the measures have no series {name}")
        return self.series[name]

    @property
    def force_edges(self):
        """Edges of the classes of series/force_distribution, over the mean force."""
        if self.edges_of_forces is None:
            raise NothingToDraw("measures of an earlier version have no edges of the classes of forces; measure the run again")
        return self.edges_of_forces

    # ---------------------------------------------------------------- moments and windows (masks over the measured frames)

    @cached_property
    def frame_of(self):
        """Number of the run's frame of each measured one."""
        return np.abs(self.frame_times[None, :] - self.time[:, None]).argmin(axis=1)

    @cached_property
    def left(self):
        """Share of the content that is still there."""
        return 1.0 - self.discharged_at_frames[self.frame_of] / len(self.radius)

    def during(self, phases):
        return np.any([phase.holds(self.time) for phase in phases], axis=0) if phases else np.zeros(len(self.time), bool)

    @cached_property
    def first_open(self):
        return next((k for k, phase in enumerate(self.phases) if phase.is_open), len(self.phases))

    @cached_property
    def hammer_phase(self):
        """The first phase with a closed outlet after one with an open one, or None."""
        return next((phase for phase in self.phases[self.first_open:] if not phase.is_open), None)

    @cached_property
    def filling(self):
        return self.during(self.phases[:self.first_open]) | (self.time <= 1e-9)

    @cached_property
    def rest(self):
        """The last phase before the outlet opens: its pressures are the static ones."""
        return self.during(self.phases[max(self.first_open - 1, 0):self.first_open])

    @cached_property
    def opened(self):
        """s, when the outlet opens; the end of the run if it never does."""
        return self.phases[self.first_open].begin if self.first_open < len(self.phases) else self.time[-1]

    @cached_property
    def discharge(self):
        """From the opening to the hammer (to the end without one)."""
        until = self.hammer_phase.begin if self.hammer_phase else np.inf
        return (self.time > self.opened + 1e-9) & (self.time <= until + 1e-9)

    @cached_property
    def hammer(self):
        return self.during([self.hammer_phase] if self.hammer_phase else [])

    @cached_property
    def settled(self):
        """Frames from the first on in which the content is a heap: its mean packing fraction has reached SETTLED times that at rest."""
        dense = np.flatnonzero(self["density"] >= SETTLED * mean(self["density"][self.rest if self.rest.any() else slice(None)]))
        return self.time >= (self.time[dense[0]] if dense.size else np.inf)

    @property
    def hammer_span(self):
        """s, how long the hammer phase lasts."""
        return self.hammer_phase.end - self.hammer_phase.begin

    @cached_property
    def flow(self):
        """Open outlet, with enough content left for a statement."""
        return self.during([phase for phase in self.phases if phase.is_open]) & (self.left >= BUSY)

    def steady_flow(self):
        """Flow without the first YOUNG seconds after each opening (all of it if nothing else is left)."""
        starts = [phase.begin for phase in self.phases if phase.is_open]
        young = np.any([(self.time > begin) & (self.time < begin + YOUNG) for begin in starts], axis=0) if starts else False
        later = self.flow & ~young
        return later if later.any() else self.flow

    def covered(self, mask):
        """Layers that the surface stays above in all frames of a mask."""
        height = self["surface_height"][mask]
        return self.edges[1:] <= (np.min(height[np.isfinite(height)]) if np.isfinite(height).any() else -np.inf)

    # ---------------------------------------------------------------- balls

    def phase_at(self, moment):
        return next((phase for phase in self.phases if phase.holds(np.array(self.time[moment]))), self.phases[0])

    def balls(self, moment):
        """Content and fixed balls of a measured frame as charts.Frame; velocities of the moment."""
        number = int(self.frame_of[moment])
        with h5py.File(self.run, "r") as file:
            content = file["particles/content"]
            position, velocity = content["position/value"][number], content["velocity/value"][number]
        here = np.isfinite(position[:, 0])
        stays = (self.fixed.kind == 1) | (not self.phase_at(moment).is_open)
        return Frame(np.concatenate([position[here], self.fixed.position[stays]]),
                     np.concatenate([velocity[here], np.zeros((stays.sum(), 3))]),
                     np.concatenate([self.radius[here], self.fixed.radius[stays]]),
                     np.concatenate([np.zeros(here.sum(), int), self.fixed.kind[stays]]), time=float(self.time[moment]))

    def motion_by_row(self, moment):
        """Places and mean velocities from the frame before to a measured one, for every ball of the run (nan once it has left), and the
        time between [s]."""
        number = int(self.frame_of[moment])
        with h5py.File(self.run, "r") as file:
            place = file["particles/content/position/value"]
            before, after = place[max(number - 1, 0)], place[number]
        apart = self.frame_times[number] - self.frame_times[max(number - 1, 0)]
        return after, (after - before) / max(apart, 1e-12), apart

    def mean_motion(self, moment):
        """Places, mean velocities as above, the time between [s] and radii of the content that is there."""
        place, velocity, apart = self.motion_by_row(moment)
        here = np.isfinite(velocity[:, 0])
        return place[here], velocity[here], apart, self.radius[here]

    def bridges(self, moment):
        """The larger bridges of a measured frame: of each the pairs of balls that support each other, as rows of the run's content."""
        with h5py.File(self.measures, "r") as file:
            if "bridges" not in file:
                raise NothingToDraw("measures of an earlier version have no bridges; measure the run again")
            first, last = file["bridges/begin"][moment:moment + 2]
            bonds = np.searchsorted(self.ids, file["bridges/bonds"][first:last].reshape(-1, 2))
        return connected(bonds)

    # ---------------------------------------------------------------- the silo

    @property
    def diameter(self):
        return 2.0 * float(self.radius.mean())

    @cached_property
    def joint(self):
        """m, height of the transition from the hopper to the shaft (without a hopper: the outlet's half width, as the measures take)."""
        silo = self.scene["silo"]
        return silo.get("hopper_height", 5.0) or 0.5 * silo.get("outlet", 2.0)

    @cached_property
    def middles(self):
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    @cached_property
    def transition(self):
        """The layer above the transition."""
        return int(np.clip(np.searchsorted(self.edges, self.joint + 1e-9, "right") - 1, 0, len(self.middles) - 1))

    @cached_property
    def patch(self):
        """Wall balls of the patch of Fig. 9: above the transition, on the +x side."""
        half = PATCH * self.diameter
        middle = self.joint + half
        near = np.abs(self.wall["z"] - middle) <= half
        half_width = self.scene["silo"].get("radius", 0.5 * self.scene["silo"].get("width", 10.0))
        return near & (np.abs(self.wall["angle"]) * half_width <= half)

    def patch_pressure(self):
        if not self.patch.any():
            raise NothingToDraw("no wall ball lies in the patch")
        return np.average(self.wall["pressure"][:, self.patch], axis=1, weights=self.wall["area"][self.patch])


def read_story(run, measures=None):
    """A run.h5 or its directory; the measures are beside it unless named."""
    run = Path(run)
    run = run / "run.h5" if run.is_dir() else run
    return Story(run, measures or run.parent / "measures.h5")


# ------------------------------------------------------------------ bridges

def connected(bonds):
    """Pairs (n x 2) sorted into sets that hang together: a list of arrays of pairs."""
    root = {int(ball): int(ball) for ball in np.unique(bonds)}

    def root_of(ball):
        while root[ball] != ball:
            ball = root[ball]
        return ball

    for a, b in bonds.tolist():
        root[root_of(a)] = root_of(b)
    names = np.array([root_of(a) for a in bonds[:, 0].tolist()])
    return [bonds[names == name] for name in dict.fromkeys(names.tolist())]


def beside(place, radius, members, reach):
    """Balls above and below a bridge (two masks), as silo/arches.hpp has it: balls whose shadows overlap that of a member, and whose centres
    are by more than their radii, and at most by `reach`, higher or lower than that of the horizontally nearest member."""
    apart = np.linalg.norm(place[:, None, :2] - place[None, members, :2], axis=2)
    nearest = members[np.argmin(np.nan_to_num(apart, nan=np.inf), axis=1)]
    over = place[:, 2] - place[nearest, 2]
    counts = (apart.min(axis=1) < radius + radius[nearest]) & (np.abs(over) > radius) & (np.abs(over) <= reach)
    return counts & (over > 0), counts & (over < 0)


# ------------------------------------------------------------------ numbers

def percent(share, digits=0):
    return f"{100 * share:.{digits}f} %"


def spread(values, text=charts.amount):
    """Smallest to largest of what is finite."""
    values = np.asarray(values)[np.isfinite(values)]
    return f"{text(values.min())} to {text(values.max())}" if values.size else "nothing"


def mean(values):
    values = np.asarray(values)[np.isfinite(values)]
    return float(values.mean()) if values.size else np.nan


def mean_of_rows(values):
    """Mean over the frames of what is finite, column by column; nan where nothing is."""
    known = np.isfinite(values)
    number = known.sum(axis=0)
    return np.where(number > 0, np.where(known, values, 0).sum(axis=0) / np.maximum(number, 1), np.nan)


def running_mean(time, values, weights=None, width=MEAN_OVER):
    """Mean over a window around each time, by time: each sample counts with the time that it stands for."""
    span = np.gradient(time) if len(time) > 1 else np.ones(1)
    weight = span if weights is None else span * weights
    known = np.isfinite(values) & np.isfinite(weight)
    sums = np.concatenate([[0], np.cumsum(np.where(known, values * weight, 0))])
    total = np.concatenate([[0], np.cumsum(np.where(known, weight, 0))])
    first = np.searchsorted(time, time - 0.5 * width, "left")
    last = np.searchsorted(time, time + 0.5 * width, "right")
    with np.errstate(divide="ignore", invalid="ignore"):
        return (sums[last] - sums[first]) / (total[last] - total[first])


def extreme(values, mask, largest=True):
    """Index of the largest or smallest finite value within a mask, or None."""
    able = np.flatnonzero(mask & np.isfinite(values))
    return None if not able.size else able[(np.argmax if largest else np.argmin)(values[able])]


# ------------------------------------------------------------------ moments

def discharge_moment(story):
    """A moment in the middle of the discharge before the hammer."""
    able = np.flatnonzero(story.discharge if story.discharge.any() else story.left > 0)
    return int(able[len(able) // 2])


def surface_moments(story):
    """At rest and when 0.9, 0.78, 0.6, 0.4, 0.2 of the content are left."""
    rest = np.flatnonzero(story.rest)
    moments = list(rest[-1:])
    flowing = story.time > story.opened
    for share in (0.9, 0.78, 0.6, 0.4, 0.2):
        if flowing.any() and story.left[flowing].min() <= share:
            moments.append(int(np.flatnonzero(flowing & (story.left <= share))[0]))
    return list(dict.fromkeys(moments))


@dataclass
class View:
    """A moment to draw, seen across a direction."""
    moment: int
    title: str
    azimuth: float = 0.0  # rad, of the abscissa


def turned(frame, azimuth):
    """Seen with the abscissa in a direction."""
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    return Frame(frame.position @ turn.T, frame.velocity @ turn.T, frame.radius, frame.kind, frame.level, frame.time)


def filling_views(story):
    """The moment of the filling with most kinetic energy, and its last one."""
    able = np.flatnonzero(story.filling & (story.time > 0))
    if not able.size:
        return []
    fastest = able[np.argmax(story.kinetic_at_frames[story.frame_of[able]])]
    return [View(int(k), title) for k, title in {fastest: "filling", able[-1]: "filled"}.items()]


def flux_mode(story):
    """Mode 1 of the flux through the transition: the sum of q exp(i azimuth) over that of |q|, and the latter as weight."""
    return story["flux_asymmetry"][:, 0] * np.exp(1j * story["flux_direction"][:, 0]), story["flux_turnover"]


def chance_of_flux(story, samples=12):
    """What mode 1 of the flux would be (rms) if the balls in the plane stood at random azimuths: the root of the sum of q^2 over that
    of |q|, q the flux of a ball as silo/flux.hpp has it; mean over some moments of the flow."""
    able = np.flatnonzero(story.steady_flow())
    found = []
    for moment in able[np.unique(np.linspace(0, len(able) - 1, min(samples, len(able))).astype(int))] if able.size else []:
        place, velocity, apart, radius = story.mean_motion(moment)
        # In the middle of their way, as the measures take them.
        area = np.maximum(radius ** 2 - (place[:, 2] - 0.5 * apart * velocity[:, 2] - story.joint) ** 2, 0)
        q = np.abs(area * velocity[:, 2])
        if q.any():
            found.append(np.sqrt(np.sum(q ** 2)) / np.sum(q))
    return mean(found)


def mean_flux_mode(story, width=MEAN_OVER):
    mode, weight = flux_mode(story)
    return running_mean(story.time, mode.real, weight, width) + 1j * running_mean(story.time, mode.imag, weight, width)


def unsymmetrical_views(story):
    """The moment of the flow with the largest asymmetry, as a mean over ten seconds, seen across its direction."""
    mode = mean_flux_mode(story)
    k = extreme(np.abs(mode), story.steady_flow())
    return [] if k is None else [View(int(k), "most unsymmetrical flow", float(np.angle(mode[k])))]


def stoppage_views(story):
    """The moment of the flow at which the content sinks slowest, and the one two seconds later."""
    # Several frames a second apart follow; a moment at which the run or its phase ends shows nothing of a stoppage.
    lasting = story.steady_flow() & np.append(story.steady_flow()[2:], [False, False])
    k = extreme(story["flux_speed"], lasting, largest=False)
    if k is None:
        return []
    later = int(np.argmin(np.abs(story.time - story.time[k] - 2.0)))
    return [View(int(k), "slowest flow"), View(later, "two seconds later")]


def bridged_view(story):
    """The moment of the flow at which the content sinks slowest, or without large bridges there one in the middle of the discharge."""
    for view in [*stoppage_views(story)[:1], View(discharge_moment(story), "discharge")]:
        if story.bridges(view.moment):
            return view
    raise NothingToDraw("the slowest moment and the middle of the discharge have no large bridge")


def meandering_views(story):
    """The two neighbouring moments between which the centroid of the flux moves farthest."""
    steady = story.steady_flow()
    pair = steady[1:] & steady[:-1] & (np.diff(story.time) > 0.05)
    step = np.linalg.norm(np.diff(story["flux_centroid"], axis=0), axis=1)
    k = extreme(step, pair)
    if k is None:
        return []
    way = story["flux_centroid"][k + 1] - story["flux_centroid"][k]
    azimuth = float(np.arctan2(way[1], way[0]))
    return [View(int(k), "before", azimuth), View(int(k + 1), "after", azimuth)]


def hammer_views(story):
    """Just before the outlet is closed, and 0.1 s after."""
    if not story.hammer.any() or not story.discharge.any():
        return []
    after = int(np.argmin(np.abs(story.time - story.hammer_phase.begin - 0.1)))
    return [View(int(np.flatnonzero(story.discharge)[-1]), "before closing"), View(max(after, int(np.flatnonzero(story.hammer)[0])), "closed")]


# ------------------------------------------------------------------ flow

def rates(story):
    """Balls per second between frames at least half a second apart, while flow counts, and the times [s] between them."""
    chosen = np.flatnonzero(story.steady_flow())
    pairs = [(a, b) for a, b in zip(chosen[:-1], chosen[1:]) if b == a + 1 and story.time[b] - story.time[a] > 0.05]
    gone = (1.0 - story.left) * len(story.radius)
    return (np.array([(gone[b] - gone[a]) / (story.time[b] - story.time[a]) for a, b in pairs]),
            np.array([story.time[b] - story.time[a] for a, b in pairs]))


# ------------------------------------------------------------------ forces and pressures

def lattice(story, moment):
    """Fixed balls, lines between centres and normal forces [N] of the contacts in a slab of three diameters; weak ones first."""
    frame = story.balls(moment)
    slab = frame.keep(np.abs(frame.position[:, 1]) < 1.5 * story.diameter)
    i, j, force = charts.contact_forces(slab, story.phase_at(moment).contact)
    order = np.argsort(force)
    order = order[force[order] > 0]
    ends = np.stack([slab.position[i[order]][:, [0, 2]], slab.position[j[order]][:, [0, 2]]], axis=1)
    return slab.keep(slab.kind > 0), ends, force[order]


@dataclass
class Extremes:
    """Pressures by layer [Pa]: static, and in the discharge (before the hammer) and the hammer; ratios are nan where nothing divides."""
    static: np.ndarray
    mean: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray
    hammer: np.ndarray

    def ratio(self, dynamic):
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.static > FLOOR * np.nanmax(self.static), dynamic / self.static, np.nan)


def extremes(story):
    pressure = story["pressure_by_layer"]
    if not story.rest.any() or not story.discharge.any():
        raise NothingToDraw("the run has no rest before a discharge")
    nothing = np.full(pressure.shape[1], np.nan)
    moving = pressure[story.discharge]
    return Extremes(pressure[story.rest].mean(axis=0), moving.mean(axis=0), moving.min(axis=0), moving.max(axis=0),
                    pressure[story.hammer].max(axis=0) if story.hammer.any() else nothing)


def lasting_wave(story, mask):
    """Mode 1 by layer averaged with its direction: what of it stays in place."""
    return mean_of_rows(story["pressure_modes"][mask][:, :, 0] * np.exp(1j * story["pressure_crests"][mask][:, :, 0]))


def total_force(story):
    """N, sum of the horizontal forces on the wall balls, without their directions."""
    return story.wall["pressure"] @ story.wall["area"]


def even_run(story, mask):
    """The longest evenly spaced stretch of frames within a mask: their numbers."""
    able = np.flatnonzero(mask)
    best = able[:0]
    while able.size > 1:
        step = story.time[able[1]] - story.time[able[0]]
        same = (np.diff(able) == 1) & (np.abs(np.diff(story.time[able]) - step) < 1e-3 * step)
        length = 1 + (int(np.argmin(same)) if not same.all() else len(same))
        best = able[:length] if length > len(best) else best
        able = able[max(length - 1, 1):]
    return best


def spectrum(time, values, segments=1):
    """One-sided spectral density of the departures from the mean: frequency [Hz], squared unit per Hz. Mean over so many stretches of equal
    length and half overlap, each under Hann's window (Welch)."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    length = 2 * len(time) // (segments + 1)
    window = np.hanning(length + 1)[:-1]
    starts = np.linspace(0, len(time) - length, segments).astype(int)
    density = np.mean([2 * step * np.abs(np.fft.rfft((values[k:k + length] - values[k:k + length].mean()) * window)) ** 2 for k in starts],
                      axis=0) / np.sum(window ** 2)
    return np.fft.rfftfreq(length, step), density


@dataclass
class Overpressure:
    highest: float  # over the reference
    at: float       # s after closing
    lasts: float    # s above (1 + OVER) times the reference, in sum


def overpressure(time, pressure, reference):
    """How far and how long a pressure exceeds a reference; straight lines between samples."""
    level = (1 + OVER) * reference
    above = pressure - level
    span, a, b = np.diff(time), above[:-1], above[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where((a > 0) & (b > 0), 1.0, np.where((a <= 0) & (b <= 0), 0.0, np.maximum(a, b) / np.abs(a - b)))
    peak = int(np.argmax(pressure))
    return Overpressure(float(pressure[peak] / reference), float(time[peak]), float(np.sum(span * share)))


def hammer_curves(story):
    """(name, time after closing [s], pressure [Pa], static [Pa], mean of the 20 s before closing [Pa]) of what the hammer's chart shows."""
    if not story.hammer.any() or not story.rest.any():
        raise NothingToDraw("the run closes no outlet that was open, or was never at rest")
    begin = story.hammer_phase.begin
    window = story.hammer | (np.abs(story.time - begin) < 1e-9)
    before = story.discharge & (story.time > begin - 20.0)
    time = story.time[window] - begin
    pressure = story["pressure_by_layer"]
    static = pressure[story.rest].mean(axis=0)
    heavy = (static > FLOOR * np.nanmax(static)) & (np.nan_to_num(pressure[before].mean(axis=0)) > 0)
    name = lambda k: f"{story.edges[k]:.2f} to {story.edges[k + 1]:.2f} m"
    curves = [(f"layer above the transition ({name(story.transition)})", pressure[:, story.transition]), ("patch of Fig. 9", story.patch_pressure())]
    if heavy.any():
        peaks = np.where(heavy, np.nan_to_num(pressure[window].max(axis=0) / np.where(static > 0, static, np.nan)), 0)
        worst = int(np.argmax(peaks))
        if worst != story.transition:
            curves.append((f"layer with the largest ratio ({name(worst)})", pressure[:, worst]))
    curves.append(("all of the wall", total_force(story) / story.wall["area"].sum()))
    return [(name, time, values[window], values[story.rest].mean(), values[before].mean()) for name, values in curves]
