"""The charts: error against wall clock of all codes, and ball-steps per second."""

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from accuracy import ERRORS
from study_charts import GRID, INK, MUTED, amount
from tables import GENERIC, name_of

# Okabe-Ito hues, which stay apart for colour-blind readers; grainclock's generic build is hollow.
COLOURS = {"grainclock": "#d55e00", "LAMMPS": "#0072b2", "LIGGGHTS": "#009e73", "YADE": "#cc79a7"}
METHODS = {"multirate": ("#d55e00", "o"), "uniform with events": ("#e6a000", "D"), "uniform plain": ("#5f6770", "s")}
PEER_MARKER = {"LAMMPS": "^", "LIGGGHTS": "v", "YADE": "P"}
BUILDS = "Peers: Debian's generic builds. grainclock: the best kernels for the machine (filled) and the same generic target (hollow)."


def look(point):
    """Colour, marker and filling of a series."""
    colour, marker = METHODS[point.method] if point.method else (COLOURS[point.code], PEER_MARKER[point.code])
    return {"color": colour, "marker": marker, "markerfacecolor": "white" if point.kernels == GENERIC else colour,
            "linestyle": "--" if point.kernels == GENERIC else "-"}


def draw_accuracy(points, costs, title, path):
    figure = Figure(figsize=(11, 6), layout="constrained")
    axes = figure.add_subplot()
    for label in dict.fromkeys(p.label() for p in points):
        its = sorted((p for p in points if p.label() == label), key=lambda p: -p.value)  # the coarsest first
        first = its[0]
        axes.loglog([p.time() for p in its], [p.errors.rms for p in its], linewidth=1.6, markersize=6.5,
                    label=None if first.kernels == GENERIC else first.method or first.code, **look(first))
        add_extrapolation(axes, its[-1], [c for c in costs if c.label == label and c.extrapolated])
    for error in ERRORS:
        axes.axhline(error, color=MUTED, linewidth=0.9, linestyle=":")
    axes.set_xlabel("wall clock of the stepping, one core  [s]")
    axes.set_ylabel("rms position error / rms displacement")
    finish(figure, axes, title)
    handles, _ = axes.get_legend_handles_labels()
    if any(c.extrapolated for c in costs):
        handles.append(Line2D([], [], color=MUTED, linestyle=":", marker="x", label="extrapolated\nat first order"))
    axes.legend(handles=handles, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.savefig(path, dpi=160)


def add_extrapolation(axes, finest, costs):
    """From a code's finest point to what first order promises."""
    if costs:
        axes.plot([finest.time(), *(c.seconds for c in costs)], [finest.errors.rms, *(c.error for c in costs)],
                  linestyle=":", marker="x", markevery=slice(1, None), color=look(finest)["color"])


def draw_speeds(speeds, title, path):
    groups = list(dict.fromkeys((s.case, s.threads) for s in speeds))
    names = list(dict.fromkeys(name_of(s) for s in speeds))
    figure = Figure(figsize=(9.5, 0.5 + 0.28 * len(groups) * (len(names) + 1.5)), layout="constrained")
    axes = figure.add_subplot()
    places, labels = [], []
    for g, (case, threads) in enumerate(groups):
        its = {name_of(s): s for s in speeds if (s.case, s.threads) == (case, threads)}
        for n, name in enumerate(its):
            draw_bar(axes, g * (len(names) + 1.5) + n, its[name])
        places.append(g * (len(names) + 1.5) + (len(its) - 1) / 2)
        labels.append(f"{case}\n{threads} core" + "s" * (threads > 1))
    axes.set_yticks(places, labels)
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.3e-6 * max(max(s.rates) for s in speeds))  # room for the names
    axes.set_xlabel("million ball-steps per second  (bars: median, lines: range of the runs)")
    finish(figure, axes, title)
    axes.grid(False, axis="y")
    figure.savefig(path, dpi=160)


def draw_bar(axes, place, speed):
    colour = COLOURS[speed.code]
    axes.barh(place, 1e-6 * speed.rate(), height=0.8, edgecolor=colour, color="white" if speed.kernels == GENERIC else colour)
    axes.plot([1e-6 * min(speed.rates), 1e-6 * max(speed.rates)], [place, place], color=INK, linewidth=1.2)
    axes.annotate(f"{name_of(speed)}  {amount(1e-6 * speed.rate())}", (1e-6 * max(speed.rates), place), (6, 0),
                  textcoords="offset points", va="center", fontsize=9)


def finish(figure, axes, title):
    axes.grid(True, which="major", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_title(title, loc="left")
    figure.supxlabel(BUILDS, fontsize=8.5, color=MUTED, x=0.01, ha="left")
