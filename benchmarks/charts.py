#!/usr/bin/python3
"""Charts of a study: what it costs to be how accurate, where a method is stable, how long a trajectory means something.

    charts.py DIR [--out DIR]

Reads DIR/study.h5, as `grainclock study` leaves it, and draws each chart whose tables are there, as PNG into --out
(default: DIR). As a module: read_study(DIR), CHARTS, figure_of(chart, data); every draw_... fills an empty figure and
raises NothingToDraw where its tables are missing. The pictures of the flow come from the last frame of a run.
"""

import argparse
import math
import os
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import h5py
import matplotlib
import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator, NullFormatter

INK, MUTED, GRID, WALL = "#1b1f24", "#6a737d", "#e3e6ea", "#c9ced6"
HALO = [withStroke(linewidth=2.5, foreground="white")]
# A hue per family, a shade and a marker per variant; the hues (Okabe-Ito) stay apart for colour-blind readers.
FAMILIES = {
    "plain": ("Uniform, plain", ["#5f6770"], "s"),
    "events": ("Uniform with events", ["#0072b2"], "D"),
    "uniform": ("Other uniform", ["#56b4e9", "#7a9bd0", "#3c6e8f"], "dhH"),
    "multirate": ("Multi-rate", ["#d55e00", "#e6a000", "#b2182b", "#cc79a7", "#8c4a1f"], "o^vXP"),
    "sundials": ("SUNDIALS", ["#009e73", "#3f7f3a", "#8dbb3c", "#2f8f9d", "#6b5aa8", "#a6a24a"], "<>^vPX"),
}
QUANTITIES = {"sweeps": "contact evaluations  [sweeps over all listed pairs]", "wall_s": "wall time  [s]"}
GAINS = {"sweeps": ("counted_gain", "gain_events_counted"), "wall_s": ("measured_gain", "gain_events_measured")}
BASELINES = {"plain": "plain uniform steps", "events": "uniform steps with events", "sundials": "the best of SUNDIALS"}
ERRORS = (1e-2, 1e-3, 1e-4, 1e-5)  # at which methods are compared
TARGET_ERROR = 1e-4
REFERENCE_SHARE = 10.0  # an error counts when it is this many times the reference's own uncertainty
PROMISE = 3.0           # the achieved error lies within this factor of the tolerance's law

matplotlib.rcParams.update({
    "font.family": "DejaVu Sans", "font.size": 11, "axes.edgecolor": MUTED, "axes.labelcolor": INK,
    "axes.titleweight": "bold", "axes.titlesize": 12, "text.color": INK, "xtick.color": MUTED, "ytick.color": MUTED,
    "axes.spines.top": False, "axes.spines.right": False, "savefig.facecolor": "white",
})


class NothingToDraw(Exception):
    """The study has no data for a chart; the text says what is missing."""


# ------------------------------------------------------------------ reading

@dataclass
class Study:
    path: Path
    name: str         # of its scene, or of its kind
    tables: dict      # name -> rows; a row: column -> text or number, None where unknown
    provenance: dict  # name -> text

    def rows(self, table):
        if not self.tables.get(table):
            raise NothingToDraw(f"the study has no table /{table}")
        return self.tables[table]


def known(cell):
    """A cell of a table: bytes as text, nan as None."""
    if isinstance(cell, bytes):
        return cell.decode()
    return None if isinstance(cell, float) and math.isnan(cell) else cell


def read_tables(file):
    """{table: rows} of an open study.h5."""
    tables = {}
    for name, group in file.items():
        if name == "provenance":
            continue
        columns = {key: [known(cell) for cell in dataset[()].tolist()] for key, dataset in group.items()}
        tables[name] = [dict(zip(columns, cells)) for cells in zip(*columns.values())]
    return tables


def read_provenance(file):
    """Texts and numbers of /provenance, as texts."""
    found = {}
    for key, dataset in file.get("provenance", {}).items():
        value = dataset[()]
        found[key] = value.decode() if isinstance(value, bytes) else str(np.squeeze(value))
    return found


def study_name(told, path):
    """The name of the study's directory; of one called `study` the stem of its scene, or its kind."""
    directory = path.resolve().name
    if directory != "study":
        return directory
    try:
        plan = tomllib.loads(told.get("study", ""))
    except tomllib.TOMLDecodeError:
        plan = {}
    return Path(plan["scene"]).stem if "scene" in plan else plan.get("kind", directory)


def read_study(directory):
    path = Path(directory)
    with h5py.File(path / "study.h5", "r") as file:
        told = read_provenance(file)
        return Study(path, study_name(told, path), read_tables(file), told)


def newest_studies(out):
    """The newest study of each name and set of tables below a directory, the newest first."""
    files = sorted(Path(out).glob("**/study.h5"), key=lambda file: file.stat().st_mtime, reverse=True)
    found = {}
    for study in (read_study(file.parent) for file in files):
        found.setdefault((study.name, *sorted(study.tables)), study)
    return list(found.values())


# ------------------------------------------------------------------ numbers

def geometric_mean(values):
    return math.exp(sum(map(math.log, values)) / len(values))


def short(number):
    """1e-4, 2.5e-5: a small number without padding."""
    mantissa, exponent = f"{number:.1e}".split("e")
    return f"{mantissa.removesuffix('.0')}e{int(exponent)}"


def amount(number):
    """Three digits, no exponents below a billion: 0.0123, 267, 12,800."""
    return f"{number:,.0f}" if number >= 1000 else f"{number:.3g}"


def with_range(values, unit="×"):
    """Geometric mean and, of several values, their range."""
    text = f"{amount(geometric_mean(values))}{unit}"
    return text + (f" ({amount(min(values))} to {amount(max(values))})" if len(values) > 1 else "")


def cost_at(error, points):
    """Cost at which (error, cost) points reach an error, by the rule of benchmarks/gain.hpp; None if they never do."""
    front = []
    for reached, cost in sorted(points, key=lambda p: (p[1], p[0])):
        if not front or reached < front[-1][0]:
            front.append((reached, cost))
    if not front or error < front[-1][0]:
        return None
    if error >= front[0][0]:
        return front[0][1]
    (coarse, cheap), (fine, dear) = next((a, b) for a, b in zip(front, front[1:]) if b[0] <= error)
    return cheap * (dear / cheap) ** (math.log(coarse / error) / math.log(coarse / fine))


# ------------------------------------------------------------------ trajectories: methods and what they cost

def family(row):
    if row["method"] in ("cvode", "arkode"):
        return "sundials"
    if row["method"] == "multirate":
        return "multirate"
    if row["integrator"] != "predicted" or row["dashpot"] != "explicit":
        return "uniform"
    return "events" if row["events"] == "true" else "plain"


def variant(row):
    """What tells the methods of a family apart, beside events and roots."""
    if family(row) == "sundials":
        return (row["method"], row.get("variant") or "")
    return (row["integrator"], row["dashpot"], row["interface"] or "")


def setting(row):
    """What was turned at this point, as a short label."""
    if row.get("rtol") and row.get("variant") != "mri":
        return f"rtol {short(row['rtol'])}"
    if row["method"] == "multirate":
        return f"tol {short(row['tolerance'])}"
    return f"{row['step'] * 1e6:.4g} µs" if row["step"] else ""


def is_point(row):
    return not row["name"].startswith("reference")


def counts(row):
    """Whether the point has an error and costs that can be charted."""
    return row["status"] == "ok" and all(0 < (row.get(key) or 0) < math.inf for key in ("error_rms", *QUANTITIES))


class Point:
    """One setting of a method, run from every start state."""

    def __init__(self, rows, floor):
        self.rows = rows
        self.setting = setting(rows[0])
        self.trusted = all(row["error_rms"] >= floor[row["start"]] for row in rows)

    def values(self, column):
        return [row[column] for row in self.rows if row.get(column)]

    def mean(self, column):
        return geometric_mean(self.values(column))


