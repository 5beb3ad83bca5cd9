"""Charts of what a run records between its frames: rate, energy and beats, frequencies of the sideways force, one place of the wall, the hammer.

As a module: CHARTS, by name, each drawn from the Dense that read_dense() gives; every draw_... fills an empty figure and raises NothingToDraw
where there is nothing to show. What the series mean stands in silo/observables.hpp and silo/between_frames.hpp. silo_dense.ipynb shows them.
"""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from silo_charts import BLUE, GREEN, ORANGE, PURPLE, RED
from silo_data import charts, percent
from charts import GRID, INK, MUTED, Chart, NothingToDraw, fixed, soft_grid

SHOWN = 12.0    # s, of the discharge in the close view
MIDDLE = 0.5    # of the discharge, where it is taken
BAND = (4.0, 9.0)  # Hz, around the line of the sideways force


@dataclass
class Open:
    """A phase with an open outlet: its name, begin and end [s], longest pause [s], pauses, stoppages, beats and spectra by name."""
    name: str
    span: tuple
    longest_pause: float
    found: dict
    spectra: dict


class Dense:
    """A run's records and what `grainclock measure` read off them. Times in s; series have a row per record."""

    def __init__(self, run, measures):
        with h5py.File(measures, "r") as file:
            if "between_frames" not in file:
                raise NothingToDraw("the run, or its measures, are of a version that records nothing between frames")
            group = file["between_frames"]
            self.time, self.energy = group["time"][:], group["energy_per_ball"][:]
            self.speed, self.rate = group["sinking_speed"][:], group["discharge_rate"][:]
            self.open = [self.read_open(group[name]) for name in sorted(group, key=lambda name: (len(name), name)) if name.startswith("open_")]
            self.edges = file["series"].attrs["layer_edges"]
            self.hammer = None
            if "hammer" in group:
                told = group["hammer"]
                self.hammer = {place.decode(): (rest, flow) for place, rest, flow in zip(told["place"][:], told["over_rest"][:], told["over_flow"][:])}
        with h5py.File(run, "r") as file:
            observables = file["observables"]
            self.patch = observables["patch_pressure/value"][:] if "patch_pressure" in observables else None
            self.phase = observables["phase/value"][:]
            self.wall_force = observables["wall_force_by_layer/value"][:]

    @staticmethod
    def read_open(group):
        found = {name: group[name][:] for name in ("pauses", "stoppages", "energy_beats", "speed_beats")}
        spectra = {name: dataset[:] for name, dataset in group["spectra"].items()} if "spectra" in group else {}
        return Open(group.attrs["name"], tuple(group.attrs["span"]), float(group.attrs["longest_pause"]), found, spectra)

    def flow(self):
        """The longest open phase before the hammer, whose content is all but complete; the longest of all without a hammer."""
        shut = self.shut()
        able = [phase for phase in self.open if shut is None or phase.span[1] <= self.time[shut[0]] + 1e-9]
        if not able:
            raise NothingToDraw("the outlet was never open")
        return max(able, key=lambda phase: phase.span[1] - phase.span[0])

    def spectra_of_flow(self):
        if not self.flow().spectra:
            raise NothingToDraw("the discharge is too short for a spectrum")
        return self.flow().spectra

    def within(self, span):
        return (self.time > span[0] + 1e-9) & (self.time <= span[1] + 1e-9)

    def shut(self):
        """Records of the hammer, the one it begins with among them, or None."""
        first = next((k for k, phase in enumerate(self.open[1:]) if phase.span[0] > self.open[k].span[1] + 1e-9), None)
        if first is None:
            return None
        begin, end = self.open[first].span[1], self.open[first + 1].span[0]
        return np.flatnonzero((self.time >= begin - 1e-9) & (self.time <= end + 1e-9))


def read_dense(run, measures=None):
    """A run.h5 or its directory; the measures are beside it unless named."""
    run = Path(run)
    run = run / "run.h5" if run.is_dir() else run
    return Dense(run, measures or run.parent / "measures.h5")


