#!/usr/bin/python3
"""Charts, pictures and an HTML report of a study.

    report.py STUDY_DIR --out DIR [--run RUN.h5 | --state STATE.csv]

Reads STUDY_DIR/study.csv and study.h5 and, for the pictures of the silo, the last frame of RUN.h5 (or a state
as CSV). Writes chart.png, chart.svg, section.png, forces.png, levels.png and report.html into DIR.
"""

import argparse
import base64
import csv
import html
import math
import os
import sys
import tomllib
from pathlib import Path

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm
from matplotlib.patheffects import withStroke

INK, MUTED, GRID, WALL = "#1b1f24", "#6a737d", "#e3e6ea", "#c9ced6"
# Okabe-Ito, which stays apart for colour-blind readers; methods take them in order of appearance.
PALETTE = {
    "plain": "#5f6770",
    "events": "#0072b2",
    "multirate": ["#d55e00", "#cc79a7", "#009e73", "#e69f00", "#56b4e9"],
    "sundials": ["#8c564b", "#b8a11b"],
}
MARKERS = {"plain": "s", "events": "D", "multirate": ["o", "^", "v", "P", "X"], "sundials": ["<", ">"]}
TARGET_ERROR = 1e-4
PICTURES = ("chart.png", "chart.svg", "section.png", "forces.png", "levels.png")
HALO = [withStroke(linewidth=2.5, foreground="white")]

plt.rcParams.update({
    "font.family": "DejaVu Sans", "font.size": 11, "axes.edgecolor": MUTED, "axes.labelcolor": INK,
    "axes.titleweight": "bold", "axes.titlesize": 12, "text.color": INK, "xtick.color": MUTED, "ytick.color": MUTED,
    "axes.spines.top": False, "axes.spines.right": False, "svg.fonttype": "none", "savefig.facecolor": "white",
})


def save(figure, path, close=False, **more):
    """Writes the picture aside and renames it, so that none is ever left half-written."""
    aside = path.with_name(path.name + ".part")
    figure.savefig(aside, dpi=150, format=path.suffix[1:], **more)
    os.replace(aside, path)
    if close:
        plt.close(figure)


# ------------------------------------------------------------------ the study

def read_rows(path):
    """Rows of study.csv: numbers as floats (None if empty), texts as they are."""
    texts = {"name", "method", "method_used", "integrator", "events", "dashpot", "interface", "start", "status"}
    with open(path, newline="", encoding="utf-8") as file:
        return [{key: value if key in texts else (float(value) if value else None) for key, value in row.items()}
                for row in csv.DictReader(file)]


def charted(rows):
    return [r for r in rows if r["status"] == "ok" and not r["name"].startswith("reference") and r["error_rms"]]


def family(row):
    if row["method"] in ("cvode", "arkode"):
        return "sundials"
    if row["method"] == "multirate":
        return "multirate"
    plain_scheme = row["integrator"] == "predicted" and row["dashpot"] == "explicit"
    return {"false": "plain", "true": "events"}[row["events"]] if plain_scheme else "multirate"


def knob(row):
    """What was turned at this point, as a short label."""
    if row["rtol"]:
        return f"rtol {short(row['rtol'])}"
    if row["method"] == "multirate":
        return f"tol {short(row['tolerance'])}"
    return f"{row['step'] * 1e6:.4g} µs"


def short(number):
    """1e-4, 2.5e-5: a small number without padding."""
    mantissa, exponent = f"{number:.1e}".split("e")
    return f"{mantissa.removesuffix('.0')}e{int(exponent)}"


def geometric_mean(values):
    return math.exp(sum(map(math.log, values)) / len(values))


def series_of(rows):
    """{name: points}, points averaged (geometrically) over the start states and sorted by cost."""
    grouped = {}
    for row in charted(rows):
        # A step is rounded to a fraction of the horizon, alike for all starts of one study.
        key = (row["step"] if row["method"] != "multirate" else row["tolerance"], row["levels"], row["rtol"],
               row["step"] if row["method"] == "multirate" and len({r["start"] for r in rows}) == 1 else None)
        grouped.setdefault(row["name"], {}).setdefault(key, []).append(row)
    series = {}
    for name, points in grouped.items():
        series[name] = sorted(
            ({"label": knob(p[0]), "family": family(p[0]), **{
                quantity: geometric_mean([r[quantity] for r in p])
                for quantity in ("error_rms", "contact_evaluations", "sweeps", "wall_s")}} for p in points.values()),
            key=lambda p: p["contact_evaluations"])
    return series