class Series:
    """One method of a study: its points from the cheapest on, and how it looks."""

    def __init__(self, label, rows, floor, one_clock=True):
        self.label, self.family, self.variant, self.one_clock = label, family(rows[0]), variant(rows[0]), one_clock
        self.starts = sorted({row["start"] for row in rows})
        by_place = {}
        for start in self.starts:
            for place, row in enumerate(r for r in rows if r["start"] == start):
                by_place.setdefault(place, []).append(row)
        # A mean over other start states than its neighbours' would mislead: a point that failed from one is left out.
        whole = [rows for rows in by_place.values() if len(rows) == len(self.starts) and all(map(counts, rows))]
        self.points = sorted((Point(rows, floor) for rows in whole), key=lambda p: p.mean("sweeps"))
        self.dashed = (self.family == "multirate" and rows[0]["events"] == "false") or rows[0].get("roots") == "true"
        self.colour, self.marker = INK, "o"

    def costs_at(self, error, quantity):
        """{start: cost} at this error; empty where the method does not reach it from every start state, or no clock is common."""
        if quantity == "wall_s" and not self.one_clock:
            return {}
        costs = {}
        for start in self.starts:
            rows = [row for p in self.points for row in p.rows if row["start"] == start]
            costs[start] = cost_at(error, [(row["error_rms"], row[quantity]) for row in rows])
        return {} if None in costs.values() else costs

    def line(self, **more):
        return {"color": self.colour, "ls": (0, (4, 2)) if self.dashed else "-",
                "lw": 2.4 if self.family == "multirate" else 1.6, **more}


def floors(rows):
    """Per start state the smallest error that its reference can judge; infinite where that was not checked."""
    checked = {row["start"]: REFERENCE_SHARE * row["error_rms"] for row in rows
               if row["name"] == "reference_check" and row.get("error_rms")}
    return {start: checked.get(start, math.inf) for start in {row["start"] for row in rows}}


def share_a_clock(rows):
    """Whether all runs from a start state were timed on one machine; files of old do not tell, they had one machine."""
    machines = {}
    for row in filter(counts, filter(is_point, rows)):
        machines.setdefault(row["start"], set()).add((row.get("host"), row.get("threads")))
    return all(len(its) == 1 and ";" not in str(next(iter(its))) for its in machines.values())


def give_looks(series):
    """Colours and markers: one shade per variant; another where two methods would look alike."""
    for kind, (_, colours, markers) in FAMILIES.items():
        shades, taken = {}, set()
        for s in (s for s in series if s.family == kind):
            shade = shades.setdefault(s.variant, len(shades))
            while (shade, s.dashed) in taken:
                shade += 1
            taken.add((shade, s.dashed))
            s.colour, s.marker = colours[shade % len(colours)], markers[shade % len(markers)]


def series_of(study):
    """The methods of a study of trajectories, by family."""
    rows = study.rows("study")
    floor, methods = floors(rows), {}
    for row in filter(is_point, rows):
        methods.setdefault((row["name"], variant(row), row["events"], row.get("roots")), []).append(row)
    names = [key[0] for key in methods]
    series = []
    for key, its_rows in methods.items():
        told_apart = [part for part in (key[1][-1], "roots" if key[3] == "true" else "") if part and part not in key[0]]
        label = key[0] if names.count(key[0]) == 1 else " ".join([key[0], *told_apart])
        series.append(Series(label, its_rows, floor, share_a_clock(rows)))
    series = sorted((s for s in series if s.points), key=lambda s: list(FAMILIES).index(s.family))
    if not series:
        raise NothingToDraw("no point of the study has an error")
    give_looks(series)
    return series


def judged_from(study):
    """The smallest error that the references from all start states can judge."""
    return max(floors(study.rows("study")).values())


def ranking(series, error, quantity):
    """[(mean cost, series)] of the methods that reach this error, the cheapest first."""
    reached = [(geometric_mean(costs.values()), s) for s in series if (costs := s.costs_at(error, quantity))]
    return sorted(reached, key=lambda pair: pair[0])


def gains_over(series, baseline, error, quantity):
    """How many times cheaper `series` is than the best of a family at this error, for each start state; [] if unknown."""
    own = series.costs_at(error, quantity)
    found = [(mean, s) for mean, s in ranking(baseline, error, quantity) if s is not series]
    if not own or not found:
        return []
    other = found[0][1].costs_at(error, quantity)
    return [other[start] / own[start] for start in own]


@dataclass
class Choice:
    """Which method to take at an error: the cheapest, its cost, and what the best of SUNDIALS costs there."""
    study: str
    error: float
    quantity: str
    best: Series = None        # None: no method reaches the error, or the reference cannot judge it
    cost: float = None
    why_none: str = ""
    sundials: Series = None    # None: none of them reaches it
    sundials_factor: float = None  # cost of SUNDIALS over that of the best

    def cost_text(self):
        return f"{amount(self.cost)} sweeps" if self.quantity == "sweeps" else f"{amount(self.cost)} s"


def choice(study, error, quantity, series=None):
    series = series or series_of(study)
    if error < judged_from(study):
        return Choice(study.name, error, quantity, why_none="finer than the reference can judge")
    order = ranking(series, error, quantity)
    if not order:
        timed = quantity != "wall_s" or series[0].one_clock
        return Choice(study.name, error, quantity, why_none="not reached by any method" if timed else "timed on several machines")
    cost, best = order[0]
    found = Choice(study.name, error, quantity, best, cost)
    judges = [(c, s) for c, s in order if s.family == "sundials"]
    if judges:
        found.sundials, found.sundials_factor = judges[0][1], judges[0][0] / cost
    return found


@dataclass
class Headline:
    """The best selective method at one error, and its gain over each baseline, for each start state."""
    error: float
    series: Series
    gains: dict  # (quantity, kind of BASELINES) -> gains, one per start state


def headline(study, error=TARGET_ERROR):
    """At the target error, or at the smallest one that a selective method reaches and the reference can judge."""
    series = series_of(study)
    selective = [s for s in series if s.family == "multirate"]
    if not selective or not math.isfinite(judged_from(study)):
        return None
    reached = min(max(min(row["error_rms"] for p in s.points for row in p.rows if row["start"] == start) for start in s.starts)
                  for s in selective)
    error = max(error, reached, judged_from(study))
    best = ranking(selective, error, "sweeps")[0][1]
    gains = {(quantity, kind): gains_over(best, [s for s in series if s.family == kind], error, quantity)
             for quantity in QUANTITIES for kind in BASELINES}
    return Headline(error, best, gains)


# ------------------------------------------------------------------ error against cost

def soft_grid(axes):
    axes.grid(True, which="major", color=GRID, lw=0.8)
    axes.set_axisbelow(True)


def draw_points(axes, series, quantity):
    """Line and markers of a method; hollow where the reference cannot judge, with the range over start states."""
    x, y = ([p.mean(column) for p in series.points] for column in (quantity, "error_rms"))
    strong = series.family == "multirate"
    axes.plot(x, y, zorder=4 if strong else 3, **series.line())
    for a, b, p in zip(x, y, series.points):
        axes.plot([a], [b], marker=series.marker, ms=8 if strong else 6.5, color=series.colour, zorder=5 if strong else 4,
                  mfc=series.colour if p.trusted else "white", mec="white" if p.trusted else series.colour,
                  mew=0.8 if p.trusted else 1.5)
        if len(p.rows) > 1 and series.family not in ("plain", "events"):
            axes.plot([a, a], [min(p.values("error_rms")), max(p.values("error_rms"))], color=series.colour, lw=1, alpha=0.5)


def draw_band(axes, series, quantity):
    """The range of a baseline over start states."""
    x = [p.mean(quantity) for p in series.points]
    low, high = ([pick(p.values("error_rms")) for p in series.points] for pick in (min, max))
    axes.fill_between(x, low, high, color=series.colour, alpha=0.13, lw=0, zorder=1)


# Where labels go by family, in points, so that neighbouring lines do not write over each other.
LABEL_PLACES = {"plain": (7, 5), "events": (-7, -4), "multirate": (-8, -4), "sundials": (8, 4), "uniform": (7, 5)}