# ------------------------------------------------------------------ rate, energy, beats

def over(axes, time, ylabel, **more):
    axes.set(xlim=(time[0], time[-1]), ylabel=ylabel, **more)
    soft_grid(axes)


def mark(axes, spans, colour):
    for begin, end in spans:
        axes.axvspan(begin, end, color=colour, alpha=0.35, lw=0)


def draw_rhythm(figure, dense):
    flow = dense.flow()
    here = dense.within(flow.span)
    time = dense.time[here]
    rate, speed, energy = figure.subplots(3, 1, sharex=True)
    for axes, values, colour, label in ((rate, dense.rate, ORANGE, "balls/s\n(mean over 1 s)"), (speed, 100 * dense.speed, BLUE, "sinking speed\n[cm/s]"),
                                        (energy, dense.energy, GREEN, "kinetic energy\na ball  [m g r]")):
        axes.plot(time, values[here], color=colour, lw=0.8)
        over(axes, time, label, ylim=(0, None))
        mark(axes, flow.found["pauses"], MUTED)
        mark(axes, flow.found["stoppages"], RED)
    energy.axhline(5e-3, color=INK, lw=1, ls=(0, (4, 3)))
    energy.text(1.01, 5e-3, "below:\ncreeps", fontsize=9, va="center", transform=energy.get_yaxis_transform())
    for axes, beats, scale in ((speed, flow.found["speed_beats"], 100), (energy, flow.found["energy_beats"], 1)):
        axes.plot(beats[:, 0], scale * beats[:, 1], "v", color=INK, ms=3)
    energy.set_xlabel("time  [s]; triangles: beats")


def draw_rhythm_close(figure, dense):
    flow = dense.flow()
    begin = flow.span[0] + MIDDLE * (flow.span[1] - flow.span[0])
    here = dense.within((begin, min(begin + SHOWN, flow.span[1])))
    if here.sum() < 2:
        raise NothingToDraw("the discharge is too short")
    time = dense.time[here]
    speed, energy = figure.subplots(2, 1, sharex=True)
    for axes, values, beats, colour, label in ((speed, 100 * dense.speed, flow.found["speed_beats"] * [1, 100, 100], BLUE, "sinking speed\n[cm/s]"),
                                               (energy, dense.energy, flow.found["energy_beats"], GREEN, "kinetic energy\na ball  [m g r]")):
        axes.plot(time, values[here], ".-", color=colour, lw=1.2, ms=3)
        shown = beats[(beats[:, 0] >= time[0]) & (beats[:, 0] <= time[-1])]
        axes.plot(shown[:, 0], shown[:, 1], "v", color=INK, ms=6)
        over(axes, time, label, ylim=(0, None))
    energy.set_xlabel("time  [s]")


# ------------------------------------------------------------------ frequencies

def draw_spectrum(figure, dense):
    total, motion = figure.subplots(1, 2)
    spectra = dense.spectra_of_flow()
    known = spectra["frequency"] > 0
    frequency = spectra["frequency"][known]
    for name, colour, label in (("lateral_x", BLUE, "x"), ("lateral_y", ORANGE, "y")):
        total.loglog(frequency, spectra[name][known] / 1e6, color=colour, label=label)
    total.axvspan(*BAND, color=GRID, lw=0, zorder=0)
    total.set(xlabel="frequency  [Hz]", ylabel="sideways force on the wall  [kN²/Hz]")
    for name, colour, label in (("sinking_speed", BLUE, "sinking speed"), ("energy", GREEN, "kinetic energy"), ("patch_pressure", PURPLE, "pressure on the patch")):
        if name in spectra:
            density = spectra[name][known]
            motion.loglog(frequency, density / (density.sum() * frequency[0]), color=colour, label=label)
    motion.set(xlabel="frequency  [Hz]", ylabel="density over its sum  [1/Hz]")
    for axes in (total, motion):
        soft_grid(axes)
        axes.legend(frameon=False)