def styles(series):
    used, result = {}, {}
    for name, points in series.items():
        kind = points[0]["family"]
        colour, marker = PALETTE[kind], MARKERS[kind]
        if isinstance(colour, list):
            n = used.setdefault(kind, 0)
            used[kind] += 1
            colour, marker = colour[n % len(colour)], marker[n % len(marker)]
        result[name] = {"color": colour, "marker": marker}
    return result


def cost_at(error, points, quantity):
    """(cost, known): as grainclock::benchmarks::cost_at; where the error is out of reach, the dearest point and False."""
    front = []
    for p in sorted(points, key=lambda p: p[quantity]):
        if not front or p["error_rms"] < front[-1]["error_rms"]:
            front.append(p)
    if error >= front[0]["error_rms"]:
        return front[0][quantity], True
    for a, b in zip(front, front[1:]):
        if b["error_rms"] <= error:
            share = math.log(a["error_rms"] / error) / math.log(a["error_rms"] / b["error_rms"])
            return a[quantity] * (b[quantity] / a[quantity]) ** share, True
    return front[-1][quantity], False


def headline(series, quantity, error=TARGET_ERROR):
    """The best selective method, the two baselines and their costs at the target error (loosened until one reaches it)."""
    selective = {n: p for n, p in series.items() if p[0]["family"] == "multirate"}
    if not selective:
        return None
    error = max(error, min(q["error_rms"] for p in selective.values() for q in p))
    costs = {n: cost_at(error, p, quantity) for n, p in series.items()}
    reached = {n: costs[n][0] for n in selective if costs[n][1]}
    best = min(reached, key=reached.get)
    known = {n: cost for n, (cost, is_known) in costs.items() if is_known}
    result = {"error": error, "name": best, "cost": reached[best], "winner": min(known, key=known.get), "baselines": {}}
    for kind in ("plain", "events"):
        names = [n for n, p in series.items() if p[0]["family"] == kind]
        if names:
            name = min(names, key=lambda n: (not costs[n][1], costs[n][0]))
            cost, known = costs[name]
            result["baselines"][kind] = {"name": name, "cost": cost, "known": known, "gain": cost / reached[best]}
    return result


def gain_text(baseline):
    """The gain as "12×", or "> 12×" where the baseline never got so accurate; with less_or_more() it reads as it is."""
    gain = baseline["gain"]
    return ("" if baseline["known"] else "> ") + f"{max(gain, 1 / gain):.3g}×"


def less_or_more(baseline, less="less"):
    return less if baseline["gain"] >= 1 else "more"


def gain_over_starts(rows, quantity, kind):
    """(gain, spread): geometric mean over the start states, each with its own best methods, and its range in words."""
    found = [headline(series_of([r for r in rows if r["start"] == start]), quantity)
             for start in sorted({r["start"] for r in charted(rows)})]
    baselines = [f["baselines"][kind] for f in found if f and kind in f["baselines"]]
    gains = [b["gain"] for b in baselines]
    mean = {"gain": geometric_mean(gains), "known": all(b["known"] for b in baselines)}
    spread = (f" (geometric mean over {len(gains)} start states, {min(gains):.3g} to {max(gains):.3g})"
              if len(gains) > 1 else "")
    return mean, spread


# Where a point's label goes, by series, so that neighbouring lines do not write over each other.
LABEL_PLACES = {"plain": (1, 1), "events": (-1, -1), "multirate": [(-1, -1), (1, 1)], "sundials": (1, 1)}


def label_place(family_name, nth):
    place = LABEL_PLACES[family_name]
    return place[nth % len(place)] if isinstance(place, list) else place