def label_points(axes, series, quantity, taken):
    """Settings beside their points, where no label in `taken` (boxes in pixels) stands yet."""
    right, up = LABEL_PLACES[series.family]
    per_point = axes.figure.dpi / 72
    for p in filter(lambda p: p.trusted, series.points):
        place = (p.mean(quantity), p.mean("error_rms"))
        x, y = axes.transData.transform(place)
        width, height = 4.4 * len(p.setting) * per_point, 9 * per_point
        box = (x if right > 0 else x - width, y if up > 0 else y - height, width, height)
        if any(abs(box[0] - b[0]) < max(width, b[2]) and abs(box[1] - b[1]) < height for b in taken):
            continue
        taken.append(box)
        axes.annotate(p.setting, place, xytext=(right, up), textcoords="offset points", fontsize=7.5, color=series.colour,
                      ha="left" if right > 0 else "right", va="bottom" if up > 0 else "top", zorder=6, path_effects=HALO)


def labelled(series, quantity, floor):
    """The methods whose settings are written out, most important first: the best of each kind, and the winners."""
    order = [s for _, s in ranking(series, max(floor, TARGET_ERROR), quantity)]
    order += [s for s in series if s not in order]
    winning = [best for *_, best in winners(series, quantity, *error_range(series)) if best]
    best = {kind: next((s for s in order if s.family == kind), None) for kind in ("multirate", "plain", "events", "sundials")}
    return list(dict.fromkeys([*order[:1], *filter(None, best.values()), *winning]))


def winners(series, quantity, low, high):
    """[(from, to, series)]: bands of error, from low to high, each with its cheapest method; None: nobody gets there."""
    edges = np.geomspace(low, high, 241)
    bands = []
    for a, b in zip(edges, edges[1:]):
        order = ranking(series, math.sqrt(a * b), quantity)
        best = order[0][1] if order else None
        if bands and bands[-1][2] is best:
            bands[-1] = (bands[-1][0], b, best)
        else:
            bands.append((a, b, best))
    return bands


def draw_winners(axes, bands, floor):
    """A strip beside the panel: which method is the cheapest at the error on the same height."""
    low, high = axes.get_ylim()
    left, width, across = 1.012, 0.042, axes.get_yaxis_transform()
    for a, b, best in bands:
        if not best or b <= floor:
            continue
        a = max(a, floor)
        axes.add_patch(Rectangle((left, a), width, b - a, transform=across, color=best.colour, lw=0, clip_on=False))
        if math.log(b / a) / math.log(high / low) > 0.018 * len(best.label):
            axes.text(left + width / 2, math.sqrt(a * b), best.label, transform=across, rotation=90, ha="center",
                      va="center", color="white", fontsize=8.5, fontweight="bold")
    axes.text(left + width / 2, 1.01, "cheapest", transform=axes.transAxes, ha="center", va="bottom", fontsize=8.5, color=MUTED)


def draw_floor(axes, floor):
    """Shades the errors that the reference cannot judge."""
    low, high = axes.get_ylim()
    if floor <= low:
        return
    axes.axhspan(low, min(floor, high), color="#f1f2f4", lw=0, zorder=0)
    text = "not judged: below ten times the reference's own uncertainty" if math.isfinite(floor) else "the reference was not checked"
    axes.text(0.985, 0.008, text, transform=axes.transAxes, ha="right", va="bottom", fontsize=8, color=MUTED)
    axes.set_ylim(low, high)


def family_legend(figure, series, hollow, **place):
    """All methods under the names of their families, and what a hollow marker means if there is one."""
    handles, titles = [], set()
    for kind, (title, _, _) in FAMILIES.items():
        members = [s for s in series if s.family == kind]
        if not members:
            continue
        titles.add(title)
        handles.append(Line2D([], [], ls="none", label=title))
        handles += [Line2D([], [], marker=s.marker, ms=7, mec="white", label=s.label, **s.line()) for s in members]
    if hollow:
        handles.append(Line2D([], [], ls="none", marker="o", mfc="white", mec=MUTED, mew=1.5, label="hollow: not judged"))
    legend = figure.legend(handles=handles, frameon=False, fontsize=9.5, labelspacing=0.45, handlelength=2.6, **place)
    for text in legend.get_texts():
        if text.get_text() in titles:
            text.set(fontweight="bold", color=INK, position=(-34, 0))


def gain_words(gains):
    """"12× less", or "1.3× more" where it loses."""
    if geometric_mean(gains) >= 1:
        return f"{with_range(gains)} less"
    return f"{with_range([1 / g for g in gains])} more"


def failures(study):
    failed = [row for row in study.rows("study") if row["status"].startswith("failed")]
    return f"{len(failed)} of {len(study.rows('study'))} runs failed in the numerics and are not drawn." if failed else ""


def draw_accuracy(figure, study):
    """Error against contact evaluations and against wall time, all methods."""
    series = series_of(study)
    floor = judged_from(study)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (quantity, label) in zip(panels, QUANTITIES.items()):
        for s in series:
            if s.family in ("plain", "events"):
                draw_band(axes, s, quantity)
            draw_points(axes, s, quantity)
        axes.set(xscale="log", yscale="log", xlabel=label)
        soft_grid(axes)
        axes.margins(x=0.12, y=0.06)
        plain_numbers(axes.xaxis)
    figure.subplots_adjust(left=0.05, right=0.785, top=0.8, bottom=0.09, wspace=0.14)
    for axes, quantity, title in zip(panels, QUANTITIES, ("Work", "Time")):
        taken = []
        for s in labelled(series, quantity, floor):
            label_points(axes, s, quantity, taken)
        draw_floor(axes, floor)
        draw_winners(axes, winners(series, quantity, *axes.get_ylim()), floor)
        told = headline_text(study, quantity)
        axes.set_title(title, loc="left", pad=6 + 13.5 * len(told.splitlines()))
        axes.text(0, 1.02, told, transform=axes.transAxes, fontsize=9.5, linespacing=1.35)
    panels[0].set_ylabel("rms position error  [relative to rms displacement]")
    figure.suptitle(f"{study.name}: lower and further left is better", x=0.05, y=0.985, ha="left", fontsize=14.5, fontweight="bold")
    starts = len(series[0].starts)
    clock = "" if series[0].one_clock else "Timed on several machines: times cannot be compared."
    notes = [clock, f"geometric means over {starts} start states; bands and bars: their range" if starts > 1 else "", failures(study)]
    figure.text(0.05, 0.01, "   ".join(filter(None, notes)), fontsize=8.5, color=MUTED)
    family_legend(figure, series, not all(p.trusted for s in series for p in s.points), loc="upper left", bbox_to_anchor=(0.822, 0.825))


def error_range(series):
    errors = [row["error_rms"] for s in series for p in s.points for row in p.rows]
    return min(errors), max(errors) * 1.001


def headline_text(study, quantity):
    """The gains of the best selective method for the top of a panel."""
    found = headline(study)
    if not found:
        return ""
    parts = [f"{gain_words(gains)} than {name}" for kind, name in BASELINES.items() if (gains := found.gains[quantity, kind])]
    head = f"At error {short(found.error)} '{found.series.label}' costs"
    return "\n".join([head, *(f"    {part}" for part in parts)]) if parts else ""


# ------------------------------------------------------------------ gains at equal error