def draw_layers(figure, dense):
    spectra = dense.spectra_of_flow()
    if "lateral_by_layer" not in spectra:
        raise NothingToDraw("there is no wall")
    density = spectra["lateral_by_layer"].reshape(-1, len(spectra["frequency"]))
    known = spectra["frequency"] > 0
    frequency = spectra["frequency"][known]
    axes, shares = figure.subplots(1, 2, width_ratios=[1.6, 1])
    shown = np.log10(np.maximum(density[:, known], density[:, known].max() * 1e-8) / 1e6)
    picture = axes.pcolormesh(np.append(frequency, frequency[-1] + frequency[0]) - 0.5 * frequency[0], dense.edges, shown, cmap="viridis")
    axes.set(xscale="log", xlabel="frequency  [Hz]", ylabel="height  [m]")
    bar = figure.colorbar(picture, ax=axes)
    bar.set_label("sideways force of the layer  [log10 kN²/Hz]")
    middle = 0.5 * (dense.edges[1:] + dense.edges[:-1])
    shares.plot(np.sqrt(density.sum(axis=1) * frequency[0]) / 1e3, middle, "o-", color=BLUE, ms=4)
    shares.set(xlabel="its rms about the mean  [kN]", ylim=(dense.edges[0], dense.edges[-1]), xlim=(0, None))
    soft_grid(shares)


# ------------------------------------------------------------------ one place, and the hammer

def draw_place(figure, dense):
    if dense.patch is None:
        raise NothingToDraw("no patch of the wall is recorded")
    axes, close = figure.subplots(2, 1, height_ratios=[1.3, 1])
    axes.plot(dense.time, dense.patch / 1e3, color=BLUE, lw=0.5)
    over(axes, dense.time, "pressure on the\npatch  [kPa]", ylim=(0, None))
    for phase in dense.open:
        for edge in phase.span:
            axes.axvline(edge, color=MUTED, lw=0.8)
    highest = int(np.argmax(dense.patch))
    axes.plot(dense.time[highest], dense.patch[highest] / 1e3, "v", color=RED, ms=7)
    axes.text(dense.time[highest], dense.patch[highest] / 1e3, f"  {dense.patch[highest] / 1e3:.0f} kPa at {dense.time[highest]:.2f} s", color=RED, va="center", fontsize=10)
    shut = dense.shut()
    if shut is None:
        close.set_axis_off()
        return
    begin, end = dense.time[shut[0]], dense.time[shut[-1]]
    near = (dense.time > begin - 3) & (dense.time < end + 3)
    close.plot(dense.time[near], dense.patch[near] / 1e3, color=BLUE, lw=1)
    close.axvspan(begin, end, color="#f7d7cf", lw=0, zorder=0)
    over(close, dense.time[near], "around the\nhammer  [kPa]", ylim=(0, None), xlabel="time  [s]; grey lines: outlet opened or shut")