def draw_panel(axes, series, looks, quantity, label):
    seen = {}
    for name, points in series.items():
        kind = points[0]["family"]
        strong = kind == "multirate"
        right, up = label_place(kind, seen.setdefault(kind, 0))
        seen[kind] += 1
        colour = looks[name]["color"]
        axes.plot([p[quantity] for p in points], [p["error_rms"] for p in points], lw=2.6 if strong else 1.6,
                  ms=8.5 if strong else 6, mec="white", mew=0.8, zorder=4 if strong else 3, label=name, **looks[name])
        for p in points:
            axes.annotate(p["label"], (p[quantity], p["error_rms"]), xytext=(6 * right, 4 * up), textcoords="offset points",
                          fontsize=7.5, color=colour, ha="left" if right > 0 else "right", va="bottom" if up > 0 else "top",
                          zorder=5, path_effects=HALO)
        last = min(points, key=lambda p: p["error_rms"])
        axes.annotate(name, (last[quantity], last["error_rms"]), xytext=(0, -16), textcoords="offset points", fontsize=9,
                      fontweight="bold" if strong else "normal", color=colour, ha="center", va="top", zorder=5,
                      path_effects=HALO)
    axes.set(xscale="log", yscale="log", xlabel=label)
    axes.grid(True, which="major", color=GRID, lw=0.8)
    axes.set_axisbelow(True)
    axes.margins(x=0.2, y=0.1)


def draw_gain(axes, found, told):
    """The target error as a line; from where two methods cross it, down to an arrow; `told`: the gain and its range."""
    axes.axhline(found["error"], color=INK, lw=1, ls=(0, (4, 3)), zorder=2)
    axes.annotate(f"error {short(found['error'])}", (0, found["error"]), xycoords=("axes fraction", "data"), xytext=(4, 3),
                  textcoords="offset points", ha="left", fontsize=8.5)
    plain = found["baselines"].get("plain")
    if not plain:
        return
    bottom = axes.get_ylim()[0]
    height = bottom * (axes.get_ylim()[1] / bottom) ** 0.07
    for cost in (found["cost"], plain["cost"]):
        axes.plot([cost, cost], [bottom, found["error"]], color=INK, lw=1, ls=(0, (1, 2)), zorder=2)
    axes.annotate("", xy=(found["cost"], height), xytext=(plain["cost"], height),
                  arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 2, "shrinkA": 0, "shrinkB": 0}, zorder=6)
    gain, spread = told
    axes.annotate(f"{gain_text(gain)} {less_or_more(gain)}", (math.sqrt(found["cost"] * plain["cost"]), height), xytext=(0, 4),
                  textcoords="offset points", ha="center", va="bottom", fontsize=14, fontweight="bold", zorder=7)
    axes.annotate(spread.strip(" ()"), (math.sqrt(found["cost"] * plain["cost"]), height), xytext=(0, -4),
                  textcoords="offset points", ha="center", va="top", fontsize=7.5, color=MUTED, zorder=7)


def draw_chart(rows, out):
    series = series_of(rows)
    looks = styles(series)
    figure, panels = plt.subplots(1, 2, figsize=(13.5, 7.4), sharey=True)
    quantities = [("sweeps", "contact evaluations  [sweeps over all listed pairs]"), ("wall_s", "wall time  [s]")]
    for axes, (quantity, label) in zip(panels, quantities):
        draw_panel(axes, series, looks, quantity, label)
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(low / (high / low) ** 0.2, high)  # room for the gain's arrow, in both panels
    for axes, (quantity, _) in zip(panels, quantities):
        found = headline(series, quantity)
        if found:
            draw_gain(axes, found, gain_over_starts(rows, quantity, "plain"))
        axes.annotate("better", xy=(0.9, 0.88), xytext=(0.965, 0.97), xycoords="axes fraction", fontsize=10, color=MUTED,
                      arrowprops={"arrowstyle": "-|>", "color": MUTED}, ha="center", va="center")
    panels[0].set_ylabel("rms position error  [relative to rms displacement]")
    panels[0].set_title("Work", loc="left")
    panels[1].set_title("Time", loc="left")
    handles, labels = panels[0].get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda i: min(p["sweeps"] for p in series[labels[i]]))
    figure.legend([handles[i] for i in order], [labels[i] for i in order], loc="lower center",
                  ncols=min(6, len(labels)), frameon=False, fontsize=10.5)
    found = headline(series, "sweeps")
    title = "Error against cost"
    if found and found["winner"] != found["name"]:
        title = f"{found['winner']} is the cheapest way to error {short(found['error'])}: selective stepping does not pay here"
    elif found and "plain" in found["baselines"]:
        title = (f"{found['name']}: error {short(found['error'])} with {gain_text(gain_over_starts(rows, 'sweeps', 'plain')[0])} fewer "
                 f"contact evaluations than plain uniform stepping")
    figure.suptitle(title, x=0.065, y=0.97, ha="left", fontsize=14.5, fontweight="bold")
    figure.subplots_adjust(left=0.065, right=0.985, top=0.87, bottom=0.15 if len(labels) <= 6 else 0.18, wspace=0.06)
    save(figure, out / "chart.svg")
    save(figure, out / "chart.png", close=True)