def draw_gains(figure, study):
    """Gain over each baseline at the error of each point, with the range over start states."""
    series = series_of(study)
    panels = figure.subplots(2, 2, sharex=True, sharey="row", squeeze=False)
    baselines = ("plain uniform steps", "uniform steps with events")
    drawn = 0
    for column, quantity in enumerate(QUANTITIES):
        for row, (baseline, gain) in enumerate(zip(baselines, GAINS[quantity])):
            axes = panels[row][column]
            for s in series:
                if s.family != ("plain", "events")[row]:
                    drawn += draw_gain_line(axes, s, gain)
            axes.axhline(1.0, color=INK, lw=1.2, zorder=2)
            axes.annotate(baseline, (1, 1), xycoords=("axes fraction", "data"), xytext=(-4, 4), textcoords="offset points",
                          ha="right", va="bottom", fontsize=9, path_effects=HALO)
            axes.set(xscale="log", yscale="log")
            soft_grid(axes)
            plain_numbers(axes.yaxis)
    if not drawn:
        raise NothingToDraw("no gain is known: no baseline in the study, or it never got as accurate as the others")
    for axes, title in zip(panels[0], ("Work", "Time")):
        axes.set_title(title, loc="left")
    panels[0][0].invert_xaxis()  # shared: the more accurate, the further right
    for axes in panels[1]:
        axes.set_xlabel("rms position error  (more accurate to the right)")
    for axes, name in zip(panels[:, 0], ("plain", "events")):
        axes.set_ylabel("times cheaper than " + ("plain uniform" if name == "plain" else "uniform with events"))
    starts = len(series[0].starts)
    means = f"; geometric means over {starts} start states, bars: their range" if starts > 1 else ""
    figure.suptitle(f"{study.name}: what is saved at equal error", x=0.06, y=0.985, ha="left", fontsize=14.5, fontweight="bold")
    figure.text(0.06, 0.94, "Above the line cheaper than the baseline at its own best step, below it dearer" + means, fontsize=10.5,
                va="top")
    figure.subplots_adjust(left=0.06, right=0.79, top=0.875, bottom=0.075, wspace=0.06, hspace=0.09)
    hollow = not all(p.trusted for s in series for gains in GAINS.values() for gain in gains for p in known_gains(s, gain))
    family_legend(figure, series, hollow, loc="upper left", bbox_to_anchor=(0.8, 0.885))


def known_gains(series, gain):
    """The points whose gain is known from every start state."""
    return [p for p in series.points if len(p.values(gain)) == len(p.rows)]


def draw_gain_line(axes, series, gain):
    """Draws what is known of a method's gain; returns the number of points."""
    points = sorted(known_gains(series, gain), key=lambda p: p.mean("error_rms"))
    x, y = ([p.mean(column) for p in points] for column in ("error_rms", gain))
    axes.plot(x, y, zorder=3, **series.line())
    for a, b, p in zip(x, y, points):
        axes.plot([a], [b], marker=series.marker, ms=7.5, color=series.colour, mfc=series.colour if p.trusted else "white",
                  mec="white" if p.trusted else series.colour, mew=0.8 if p.trusted else 1.5, zorder=5)
        axes.plot([a, a], [min(p.values(gain)), max(p.values(gain))], color=series.colour, lw=1.6, alpha=0.6, zorder=4)
    return len(points)


def plain_numbers(axis):
    """0.1, 1, 10 in place of powers, on a logarithmic axis; nothing between them where one of them is seen."""
    axis.set_major_formatter(lambda value, _: amount(value))
    low, high = axis.get_view_interval()
    if math.floor(math.log10(high)) >= math.log10(low):
        axis.set_minor_formatter(NullFormatter())


# ------------------------------------------------------------------ which method at which accuracy

def draw_methods(figure, study):
    """For each error what each method costs, as a multiple of the cheapest."""
    series = series_of(study)
    panels = figure.subplots(1, 2, sharey=True)
    colours = matplotlib.colormaps["Blues_r"]
    dearest = 300.0  # times the cheapest, and beyond: the palest cell
    for axes, (quantity, title) in zip(panels, (("sweeps", "Contact evaluations"), ("wall_s", "Wall time"))):
        for column, error in enumerate(ERRORS):
            found = choice(study, error, quantity, series)
            for line, s in enumerate(series):
                costs = s.costs_at(error, quantity)
                if not found.best or not costs:
                    text_cell(axes, column, line, "–", "#f4f5f7", MUTED)
                    continue
                factor = geometric_mean(costs.values()) / found.cost
                shade = min(1.0, math.log(max(factor, 1.0)) / math.log(dearest)) ** 0.6
                is_best = s is found.best
                text_cell(axes, column, line, found.cost_text() if is_best else f"{amount(factor)}×", colours(0.05 + 0.9 * shade),
                          "white" if shade < 0.45 else INK, is_best)
        table_axes(axes, title, len(series))
    panels[0].set_yticks(range(len(series)), [s.label for s in series])
    for text, s in zip(panels[0].get_yticklabels(), series):
        text.set_color(s.colour)
    heading(figure, f"{study.name}: which method at which accuracy")
    figure.supxlabel("Framed: the cheapest method and its cost. Others: how many times as much for the same error. "
                     "–: not reached, or finer than the reference can judge.", fontsize=9, color=MUTED)


def heading(figure, text):
    """A title of the whole figure, above all that is laid out."""
    height = 0.42 / figure.get_figheight()
    figure.get_layout_engine().set(rect=(0, 0, 1, 1 - height))
    figure.text(0.012, 1 - 0.2 * height, text, fontsize=14.5, fontweight="bold", va="top").set_in_layout(False)


def table_axes(axes, title, lines):
    """Empty cells of a table whose columns are the errors."""
    axes.set(xlim=(-0.5, len(ERRORS) - 0.5), ylim=(lines - 0.5, -0.5))
    axes.set_xticks(range(len(ERRORS)), [f"error {short(e)}" for e in ERRORS])
    axes.xaxis.tick_top()
    axes.tick_params(length=0, labelcolor=INK)
    axes.set_title(title, loc="left", pad=10)
    for spine in axes.spines.values():
        spine.set_visible(False)


def text_cell(axes, column, line, text, colour, ink, framed=False):
    axes.add_patch(Rectangle((column - 0.48, line - 0.44), 0.96, 0.88, facecolor=colour, zorder=3 if framed else 2,
                             edgecolor="#d55e00" if framed else "white", lw=3 if framed else 0))
    axes.text(column, line, text, ha="center", va="center", color=ink, fontsize=9.5, zorder=4,
              fontweight="bold" if framed else "normal")


def draw_overview(figure, studies):
    """One row per study: the cheapest method at each error, its cost, and SUNDIALS's there."""
    studies = [study for study in studies if "study" in study.tables]
    if not studies:
        raise NothingToDraw("no study of trajectories")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (quantity, title) in zip(panels, (("sweeps", "Least work"), ("wall_s", "Least time"))):
        for line, study in enumerate(studies):
            series = series_of(study)
            for column, error in enumerate(ERRORS):
                overview_cell(axes, column, line, choice(study, error, quantity, series))
        table_axes(axes, title, len(studies))
    panels[0].set_yticks(range(len(studies)), [study.name for study in studies], fontweight="bold")
    heading(figure, "Which method at which accuracy, and what SUNDIALS costs there")


def overview_cell(axes, column, line, found):
    box = {"width": 0.96, "height": 0.9, "lw": 0}
    corner = (column - 0.48, line - 0.45)
    if not found.best:
        axes.add_patch(Rectangle(corner, facecolor="#f4f5f7", **box))
        axes.text(column, line, found.why_none.replace(" than ", "\nthan ").replace(" by ", "\nby "), ha="center", va="center",
                  fontsize=8, color=MUTED)
        return
    axes.add_patch(Rectangle(corner, facecolor=found.best.colour, **box))
    axes.text(column, line - 0.2, wrapped(found.best.label), ha="center", va="center", fontsize=9.5, color="white",
              fontweight="bold", linespacing=1.05)
    axes.text(column, line + 0.1, found.cost_text(), ha="center", va="center", fontsize=9, color="white")
    against = "SUNDIALS: none" if not found.sundials else (
        "SUNDIALS" if found.sundials is found.best else f"SUNDIALS {amount(found.sundials_factor)}×")
    axes.text(column, line + 0.29, against, ha="center", va="center", fontsize=8, color="white")


def wrapped(label, width=16):
    """A label in two lines if it is long."""
    if len(label) <= width or " " not in label:
        return label
    cut = min((n for n, c in enumerate(label) if c == " "), key=lambda n: abs(n - len(label) / 2))
    return label[:cut] + "\n" + label[cut + 1:]


