#!/usr/bin/python3
"""Chart and tables of the kernel benchmarks.

    charts.py DIR

Reads DIR/kernels.json (kernel_benchmarks, all repeats) and DIR/terms.csv (kernel_terms); leaves DIR/kernels.csv,
DIR/ratios.csv and DIR/kernels.png, and prints the ratios.
"""

import csv
import json
import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

INK, MUTED, GRID = "#1b1f24", "#6a737d", "#e3e6ea"
SETS = {"portable": "#8a939c", "avx2": "#56b4e9", "avx512": "#0072b2"}
OTHER = "#d55e00"
ITEMS = ("pair", "ball", "step")  # what counters per_ITEM count by
FIRST = {"bare": "bare loop", "off": "all terms off"}  # what ratios of a group are formed with

matplotlib.rcParams.update({
    "font.family": "DejaVu Sans", "font.size": 10, "axes.edgecolor": MUTED, "axes.labelcolor": INK,
    "axes.titleweight": "bold", "axes.titlesize": 11, "text.color": INK, "xtick.color": MUTED, "ytick.color": INK,
    "axes.spines.top": False, "axes.spines.right": False, "savefig.facecolor": "white",
})


# ------------------------------------------------------------------ data

@dataclass
class Timing:
    """One benchmark: nanoseconds per item over the repeats."""
    subject: str
    variant: str
    kernels: str   # instruction set; empty where there is no such choice
    item: str      # one of ITEMS
    repeats: list

    @property
    def median(self):
        return float(np.median(self.repeats))

    def quartiles(self):
        return tuple(float(q) for q in np.quantile(self.repeats, [0.25, 0.75]))

    @property
    def label(self):
        variant = self.variant.replace("_", " ")
        if self.subject in ("neighbours", "coarse_step"):
            return variant
        return self.subject if variant == "all" else f"{self.subject}, {variant}"


def read_timings(path):
    """Timings in the file's order, and what the file says of the state."""
    told = json.loads(path.read_text())
    timings = {}
    for run in sorted(told["benchmarks"], key=lambda run: run["family_index"]):
        if run["run_type"] != "iteration":
            continue
        if run.get("error_occurred"):
            print(f"charts.py: {run['name']} is left out: {run['error_message']}", file=sys.stderr)
            continue
        subject, variant, *rest = run["run_name"].removesuffix("/manual_time").removesuffix("/iterations:1").split("/")
        item = next(item for item in ITEMS if f"per_{item}" in run)
        known = timings.setdefault(run["run_name"], Timing(subject, variant, "".join(rest), item, []))
        known.repeats.append(1e9 * run[f"per_{item}"])
    return list(timings.values()), told["context"]


def read_terms(path):
    with path.open() as file:
        return [{**row, **{key: float(row[key]) for key in ("median", "low", "high")}} for row in csv.DictReader(file)]


def set_ratios(timings):
    """(label, set, time of the portable set over its time), for all benchmarks that have a choice of sets."""
    portable = {t.label: t.median for t in timings if t.kernels == "portable"}
    return [(t.label, t.kernels, portable[t.label] / t.median) for t in timings if t.kernels not in ("", "portable")]


def coarse_ratios(timings, balls):
    """(text, ratio) of coarse steps of selective stepping by how they end, and of the parts of a renewal."""
    time = {(t.subject, t.variant): t.median for t in timings}
    plain = time.get(("coarse_step", "plain"))
    if plain is None:
        return []
    out = [(f"coarse step, {kind}: over plain", time["coarse_step", kind] / plain)
           for kind in ("renewed", "relisted") if ("coarse_step", kind) in time]
    out.append(("share of selective steps' time that renewals take", 1.0 - plain / time["coarse_step", "mean"]))
    out.append(("walk through the schedule: over a plain coarse step", time["schedule", "empty"] / (plain * balls)))
    for part in (("limiter", "sparse"), ("shared_reach", "all"), ("stability", "all")):
        if ("coarse_step", "renewed") in time:
            out.append((f"{part[0]}: over what a renewal adds", time[part] / (time["coarse_step", "renewed"] - plain)))
    return out


# ------------------------------------------------------------------ tables

def write_tables(directory, timings, balls):
    with (directory / "kernels.csv").open("w") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["subject", "variant", "kernels", "item", "ns_median", "ns_low", "ns_high"])
        for t in timings:
            table.writerow([t.subject, t.variant, t.kernels, t.item, *(f"{x:.4g}" for x in (t.median, *t.quartiles()))])
    rows = [(f"{label}: portable over {kernels}", ratio) for label, kernels, ratio in set_ratios(timings)]
    rows += coarse_ratios(timings, balls)
    with (directory / "ratios.csv").open("w") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["ratio", "value"])
        table.writerows((name, f"{value:.4g}") for name, value in rows)
    print("Ratios of medians over the repeats, which ran in random order:")
    for name, value in rows:
        print(f"  {value:8.3g}  {name}")