# ------------------------------------------------------------------ the silo

class Frame:
    """Balls of one moment; `kind` is 0 for content, above for fixed balls; `level` may be None."""

    def __init__(self, position, velocity, radius, kind, level=None, time=None):
        self.position, self.velocity, self.radius, self.kind, self.level, self.time = (
            position, velocity, radius, kind, level, time)

    def keep(self, mask):
        level = None if self.level is None else self.level[mask]
        return Frame(self.position[mask], self.velocity[mask], self.radius[mask], self.kind[mask], level, self.time)


def read_csv_state(path, outlet_open):
    table = np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding="utf-8")
    kind = np.select([table["kind"] == "content", table["kind"] == "wall"], [0, 1], 2)
    columns = lambda names: np.column_stack([table[n] for n in names]).astype(float)
    frame = Frame(columns(["x", "y", "z"]), columns(["vx", "vy", "vz"]), table["radius"].astype(float), kind)
    return frame.keep((kind < 2) | (not outlet_open))


def read_last_frame(path, outlet_open):
    """Last frame of a run.h5 (H5MD); balls that have left are dropped, and so is the plug while the outlet is open."""
    with h5py.File(path, "r") as file:
        content, fixed = file["particles/content"], file["particles/wall"]
        position = content["position/value"][-1]
        here = np.isfinite(position[:, 0])
        kind = fixed["kind"][:]
        stays = (kind == 1) | (not outlet_open)
        walls = stays.sum()
        return Frame(np.concatenate([position[here], fixed["position"][:][stays]]),
                     np.concatenate([content["velocity/value"][-1][here], np.zeros((walls, 3))]),
                     np.concatenate([content["radius"][:][here], fixed["radius"][:][stays]]),
                     np.concatenate([np.zeros(here.sum(), int), kind[stays]]),
                     np.concatenate([content["level/value"][-1][here].astype(int), np.full(walls, -1)]),
                     float(content["position/time"][-1]))


def silo_axes(frame, title, width=7.4):
    low = frame.position.min(axis=0) - frame.radius.max()
    high = frame.position.max(axis=0) + frame.radius.max()
    height = width * 0.78 * (high[2] - low[2]) / (high[0] - low[0])
    figure, axes = plt.subplots(figsize=(width, min(height + 1.2, 14)))
    axes.set(xlim=(low[0], high[0]), ylim=(low[2], high[2]), aspect="equal", xlabel="x  [m]", ylabel="z  [m]")
    axes.set_title(title, loc="left")
    return figure, axes


def discs(axes, frame, **looks):
    """The circles in which the plane y = 0 cuts the balls."""
    cut = np.sqrt(frame.radius**2 - frame.position[:, 1] ** 2)
    collection = EllipseCollection(2 * cut, 2 * cut, np.zeros(len(cut)), units="xy", offsets=frame.position[:, [0, 2]],
                                   transOffset=axes.transData, **looks)
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


def draw_section(frame, out):
    section = cut_by_plane(frame)
    content, fixed = section.keep(section.kind == 0), section.keep(section.kind > 0)
    figure, axes = silo_axes(frame, "Speed in the vertical section y = 0" + at_time(frame))
    discs(axes, fixed, facecolors=WALL, edgecolors="#9aa2ad", linewidths=0.4)
    speed = np.maximum(np.linalg.norm(content.velocity, axis=1), 1e-12)
    top = max(float(np.quantile(np.linalg.norm(frame.velocity[frame.kind == 0], axis=1), 0.999)), 1e-6)
    balls = discs(axes, content, cmap="viridis", norm=LogNorm(top / 1e3, top), edgecolors="white", linewidths=0.25)
    balls.set_array(speed)
    colour_bar(figure, axes, balls, "speed  [m/s]", extend="both")
    save(figure, out / "section.png", close=True, bbox_inches="tight")