# ------------------------------------------------------------------ the tolerance's promise

def tolerance_law(tolerance):
    """The error that a tolerance promises."""
    return tolerance


@dataclass
class Promise:
    """How one method keeps the tolerance's law."""
    study: str
    series: Series
    tolerances: list  # rising
    errors: list      # geometric mean over start states, one per tolerance
    ratios: list      # achieved error over the law, every start state and tolerance

    def is_monotone(self):
        return all(a <= b for a, b in zip(self.errors, self.errors[1:]))

    def verdict(self):
        """Errors below the band keep the promise too: something else than accuracy decides the steps there."""
        if not self.is_monotone() or max(self.ratios) > PROMISE:
            return "not kept"
        return "kept" if min(self.ratios) >= 1 / PROMISE else "more accurate"


def promises(studies):
    """Of every selective method with event correction, for which the law is stated, and of trusted points only."""
    found = []
    for study in studies:
        for s in series_of(study) if "study" in study.tables else []:
            points = sorted((p for p in s.points if p.trusted), key=lambda p: p.rows[0].get("tolerance") or 0)
            if s.family != "multirate" or s.dashed or s.variant[-1] == "frozen" or not points:
                continue
            ratios = [row["error_rms"] / tolerance_law(row["tolerance"]) for p in points for row in p.rows]
            found.append(Promise(study.name, s, [p.rows[0]["tolerance"] for p in points], [p.mean("error_rms") for p in points], ratios))
    return found


def draw_tolerance(figure, studies):
    """Achieved error against tolerance, with the law and its band."""
    found = promises(studies)
    if not found:
        raise NothingToDraw("no study has a multi-rate method with events and errors that its reference can judge")
    axes = figure.subplots()
    low = min(min(p.tolerances) for p in found) / 2
    high = max(max(p.tolerances) for p in found) * 2
    law = np.array([tolerance_law(t) for t in (low, high)])
    axes.fill_between([low, high], law / PROMISE, law * PROMISE, color=GRID, lw=0, zorder=0)
    axes.plot([low, high], law, color=INK, lw=1.2, zorder=1)
    axes.text(0.98, 0.03, f"line: error = tolerance; band: within {PROMISE:g} times", transform=axes.transAxes, ha="right", fontsize=9.5,
              color=MUTED)
    names = list(dict.fromkeys(p.study for p in found))
    colours = matplotlib.colormaps["tab10"]
    for p in found:
        colour = colours(names.index(p.study) % 10)
        axes.plot(p.tolerances, p.errors, color=colour, marker=p.series.marker, ms=7.5, mec="white", lw=1.8, zorder=4,
                  label=f"{p.study}, {p.series.label}" + ("" if p.verdict() == "kept" else f"  ({p.verdict()})"))
        for point in p.series.points:
            if point.trusted and len(point.rows) > 1:
                axes.plot([point.rows[0]["tolerance"]] * 2, [min(point.values("error_rms")), max(point.values("error_rms"))],
                          color=colour, lw=1.6, alpha=0.6, zorder=3)
    ratios = [r for p in found for r in p.ratios]
    inside = sum(1 / PROMISE <= r <= PROMISE for r in ratios)
    axes.set(xscale="log", yscale="log", xlim=(low, high), xlabel="tolerance", ylabel="achieved rms position error")
    soft_grid(axes)
    axes.legend(frameon=False, fontsize=9.5, loc="upper left", bbox_to_anchor=(1.01, 1))
    axes.set_title(f"{inside} of {len(ratios)} runs within {PROMISE:g} times the tolerance; "
                   f"monotone in {sum(p.is_monotone() for p in found)} of {len(found)} series", loc="left")


# ------------------------------------------------------------------ divergence

@dataclass
class Trust:
    """How far the errors from one start state can be believed; None: not known."""
    start: str
    reference: str       # its method and step
    change: float        # of the reference when run twice as coarsely
    smallest: float      # error charted
    accepted: str        # "ok", or why not
    sundials: float      # smallest error of a method of SUNDIALS: how far two independent integrators agree
    until: float         # s


def trust(study):
    rows = study.rows("study")
    horizon = {row["start"]: row.get("trusted_until") for row in study.tables.get("horizon", [])}
    found = []
    for start in dict.fromkeys(row["start"] for row in rows):
        here = {row["name"]: row for row in rows if row["start"] == start and not is_point(row)}
        charted = [row for row in rows if row["start"] == start and is_point(row) and counts(row)]
        reference = here.get("reference", {})
        found.append(Trust(start, f"{reference.get('method', '?')}, {setting(reference)}" if reference else "none",
                           here.get("reference_check", {}).get("error_rms"),
                           min((row["error_rms"] for row in charted), default=None), reference.get("status", "no reference"),
                           min((row["error_rms"] for row in charted if family(row) == "sundials"), default=None), horizon.get(start)))
    return found


def draw_divergence(figure, study):
    """Separation of two runs a rounding error apart, the fitted rate and the trusted horizon."""
    rows, fits = study.rows("divergence"), {row["start"]: row for row in study.tables.get("horizon", [])}
    axes = figure.subplots()
    colours = matplotlib.colormaps["tab10"]
    for n, start in enumerate(dict.fromkeys(row["start"] for row in rows)):
        here = [row for row in rows if row["start"] == start and (row["separation_rms"] or 0) > 0]
        if not here:
            continue
        time, rms = np.array([(row["time"], row["separation_rms"]) for row in here]).T
        largest = [row["separation_max"] or math.nan for row in here]
        axes.plot(time, rms, color=colours(n), lw=2.2, label=horizon_label(start, fits.get(start, {})), zorder=4)
        axes.plot(time, largest, color=colours(n), lw=1, alpha=0.5, zorder=3)
        if start in fits:
            draw_fit(axes, time, rms, fits[start], colours(n))
    axes.set(yscale="log", xlabel="time  [s]", ylabel="separation  [m]")
    soft_grid(axes)
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=9.5,
                title="bold: rms, thin: largest\ndashed: fitted growth\ndotted: trusted until", title_fontsize=9, alignment="left")
    axes.set_title(f"{study.name}: how long a trajectory means something", loc="left")


def horizon_label(start, fit):
    lines = [start]
    if (fit.get("rate") or 0) > 0:
        lines.append(f"e-fold in {1e3 / fit['rate']:.3g} ms")
    if fit.get("trusted_until"):
        lines.append(f"trusted until {fit['trusted_until']:.3g} s")
    return "\n".join(lines)


def draw_fit(axes, time, separation, fit, colour):
    """The fitted exponential through the rising part, and the horizon until which trajectories are trusted."""
    if (fit.get("rate") or 0) > 0:
        rising = rising_part(separation)
        level = np.mean(np.log(separation[rising]) - fit["rate"] * time[rising])
        ends = np.clip((np.log([separation.min(), separation.max()]) - level) / fit["rate"], time[0], time[-1])
        axes.plot(ends, np.exp(level + fit["rate"] * ends), color=INK, lw=1.2, ls=(0, (5, 3)), zorder=5)
    if fit.get("trusted_until"):
        axes.axvline(fit["trusted_until"], color=colour, lw=1.3, ls=(0, (1, 2)), zorder=2)


def rising_part(separation):
    """Where the separation is well above its smallest and well below its largest value; all of it if it hardly grows."""
    inside = (separation > 3 * separation.min()) & (separation < separation.max() / 3)
    return inside if inside.sum() >= 2 else np.ones(len(separation), bool)

# ------------------------------------------------------------------ stability

NEUTRAL = 1.0             # growth per step at which a perturbation neither grows nor decays
GROWTH_RESOLUTION = 1e-8  # per step; a rate below it is rounding