# ------------------------------------------------------------------ chart

def draw_bars(axes, timings, title):
    """Horizontal bars, one colour per instruction set."""
    labels = list(dict.fromkeys(t.label for t in timings))
    sets = list(dict.fromkeys(t.kernels for t in timings))
    height = 0.8 / len(sets)
    for k, kernels in enumerate(sets):
        mine = [t for t in timings if t.kernels == kernels]
        at = [labels.index(t.label) + (k - 0.5 * (len(sets) - 1)) * height for t in mine]
        reach = np.abs(np.array([t.quartiles() for t in mine]).T - [t.median for t in mine])
        axes.barh(at, [t.median for t in mine], height, color=SETS.get(kernels, OTHER), label=kernels or None, xerr=reach,
                  error_kw={"ecolor": MUTED, "elinewidth": 1})
        for y, t in zip(at, mine):
            axes.annotate(f"{t.median:.3g}", (t.quartiles()[1], y), xytext=(3, 0), textcoords="offset points", va="center",
                          fontsize=7, color=MUTED)
    axes.set_yticks(range(len(labels)), labels)
    axes.invert_yaxis()
    axes.set_xlim(left=0)
    axes.margins(x=0.12)
    axes.set_title(title, loc="left")
    axes.grid(axis="x", color=GRID)
    axes.set_axisbelow(True)
    if sets != [""]:
        axes.legend(frameon=False, fontsize=8, loc="lower right")


def draw_terms(axes, terms, rounds_of, title):
    """Ratios with quartiles to the first of each group; the first itself is the line at 1."""
    rows = [row for row in terms if row["what"] == rounds_of]
    first = rows[0]["terms"]
    labels = list(dict.fromkeys(row["terms"] for row in rows if row["terms"] != first))
    sets = list(dict.fromkeys(row["kernels"] for row in rows))
    for k, kernels in enumerate(sets):
        mine = [row for row in rows if row["kernels"] == kernels and row["terms"] != first]
        at = [labels.index(row["terms"]) + (k - 0.5 * (len(sets) - 1)) * 0.2 for row in mine]
        median = np.array([row["median"] for row in mine])
        reach = [median - [row["low"] for row in mine], [row["high"] for row in mine] - median]
        axes.errorbar(median, at, xerr=reach, fmt="o", markersize=5, color=SETS.get(kernels, OTHER), label=kernels, capsize=2)
    axes.axvline(1.0, color=INK, linewidth=1)
    axes.set_yticks(range(len(labels)), [label.replace("off", "all off") for label in labels])
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlabel(f"time over that of the {FIRST[first]} in the same round")
    axes.set_title(title, loc="left")
    axes.grid(axis="x", color=GRID)
    axes.set_axisbelow(True)
    axes.legend(frameon=False, fontsize=8)


def draw(timings, context, terms):
    by_set = [t for t in timings if t.kernels]
    figure = Figure(figsize=(13, 13), layout="constrained")
    axes = figure.subplots(3, 2, height_ratios=[1.5, 1, 1])
    draw_bars(axes[0, 0], [t for t in by_set if t.item == "pair"], "Contacts: ns per listed pair")
    draw_bars(axes[0, 1], [t for t in by_set if t.item == "ball"], "Motion: ns per ball")
    draw_bars(axes[1, 0], [t for t in timings if t.subject == "neighbours"], "Pair lists: ns per ball")
    draw_bars(axes[1, 1], [t for t in timings if t.subject == "coarse_step"], "Selective steps: ns per ball and coarse step")
    draw_terms(axes[2, 0], terms, "sweep", "Terms of the law: a sweep over the same pairs")
    draw_terms(axes[2, 1], terms, "step", "Terms of the law: a whole uniform step")
    figure.suptitle(f"{Path(context['state']).stem}, {context['balls']} balls; medians and quartiles", color=MUTED, fontsize=10)
    return figure


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    directory = Path(sys.argv[1])
    timings, context = read_timings(directory / "kernels.json")
    write_tables(directory, timings, int(context["balls"]))
    draw(timings, context, read_terms(directory / "terms.csv")).savefig(directory / "kernels.png", dpi=130)
    print(f"Chart: {directory / 'kernels.png'}")


if __name__ == "__main__":
    main()