def draw_levels(frame, out):
    section = cut_by_plane(frame)
    content, fixed = section.keep(section.kind == 0), section.keep(section.kind > 0)
    every = frame.level[frame.kind == 0].astype(int)
    count = int(every.max()) + 1
    colours = ListedColormap(plt.get_cmap("plasma_r")(np.linspace(0.08, 0.95, count))[::-1])
    figure, axes = silo_axes(frame, "Levels in the vertical section y = 0" + at_time(frame))
    discs(axes, fixed, facecolors=WALL, edgecolors="#9aa2ad", linewidths=0.4)
    balls = discs(axes, content, cmap=colours, norm=BoundaryNorm(np.arange(count + 1) - 0.5, count), edgecolors="white",
                  linewidths=0.25)
    balls.set_array(content.level)
    bar = colour_bar(figure, axes, balls, "level (0 is the finest step) and share of all balls", ticks=range(count))
    share = np.bincount(every, minlength=count) / len(every)
    bar.ax.set_yticklabels([f"{n}   {100 * s:.2g} %" for n, s in enumerate(share)])
    save(figure, out / "levels.png", close=True, bbox_inches="tight")


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


def draw_forces(frame, contact, out):
    slab = 1.5 * 2 * frame.radius[frame.kind == 0].mean()
    part = frame.keep(np.abs(frame.position[:, 1]) < slab)
    i, j, force = contact_forces(part, contact)
    i, j, force = i[force > 0], j[force > 0], force[force > 0]
    if not len(force):
        return
    order = np.argsort(force)
    i, j, force = i[order], j[order], force[order]
    figure, axes = silo_axes(frame, f"Contact forces within {slab:.2f} m of y = 0" + at_time(frame))
    discs(axes, cut_by_plane(part.keep(part.kind > 0)), facecolors=WALL, edgecolors="none")
    top = float(np.quantile(force, 0.999))
    norm = LogNorm(top / 1e3, top)
    thickness = 0.15 + 3.2 * np.clip(force / top, 0, 1) ** 0.6
    ends = np.stack([part.position[i][:, [0, 2]], part.position[j][:, [0, 2]]], axis=1)
    lines = LineCollection(ends, array=force, cmap="inferno_r", norm=norm, linewidths=thickness, capstyle="round")
    axes.add_collection(lines)
    colour_bar(figure, axes, lines, "normal force  [N]", extend="both")
    save(figure, out / "forces.png", close=True, bbox_inches="tight")


# ------------------------------------------------------------------ the report

STYLE = """
body{font:16px/1.55 system-ui,'DejaVu Sans',sans-serif;color:#1b1f24;max-width:1180px;margin:2.5rem auto;padding:0 1.5rem}
h1{font-size:1.9rem;margin-bottom:.2rem} h2{margin-top:2.6rem;border-bottom:1px solid #e3e6ea;padding-bottom:.3rem}
.lead{font-size:1.15rem} .muted{color:#6a737d} figure{margin:1.2rem 0} figcaption{color:#6a737d;font-size:.9rem}
img{max-width:100%} .pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(340px,1fr));gap:1.2rem}
.keys{display:grid;grid-template-columns:repeat(auto-fit,minmax(220px,1fr));gap:1rem;margin:1.5rem 0}
.key{border:1px solid #e3e6ea;border-radius:8px;padding:1rem} .key b{display:block;font-size:1.9rem;color:#d55e00}
table{border-collapse:collapse;font-size:.84rem;font-variant-numeric:tabular-nums;width:100%}
th,td{padding:.32rem .55rem;text-align:right;border-bottom:1px solid #e3e6ea;white-space:nowrap}
th:first-child,td:first-child{text-align:left} tr.bad td{color:#b42318} .scroll{overflow-x:auto}
pre{background:#f6f7f9;padding:1rem;overflow:auto;font-size:.8rem;max-height:24rem}
"""