def draw_stability(figure, study):
    """Growth per step over damping ratio and step, with theory's limit, ours and the measured one."""
    cells, limits = study.rows("stability_map"), study.tables.get("stability", [])
    systems = list(dict.fromkeys(row["system"] for row in cells))
    schemes = list(dict.fromkeys((row["integrator"], row["dashpot"]) for row in cells))
    panels = figure.subplots(len(systems), len(schemes), sharex=True, sharey=True, squeeze=False)
    # Beyond these a perturbation is gone, or the run lost, within some tens of steps: no need to tell more apart.
    norm = TwoSlopeNorm(NEUTRAL, 0.9, 1.1)
    image = None
    for line, system in zip(panels, systems):
        for axes, scheme in zip(line, schemes):
            here = [row for row in cells if (row["system"], row["integrator"], row["dashpot"]) == (system, *scheme)]
            if here:
                image = draw_map(axes, here, norm)
            draw_limits(axes, [r for r in limits if (r["system"], r["integrator"], r["dashpot"]) == (system, *scheme)])
            axes.set_title(f"{system}: {scheme[0]}, {scheme[1]} dashpot", loc="left", fontsize=10.5)
    for axes in panels[-1]:
        axes.set_xlabel("damping ratio")
    for axes in panels[:, 0]:
        axes.set_ylabel("step over undamped\ncritical step")
    bar = figure.colorbar(image, ax=panels, fraction=0.025, pad=0.015, extend="both")
    bar.set_label("growth per step of a small perturbation")
    bar.outline.set_visible(False)
    handles = [Line2D([], [], color=INK, lw=2.2, label="theory's limit"),
               Line2D([], [], ls="none", marker="o", mfc="white", mec=INK, label="measured limit"),
               Line2D([], [], color="#0072b2", lw=1.8, ls=(0, (4, 2)), label="our bound per ball")]
    heading(figure, "Where steps are stable: red grows, blue decays")
    figure.legend(handles=handles, loc="upper right", ncols=3, frameon=False, fontsize=10, borderpad=0.1).set_in_layout(False)


def draw_map(axes, cells, norm):
    ratios, steps = (sorted({row[key] for row in cells}) for key in ("damping_ratio", "step_ratio"))
    growth = np.full((len(steps), len(ratios)), np.nan)
    for row in cells:
        if row["growth_per_step"] is not None:
            growth[steps.index(row["step_ratio"]), ratios.index(row["damping_ratio"])] = row["growth_per_step"]
    axes.set_facecolor(GRID)  # what is not known
    axes.set(xlim=(ratios[0], ratios[-1]), ylim=(steps[0], steps[-1]))
    return axes.pcolormesh(ratios, steps, np.clip(growth, norm.vmin, norm.vmax), cmap="RdBu_r", norm=norm, shading="nearest")


def draw_limits(axes, limits):
    limits = sorted(limits, key=lambda row: row["damping_ratio"])
    for column, look in (("theory_limit", {"color": INK, "lw": 2.2}), ("bound", {"color": "#0072b2", "lw": 1.8, "ls": (0, (4, 2))}),
                         ("measured_limit", {"color": INK, "ls": "none", "marker": "o", "mfc": "white", "ms": 5.5})):
        known_here = [row for row in limits if row.get(column) is not None]
        axes.plot([row["damping_ratio"] for row in known_here], [row[column] for row in known_here], zorder=4, clip_on=False,
                  path_effects=[withStroke(linewidth=4, foreground="white")], **look)


def draw_growth(figure, study):
    """Growth rate of multi-rate stepping against its step; a line of slope 3; what does not grow stands at the bottom."""
    rows = [row for row in study.rows("growth") if row["growth_rate"] is not None]
    grows = lambda row: row["growth_rate"] * row["step"] > GROWTH_RESOLUTION
    growing = [row["growth_rate"] for row in rows if grows(row)]
    if not rows:
        raise NothingToDraw("no growth rate is known")
    axes = figure.subplots()
    top, bottom = (max(growing), min(growing) / 4) if growing else (1.0, 0.1)
    groups = {}
    for row in rows:
        groups.setdefault((row["system"], row["ratio"], row["damping_ratio"]), []).append(row)
    colours, ratios = matplotlib.colormaps["viridis"], sorted({row["ratio"] for row in rows})
    dampings = sorted({row["damping_ratio"] for row in rows})
    for (system, ratio, damping), group in groups.items():
        group.sort(key=lambda row: row["step"])
        colour = colours(0.05 + 0.8 * ratios.index(ratio) / max(1, len(ratios) - 1))
        up, still = ([r for r in group if grows(r) is wanted] for wanted in (True, False))
        exponent = f", h^{group[0]['exponent']:.2f}" if group[0].get("exponent") else ""
        axes.plot([r["step"] for r in up], [r["growth_rate"] for r in up], color=colour, lw=1.8, mec="white", ms=7.5,
                  marker="os^D"[dampings.index(damping) % 4], zorder=4,
                  label=f"{system}, ratio {ratio:g}, damping {damping:g}" + (exponent if up else ": does not grow"))
        axes.plot([r["step"] for r in still], [bottom] * len(still), ls="none", marker="v", mfc="none", mec=colour, ms=8, zorder=4)
    axes.set(xscale="log", yscale="log", xlabel="coarsest step  [s]", ylabel="growth rate  [1/s]", ylim=(bottom / 1.5, top * 2))
    if growing:
        draw_cube(axes, max(rows, key=lambda row: row["growth_rate"]), min(row["step"] for row in rows))
    soft_grid(axes)
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=9.5, title="open triangles below: no growth",
                title_fontsize=9, alignment="left")
    axes.set_title("Weak growth of multi-rate stepping", loc="left")


def draw_cube(axes, anchor, first_step):
    """The law that growth is proportional to h^3, through the fastest growth."""
    steps = np.array([first_step, anchor["step"]])
    axes.plot(steps, 1.5 * anchor["growth_rate"] * (steps / anchor["step"]) ** 3, color=MUTED, lw=1.2, ls=(0, (5, 3)), zorder=2)
    axes.annotate("h³", (anchor["step"], 1.5 * anchor["growth_rate"]), xytext=(-4, 4), textcoords="offset points", color=MUTED, ha="right")


# ------------------------------------------------------------------ statistics of long runs

def method_colours(methods):
    return {method: matplotlib.colormaps["tab10"](n % 10) for n, method in enumerate(methods)}


def draw_statistics(figure, study):
    """Means over seeds with their 95 % intervals: one panel per plain measure, profiles over height beside them."""
    summary, runs = study.rows("statistics_summary"), study.tables.get("statistics", [])
    methods = list(dict.fromkeys(row["method"] for row in summary))
    colours = method_colours(methods)
    unit = {row["measure"]: row.get("unit") or "" for row in runs}
    profiles = list(dict.fromkeys(row["measure"] for row in summary if is_profile(row)))
    plain = plain_measures(summary, runs)
    left, right = figure.subfigures(1, 2, width_ratios=(1.25, max(1, len(profiles)))) if profiles else (figure, None)
    if plain:
        for axes, measure in zip(left.subplots(len(plain), 1, squeeze=False)[:, 0], plain):
            draw_measure(axes, measure, unit, [r for r in summary if r["measure"] == measure],
                         [r for r in runs if r["measure"] == measure], methods, colours)
    for axes, measure in zip(right.subplots(1, len(profiles), squeeze=False)[0] if right else (), profiles):
        draw_profile(axes, measure, unit, [r for r in summary if r["measure"] == measure], colours)
    heading(figure, f"{study.name}: statistics of long runs, mean and 95 % interval over {len({r['start'] for r in runs})} start states")
    figure.supxlabel("\n".join(filter(None, (cost_words(summary), same_words(summary, runs, plain)))), fontsize=10, color=MUTED)


def plain_measures(summary, runs):
    """Measures that have no profile, and whose values differ anywhere."""
    values = {}
    for row in runs:
        if row["value"] is not None:
            values.setdefault(row["measure"], set()).add(row["value"])
    return [m for m in dict.fromkeys(row["measure"] for row in summary if not is_profile(row)) if len(values.get(m, ())) > 1]