def draw_hammer(figure, dense):
    shut = dense.shut()
    if shut is None or dense.hammer is None:
        raise NothingToDraw("the run closes no outlet that was open")
    begin = dense.time[shut[0]]
    curves, layers = figure.subplots(1, 2, width_ratios=[1.5, 1])
    near = (dense.time > begin - 1.0) & (dense.time <= dense.time[shut[-1]] + 1e-9)
    before = (dense.time > begin - 20) & (dense.time <= begin + 1e-9) & dense.within(dense.flow().span)
    names = [name for name in dense.hammer if name.endswith(" m")]
    heights = [float(name.split()[0]) for name in names]
    number = {name: int(np.argmin(np.abs(dense.edges[:-1] - height))) for name, height in zip(names, heights)}
    ranked = sorted(names, key=lambda name: -dense.hammer[name][1][1])[:2]
    shown = [(name, dense.wall_force[:, number[name]], colour) for name, colour in zip(ranked, (RED, ORANGE))]
    shown.append(("all of the wall", dense.wall_force.sum(axis=1), INK))
    if dense.patch is not None:
        shown.append(("patch", dense.patch, BLUE))
    for name, values, colour in shown:
        curves.plot(dense.time[near] - begin, values[near] / values[before].mean(), color=colour, lw=1.3, label=name)
    curves.axhline(1.1, color=INK, lw=1, ls=(0, (4, 3)))
    curves.axvline(0, color=MUTED, lw=1)
    curves.set(xlabel="time after closing  [s]", ylabel="over the mean of the 20 s before", ylim=(0, None))
    curves.legend(frameon=False)
    for side, colour, label in ((0, MUTED, "over rest"), (1, RED, "over the flow before")):
        layers.plot([dense.hammer[name][side][1] for name in names], heights, "o-", color=colour, ms=4, label=label)
    layers.axvline(1, color=INK, lw=1)
    layers.set(xlabel="highest pressure in the hammer, by layer", ylabel="lower edge of the layer  [m]")
    layers.legend(frameon=False)
    for axes in (curves, layers):
        soft_grid(axes)


CHARTS = {chart.name: chart for chart in (
    Chart("rhythm", "", draw_rhythm, fixed(12, 7.6)),
    Chart("rhythm_close", "", draw_rhythm_close, fixed(12, 5.2)),
    Chart("spectrum", "", draw_spectrum, fixed(13, 5.2)),
    Chart("spectrum_by_layer", "", draw_layers, fixed(13, 5.6)),
    Chart("place", "", draw_place, fixed(12, 6.6)),
    Chart("hammer_close", "", draw_hammer, fixed(13, 5.4)),
)}


# ------------------------------------------------------------------ sentences

def rhythm_words(dense):
    flow = dense.flow()
    here = dense.within(flow.span)
    speed = dense.speed[here]
    intervals = np.diff(flow.found["speed_beats"][:, 0])
    beats = f"{len(flow.found['speed_beats'])} beats of the sinking speed" + (f", {np.median(intervals):.1f} s apart (median)" if intervals.size else "")
    return (f"In \"{flow.name}\" {len(flow.found['stoppages'])} stoppages; the longest time without a ball leaving is {flow.longest_pause:.2f} s. The sinking speed stays "
            f"within {percent(speed.min() / speed.mean())} and {percent(speed.max() / speed.mean())} of its mean (standard deviation {percent(speed.std() / speed.mean())}); {beats}.")


def sideways_words(dense):
    spectra = dense.spectra_of_flow()
    frequency, density = spectra["frequency"], spectra["lateral_x"] + spectra["lateral_y"]
    if not density.any():
        raise NothingToDraw("nothing pushes sideways")
    near = (frequency > BAND[0]) & (frequency < BAND[1])
    return (f"The sideways force, as means between records, has {np.sqrt(density.sum() * frequency[1]) / 1e3:.0f} kN rms and is strongest at "
            f"{frequency[np.argmax(density)]:.1f} Hz; {percent(density[near].sum() / density.sum())} of its power lie between {BAND[0]:.0f} and {BAND[1]:.0f} Hz, "
            f"{percent(density[frequency < 0.5].sum() / density.sum(), 2)} below 0.5 Hz.")


def hammer_words(dense):
    if dense.hammer is None:
        raise NothingToDraw("the run closes no outlet that was open")
    begin = dense.time[dense.shut()[0]]
    told = []
    for place, (rest, flow) in dense.hammer.items():
        if place in ("patch", "wall") or flow[3] > 0:
            name = {"patch": "patch", "wall": "all of the wall"}.get(place, f"layer {place}")
            told.append(f"{name}: {rest[1]:.2f} of rest, {flow[1]:.2f} of the flow before, {flow[2] - begin:.2f} s after closing, above 1.1 of it for {flow[3]:.2f} s")
    return "; ".join(told) + "."