TABLE = [("name", "method", str), ("start", "start", str), ("knob", "setting", str), ("error_rms", "rms error", "{:.2e}"),
         ("error_median", "median", "{:.1e}"), ("error_p99", "99 %", "{:.1e}"), ("error_wall_force", "wall force", "{:.1e}"),
         ("sweeps", "sweeps", "{:,.0f}"), ("wall_s", "wall s", "{:.3g}"), ("counted_gain", "gain, work", "{:.3g}"),
         ("measured_gain", "gain, time", "{:.3g}"), ("ideal_gain", "ideal", "{:.3g}"),
         ("momentum_residual", "momentum res.", "{:.0e}"), ("energy_residual", "energy res.", "{:.0e}"),
         ("missed_contacts", "missed", "{:.0f}"), ("status", "status", str)]


def table_html(rows):
    lines = ["<tr>" + "".join(f"<th>{title}</th>" for _, title, _ in TABLE) + "</tr>"]
    for row in rows:
        row = {**row, "knob": knob(row)}
        cells = "".join("<td>" + html.escape("" if row[key] in (None, "") else
                                             (row[key] if shape is str else shape.format(row[key]))) + "</td>"
                        for key, _, shape in TABLE)
        lines.append(f"<tr{'' if row['status'] == 'ok' else ' class=bad'}>{cells}</tr>")
    return "<div class=scroll><table>" + "".join(lines) + "</table></div>"