def same_words(summary, runs, drawn):
    """What is not drawn because all runs have the same of it."""
    said = []
    for measure in dict.fromkeys(row["measure"] for row in summary if not is_profile(row) and row["measure"] not in drawn):
        values = {row["value"] for row in runs if row["measure"] == measure and row["value"] is not None}
        said.append(f"{measure.replace('_', ' ')}: " + (f"{amount(values.pop())} in all runs" if values else "none"))
    return ";  ".join(said)


def cost_words(summary):
    """What each method costs against the baseline, which is the one that is compared with nothing."""
    costs = {row["method"]: row for row in summary}
    compared = {row["method"] for row in summary if row.get("agrees") is not None}
    baseline = next((row for method, row in costs.items() if method not in compared), None)
    if not baseline or not compared:
        return ""
    said = []
    for method in (m for m in costs if m in compared):
        work, time = (baseline[c] / costs[method][c] if baseline.get(c) and costs[method].get(c) else None
                      for c in ("contact_evaluations", "wall_s"))
        if work and time:
            said.append(f"{method}: {gain_words([work])} work, {gain_words([time])} time")
    return f"Against {baseline['method']}:  " + ";  ".join(said) if said else ""


def is_profile(row):
    return row.get("z_low") is not None


def in_words(measure, unit):
    text = measure.replace("_", " ")
    return f"{text}  [{unit[measure].replace('s-1', '1/s')}]" if unit.get(measure) else text


def draw_measure(axes, measure, unit, summary, runs, methods, colours):
    """A line per method: each start state's value, their mean and its interval, and whether it agrees with the baseline."""
    for row in summary:
        y = methods.index(row["method"])
        values = [r["value"] for r in runs if r["method"] == row["method"] and r["value"] is not None]
        axes.plot(values, [y + 0.22] * len(values), ls="none", marker="|", ms=7, color=colours[row["method"]], alpha=0.7)
        if row["mean"] is None:
            continue
        if None not in (row["ci_low"], row["ci_high"]):
            axes.plot([row["ci_low"], row["ci_high"]], [y, y], color=colours[row["method"]], lw=3, solid_capstyle="round", alpha=0.45)
        axes.plot([row["mean"]], [y], marker="o", ms=8, color=colours[row["method"]], mec="white")
        said = {0.0: "differs", 1.0: "agrees"}.get(row.get("agrees"), "")
        axes.annotate(said, (1, y), xycoords=("axes fraction", "data"), xytext=(4, 0), textcoords="offset points", fontsize=9,
                      va="center", color="#b42318" if said == "differs" else MUTED)
    axes.set(ylim=(len(methods) - 0.5, -0.5), xlabel=in_words(measure, unit))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.6g}")
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.set_yticks(range(len(methods)), methods)
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    axes.margins(x=0.08)
    axes.grid(True, axis="x", color=GRID, lw=0.8)
    axes.set_axisbelow(True)


def draw_profile(axes, measure, unit, summary, colours):
    """Mean over height with its interval as a band; circles where a layer does not agree with the baseline's."""
    for method in dict.fromkeys(row["method"] for row in summary):
        here = sorted((r for r in summary if r["method"] == method and r["mean"] is not None), key=lambda r: r["z_low"])
        height = [(r["z_low"] + r["z_high"]) / 2 for r in here]
        axes.plot([r["mean"] for r in here], height, color=colours[method], lw=1.8, label=method)
        banded = [(z, r) for z, r in zip(height, here) if None not in (r["ci_low"], r["ci_high"])]
        axes.fill_betweenx([z for z, _ in banded], [r["ci_low"] for _, r in banded], [r["ci_high"] for _, r in banded],
                           color=colours[method], alpha=0.18, lw=0)
        differing = [(z, r) for z, r in zip(height, here) if r.get("agrees") == 0]
        axes.plot([r["mean"] for _, r in differing], [z for z, _ in differing], ls="none", marker="o", ms=9, mfc="none", mec="#b42318",
                  mew=1.6, zorder=5)
    axes.set(xlabel=in_words(measure, unit), ylabel="height z  [m]")
    soft_grid(axes)
    axes.legend(frameon=False, fontsize=9.5, title="circles: differs from the baseline", title_fontsize=9, alignment="left")


# ------------------------------------------------------------------ pictures of the flow

class Frame:
    """Balls of one moment; `kind` is 0 for content, above for fixed balls; `level` may be None."""

    def __init__(self, position, velocity, radius, kind, level=None, time=None):
        self.position, self.velocity, self.radius, self.kind, self.level, self.time = (
            position, velocity, radius, kind, level, time)

    def keep(self, mask):
        level = None if self.level is None else self.level[mask]
        return Frame(self.position[mask], self.velocity[mask], self.radius[mask], self.kind[mask], level, self.time)


@dataclass
class Flow:
    """The last frame of a run, with the contact constants of its last phase (None if the run does not tell)."""
    frame: Frame
    contact: dict


def read_flow(path):
    """Last frame of a run.h5 (H5MD); balls that have left are dropped, and so is the plug while the outlet is open.
    Raises NothingToDraw when all have left."""
    with h5py.File(path, "r") as file:
        scene = tomllib.loads(read_provenance(file).get("scene", ""))
        phase = (scene.get("phase") or [{}])[-1]
        contact = {**scene.get("contact", {}), **phase.get("contact", {})}
        content, fixed = file["particles/content"], file["particles/wall"]
        position = content["position/value"][-1]
        here = np.isfinite(position[:, 0])
        if not here.any():
            raise NothingToDraw("all balls have left in the run's last frame")
        kind = fixed["kind"][:]
        stays = (kind == 1) | (phase.get("outlet") != "open")
        walls = stays.sum()
        frame = Frame(np.concatenate([position[here], fixed["position"][:][stays]]),
                      np.concatenate([content["velocity/value"][-1][here], np.zeros((walls, 3))]),
                      np.concatenate([content["radius"][:][here], fixed["radius"][:][stays]]),
                      np.concatenate([np.zeros(here.sum(), int), kind[stays]]),
                      np.concatenate([content["level/value"][-1][here].astype(int), np.full(walls, -1)]),
                      float(content["position/time"][-1]))
    return Flow(frame, contact if "k_ball" in contact else None)


def silo_axes(figure, frame, title):
    low = frame.position.min(axis=0) - frame.radius.max()
    high = frame.position.max(axis=0) + frame.radius.max()
    axes = figure.subplots()
    axes.set(xlim=(low[0], high[0]), ylim=(low[2], high[2]), aspect="equal", xlabel="x  [m]", ylabel="z  [m]")
    axes.set_title(title, loc="left")
    return axes


def discs(axes, frame, **looks):
    """The circles in which the plane y = 0 cuts the balls."""
    cut = np.sqrt(frame.radius**2 - frame.position[:, 1] ** 2)
    collection = EllipseCollection(2 * cut, 2 * cut, np.zeros(len(cut)), units="xy", offsets=frame.position[:, [0, 2]],
                                   offset_transform=axes.transData, **looks)
    axes.add_collection(collection)
    return collection


def cut_by_plane(frame):
    return frame.keep(np.abs(frame.position[:, 1]) < frame.radius)


def at_time(frame):
    return "" if frame.time is None else f", t = {frame.time:.3f} s"


def colour_bar(figure, axes, source, label, **more):
    bar = figure.colorbar(source, ax=axes, fraction=0.045, pad=0.03, **more)
    bar.set_label(label)
    bar.outline.set_visible(False)
    return bar


def draw_section(figure, flow):
    frame = flow.frame
    section = cut_by_plane(frame)
    content, fixed = section.keep(section.kind == 0), section.keep(section.kind > 0)
    axes = silo_axes(figure, frame, "Speed in the section y = 0" + at_time(frame))
    discs(axes, fixed, facecolors=WALL, edgecolors="#9aa2ad", linewidths=0.4)
    top = max(float(np.quantile(np.linalg.norm(frame.velocity[frame.kind == 0], axis=1), 0.999)), 1e-6)
    balls = discs(axes, content, cmap="viridis", norm=LogNorm(top / 1e3, top), edgecolors="white", linewidths=0.25)
    balls.set_array(np.maximum(np.linalg.norm(content.velocity, axis=1), 1e-12))
    colour_bar(figure, axes, balls, "speed  [m/s]", extend="both")