def picture(out, name, caption):
    if not (out / name).exists():
        return ""
    data = base64.b64encode((out / name).read_bytes()).decode()
    return (f'<figure><img alt="{html.escape(caption)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>")


def key_numbers(rows):
    """Boxes and one sentence: the gains at the target error, with their range over the start states."""
    boxes, sentences = [], []
    names = {"plain": "the plain uniform scheme", "events": "our best uniform scheme"}
    for quantity, less, what in (("sweeps", "fewer", "contact evaluations"), ("wall_s", "less", "wall clock")):
        found = headline(series_of(rows), quantity)
        for kind in found["baselines"] if found else ():
            gain, spread = gain_over_starts(rows, quantity, kind)
            text = f"{less_or_more(gain, less)} {what}"
            boxes.append(f"<div class=key><b>{html.escape(gain_text(gain))}</b>{text} than {names[kind]} at error "
                         f"{short(found['error'])}{spread}</div>")
            if kind == "plain":
                sentences.append(f"{gain_text(gain)} {text}")
    if not boxes:
        return "<p class=lead>The study charts no selective method, so there is no gain to state.</p>"
    work, time = (headline(series_of(rows), quantity) for quantity in ("sweeps", "wall_s"))
    if work["winner"] == work["name"] == time["winner"]:
        lead = (f"Use <b>{html.escape(work['name'])}</b>: at a relative position error of {short(work['error'])} it needs "
                f"{' and '.join(html.escape(s) for s in sentences)} than the plain uniform scheme at its own best step.")
    else:
        lead = (f"At a relative position error of {short(work['error'])} the least work is that of "
                f"<b>{html.escape(work['winner'])}</b>, the least time that of <b>{html.escape(time['winner'])}</b>.")
    lead = f"<p class=lead>{lead}</p>"
    return lead + "<div class=keys>" + "".join(boxes) + "</div>"


def reference_text(rows):
    lines = []
    for start in sorted({r["start"] for r in rows}):
        here = [r for r in rows if r["start"] == start]
        reference = next((r for r in here if r["name"] == "reference"), None)
        check = next((r for r in here if r["name"] == "reference_check"), None)
        smallest = min((r["error_rms"] for r in charted(here)), default=None)
        if not (reference and check and check["error_rms"] and smallest):
            continue
        verdict = "accepted" if reference["status"] == "ok" else "<b>not accepted</b>"
        lines.append(f"<li>{html.escape(start)}: uniform steps of {reference['step'] * 1e6:.4g} µs; twice the step changes it by "
                     f"{short(check['error_rms'])}, the smallest error charted is {short(smallest)}: {verdict}.</li>")
    return "<ul>" + "".join(lines) + "</ul>"


def provenance(path):
    """Texts and attributes of /provenance of an HDF5 file."""
    found = {}
    if not path.exists():
        return found
    with h5py.File(path, "r") as file:
        if "provenance" not in file:
            return found
        group = file["provenance"]
        items = list(group.attrs.items()) + [(k, v[()]) for k, v in group.items() if isinstance(v, h5py.Dataset)]
        for key, value in items:
            found[key] = value.decode() if isinstance(value, bytes) else str(np.squeeze(value))
    return found


def write_report(rows, told, out):
    single = {k: v for k, v in told.items() if "\n" not in v}
    longer = {k: v for k, v in told.items() if "\n" in v}
    failed = [r for r in rows if r["status"].startswith("failed")]
    page = f"""<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content="width=device-width">
<title>grainclock study</title><style>{STYLE}</style>
<h1>Accuracy against speed</h1><p class=muted>A grainclock study of {len({r['start'] for r in rows})} start state(s)</p>
{key_numbers(rows)}
{picture(out, "chart.png", "Each marker is one run: its rms position error against its work (left) and its wall time (right). "
         "Lower and further left is better. The dashed line is the error at which the gain is read off.")}
<h2>The silo</h2><div class=pair>
{picture(out, "section.png", "Speed of the balls cut by the plane y = 0; fixed balls are grey.")}
{picture(out, "forces.png", "Contact forces as a lattice: lines join the centres of touching balls, thicker and darker where they push harder.")}
{picture(out, "levels.png", "The level of each ball: 0 takes the finest steps, each level above it steps twice as long.")}
</div>
<h2>All points</h2><p>Errors are relative to the rms displacement of the balls still above the outlet. One sweep is the
reference's mean number of contact evaluations per step. Gains are against the plain uniform scheme (predicted, no event
correction) at equal error; empty where that scheme never got so accurate.</p>
{table_html(rows)}
<p>{len(failed)} of {len(rows)} runs failed in the numerics.</p>
<h2>The reference</h2>{reference_text(rows)}
<h2>Provenance</h2><div class=scroll><table>{"".join(f"<tr><td>{html.escape(k)}</td><td style='text-align:left;white-space:normal'>{html.escape(v)}</td></tr>" for k, v in single.items())}</table></div>
{"".join(f"<h3>{html.escape(k)}</h3><pre>{html.escape(v)}</pre>" for k, v in longer.items())}
</html>"""
    aside = out / "report.html.part"
    aside.write_text(page, encoding="utf-8")
    os.replace(aside, out / "report.html")


def scene_of(told):
    """The resolved scene in the provenance, or an empty one."""
    return tomllib.loads(told.get("scene", ""))


def contact_keys(scene):
    """Contact constants of a scene's last phase, or None."""
    contact = {**scene.get("contact", {}), **(scene.get("phase") or [{}])[-1].get("contact", {})}
    return contact if "k_ball" in contact else None


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("study", type=Path, help="directory with study.csv and study.h5")
    parser.add_argument("--out", type=Path, required=True, help="directory for the pictures and report.html")
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--run", type=Path, help="run.h5 whose last frame is drawn")
    source.add_argument("--state", type=Path, help="state as CSV to be drawn instead")
    given = parser.parse_args()
    table = given.study / "study.csv"
    if not table.exists():
        sys.exit(f"report.py: {table}: there is no such file; give the --out directory of `grainclock study`")
    rows = read_rows(table)
    given.out.mkdir(parents=True, exist_ok=True)
    for name in PICTURES:  # of an earlier study
        (given.out / name).unlink(missing_ok=True)
    told = provenance(given.study / "study.h5")
    if charted(rows):
        draw_chart(rows, given.out)
    scene = scene_of(provenance(given.run) if given.run else told)
    outlet_open = (scene.get("phase") or [{}])[-1].get("outlet") == "open"
    frame = None
    if given.run:
        frame = read_last_frame(given.run, outlet_open)
    elif given.state:
        frame = read_csv_state(given.state, outlet_open)
    if frame:
        draw_section(frame, given.out)
        contact = contact_keys(scene)
        if contact:
            draw_forces(frame, contact, given.out)
        if frame.level is not None and frame.level.max() > 0:
            draw_levels(frame, given.out)
    write_report(rows, told, given.out)
    print(given.out / "report.html")


if __name__ == "__main__":
    main()