def draw_levels(figure, flow):
    frame = flow.frame
    every = frame.level[frame.kind == 0].astype(int)
    count = int(every.max(initial=0)) + 1
    if count == 1:
        raise NothingToDraw("the run has one level only")
    section = cut_by_plane(frame)
    content, fixed = section.keep(section.kind == 0), section.keep(section.kind > 0)
    colours = ListedColormap(matplotlib.colormaps["plasma_r"](np.linspace(0.08, 0.95, count))[::-1])
    axes = silo_axes(figure, frame, "Levels in the section y = 0" + at_time(frame))
    discs(axes, fixed, facecolors=WALL, edgecolors="#9aa2ad", linewidths=0.4)
    balls = discs(axes, content, cmap=colours, norm=BoundaryNorm(np.arange(count + 1) - 0.5, count), edgecolors="white",
                  linewidths=0.25)
    balls.set_array(content.level)
    bar = colour_bar(figure, axes, balls, "level (0 is the finest step) and share of all balls", ticks=range(count))
    share = np.bincount(every, minlength=count) / len(every)
    bar.ax.set_yticklabels([f"{n}   {100 * s:.2g} %" for n, s in enumerate(share)])


def pairs_within(position, radius):
    """Index pairs (i < j) of overlapping balls, by sorting the balls into cubes of the largest diameter."""
    size = 2 * radius.max()
    cell = np.floor((position - position.min(axis=0)) / size).astype(np.int64) + 1
    shape = cell.max(axis=0) + 2
    key = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    found = []
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            for dz in (-1, 0, 1):
                wanted = key + (dx * shape[1] + dy) * shape[2] + dz
                first, last = np.searchsorted(ordered, wanted, "left"), np.searchsorted(ordered, wanted, "right")
                number = last - first
                i = np.repeat(np.arange(len(key)), number)
                within = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
                j = order[np.repeat(first, number) + within]
                near = i < j
                i, j = i[near], j[near]
                gap = np.linalg.norm(position[i] - position[j], axis=1) - radius[i] - radius[j]
                found.append(np.column_stack([i, j])[gap < 0])
    return np.concatenate(found)


def contact_forces(frame, contact):
    """Pairs with at least one content ball and their normal force k d + c d' (clamped at 0 without tension) [N]."""
    i, j = pairs_within(frame.position, frame.radius).T
    moving = (frame.kind[i] == 0) | (frame.kind[j] == 0)
    i, j = i[moving], j[moving]
    line = frame.position[i] - frame.position[j]
    distance = np.linalg.norm(line, axis=1)
    overlap = frame.radius[i] + frame.radius[j] - distance
    rate = -np.einsum("ij,ij->i", frame.velocity[i] - frame.velocity[j], line) / distance
    wall = (frame.kind[i] > 0) | (frame.kind[j] > 0)
    force = (np.where(wall, contact["k_wall"], contact["k_ball"]) * overlap
             + np.where(wall, contact["c_wall"], contact["c_ball"]) * rate)
    return i, j, force if contact.get("tension") else np.maximum(force, 0.0)


def draw_forces(figure, flow):
    frame = flow.frame
    if flow.contact is None:
        raise NothingToDraw("the run does not tell its contact constants")
    slab = 1.5 * 2 * frame.radius[frame.kind == 0].mean()
    part = frame.keep(np.abs(frame.position[:, 1]) < slab)
    i, j, force = contact_forces(part, flow.contact)
    order = np.argsort(force)
    order = order[force[order] > 0]
    if not len(order):
        raise NothingToDraw("no ball presses on another")
    i, j, force = i[order], j[order], force[order]
    axes = silo_axes(figure, frame, f"Contact forces within {slab:.2f} m of y = 0" + at_time(frame))
    discs(axes, cut_by_plane(part.keep(part.kind > 0)), facecolors=WALL, edgecolors="none")
    top = float(np.quantile(force, 0.999))
    thickness = 0.15 + 3.2 * np.clip(force / top, 0, 1) ** 0.6
    ends = np.stack([part.position[i][:, [0, 2]], part.position[j][:, [0, 2]]], axis=1)
    lines = LineCollection(ends, array=force, cmap="inferno_r", norm=LogNorm(top / 1e3, top), linewidths=thickness,
                           capstyle="round")
    axes.add_collection(lines)
    colour_bar(figure, axes, lines, "normal force  [N]", extend="both")


# ------------------------------------------------------------------ all charts

@dataclass(frozen=True)
class Chart:
    """A file's name, the table that it needs ("": none of a study), what fills it, and its size [inch] from the data."""
    name: str
    table: str
    draw: object
    size: object


def fixed(width, height):
    return lambda data: (width, height)


def stability_size(study):
    rows = study.rows("stability_map")
    across, down = len({(r["integrator"], r["dashpot"]) for r in rows}), len({r["system"] for r in rows})
    return max(11, 1.6 + 3.7 * across), 1.4 + 2.7 * down


def statistics_size(study):
    rows = study.rows("statistics_summary")
    profiles = len({r["measure"] for r in rows if is_profile(r)})
    plain = len(plain_measures(rows, study.tables.get("statistics", [])))
    return 7 + 5.5 * profiles, max(5.5, 1.2 + plain * (0.8 + 0.28 * len({r["method"] for r in rows})))


STUDY_CHARTS = (  # of one study
    Chart("accuracy", "study", draw_accuracy, fixed(15, 7.6)),
    Chart("gains", "study", draw_gains, fixed(15, 8.4)),
    Chart("methods", "study", draw_methods, lambda study: (14, 1.9 + 0.42 * len(series_of(study)))),
    Chart("tolerance", "study", lambda figure, study: draw_tolerance(figure, [study]), fixed(10.5, 6)),
    Chart("divergence", "divergence", draw_divergence, fixed(11, 5.6)),
    Chart("stability", "stability_map", draw_stability, stability_size),
    Chart("growth", "growth", draw_growth, fixed(11, 5.6)),
    Chart("statistics", "statistics_summary", draw_statistics, statistics_size),
)
OVERVIEW = Chart("overview", "", draw_overview, lambda studies: (15, 1.9 + 0.85 * len(studies)))  # of several studies
TOLERANCE = Chart("tolerance", "", draw_tolerance, fixed(11.5, 6.2))
FLOW_CHARTS = tuple(  # of a run
    Chart(name, "", draw, fixed(5.4, 9.8)) for name, draw in (("section", draw_section), ("forces", draw_forces), ("levels", draw_levels)))


def figure_of(chart, data):
    """The chart as a figure. Throws NothingToDraw."""
    figure = Figure(figsize=chart.size(data), layout=None if chart.draw in (draw_accuracy, draw_gains) else "constrained")
    chart.draw(figure, data)
    return figure


def save(figure, path):
    """Writes the picture aside and renames it, so that none is ever left half-written."""
    aside = path.with_name(path.name + ".part")
    figure.savefig(aside, dpi=150, format="png")
    os.replace(aside, path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("study", type=Path, help="directory with study.h5")
    parser.add_argument("--out", type=Path, help="directory for the charts; default: that of the study")
    given = parser.parse_args()
    out = given.out or given.study
    try:
        study = read_study(given.study)
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        sys.exit(f"charts.py: {given.study}: {error}; give the --out directory of `grainclock study`")
    for chart in STUDY_CHARTS:
        path = out / f"{chart.name}.png"
        path.unlink(missing_ok=True)  # of an earlier study
        try:
            save(figure_of(chart, study), path)
            print(f"written: {path}")
        except NothingToDraw as reason:
            print(f"no {chart.name} chart: {reason}")


if __name__ == "__main__":
    main()
