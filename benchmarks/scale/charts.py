#!/usr/bin/python3
"""Speed, memory and time to build over the number of balls, beside what the machine allows.

    charts.py DIR

Reads the CSV files that run.sh leaves in DIR, writes DIR/scale.csv and DIR/scale.png, prints the table.
"""

import csv
import sys
from pathlib import Path
from statistics import median

import matplotlib
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

INK, MUTED, GRID = "#1b1f24", "#6a737d", "#e3e6ea"
# Hues as in benchmarks/charts.py: uniform blue, multi-rate red; limits grey.
ONE, TWO, MULTIRATE, MEMORY, SUMS = "#0072b2", "#56b4e9", "#d55e00", "#5f6770", "#a6a6a6"
matplotlib.rcParams.update({
    "font.family": "DejaVu Sans", "font.size": 11, "axes.edgecolor": MUTED, "axes.labelcolor": INK,
    "axes.titleweight": "bold", "axes.titlesize": 12, "text.color": INK, "xtick.color": MUTED, "ytick.color": MUTED,
    "axes.spines.top": False, "axes.spines.right": False, "savefig.facecolor": "white",
})


def number(text):
    try:
        return float(text)
    except ValueError:
        return text


def read(path):
    with open(path, newline="") as file:
        return [{key: number(cell) for key, cell in row.items()} for row in csv.DictReader(file)]


def bandwidths(rows):
    """{(threads, balls): bytes per second, read and written}: the better of mbw's two ways to copy, medians, all cores."""
    rates = {}
    for row in rows:
        rates.setdefault((row["threads"], row["balls"], row["method"]), []).append(row["rate"])
    best = {}
    for (threads, balls, _), found in rates.items():
        rate = 2.0 * threads * 1048576.0 * median(found)
        best[threads, balls] = max(best.get((threads, balls), 0.0), rate)
    return best


def summarise(directory):
    """One row per size, method and number of threads."""
    load = {row["balls"]: row for row in read(directory / "load.csv")}
    memory = {(row["balls"], row["method"]): row for row in read(directory / "memory.csv")}
    limits = {row["threads"]: row for row in read(directory / "limits.csv")}
    bandwidth = bandwidths(read(directory / "bandwidth.csv"))
    timings = {}
    for method in ("uniform", "multirate"):
        for row in read(directory / f"speed-{method}.csv"):
            timings.setdefault((method, row["threads"], row["balls"]), []).append(row)
    return [summary(method, threads, balls, rows, load[balls], memory[balls, method],
                    limits[threads], bandwidth[threads, balls])
            for (method, threads, balls), rows in sorted(timings.items(), key=lambda item: (item[0][0] != "uniform", *item[0][1:]))]


def summary(method, threads, balls, rows, load, memory, limits, bandwidth):
    rates = [row["ball_updates"] / row["seconds"] for row in rows]
    steps = sum(row["steps"] for row in rows)
    listed = median(row["listed"] for row in rows) / balls
    row = {
        "method": method, "threads": int(threads), "balls": int(balls), "fixed": int(memory["fixed"]),
        "contacts_per_ball": load["contacts_per_ball"], "kinetic_per_ball_J": load["kinetic_per_ball"],
        "listed_per_ball": listed, "step_s": rows[0]["step"],
        "million_ball_steps_per_s": 1e-6 * median(rates), "slowest": 1e-6 * min(rates), "fastest": 1e-6 * max(rates),
        "ns_per_ball_step": 1e9 / median(rates), "ns_per_evaluation":
            1e9 * median(row["seconds"] / row["contact_evaluations"] for row in rows),
        "coarse_steps_per_s": median(row["steps"] / row["seconds"] for row in rows),
        "lists_per_1000_steps": 1000.0 * sum(row["list_builds"] for row in rows) / steps,
        "read_s": memory["read_s"], "make_s": memory["make_s"],
        "list_s": memory["list_s"], "list_again_s": memory["list_again_s"],
        **{key: memory[key] for key in ("state_bytes", "making_bytes", "held_bytes", "stepping_bytes", "process_bytes")},
    }
    if method == "uniform":  # the counts are those of uniform steps
        moved = limits["bytes_per_ball"] + listed * limits["bytes_per_pair"]
        operations = limits["operations_per_ball"] + listed * limits["operations_per_pair"]
        row |= {"bytes_per_ball_step": moved, "operations_per_ball_step": operations, "bandwidth_GB_per_s": 1e-9 * bandwidth,
                "memory_limit": 1e-6 * bandwidth / moved, "operation_limit": 1e-6 * limits["operation_rate"] / operations}
    return row


def write(path, rows):
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(path, "w", newline="") as file:
        table = csv.DictWriter(file, columns, restval="")
        table.writeheader()
        for row in rows:
            table.writerow({key: f"{cell:.6g}" if isinstance(cell, float) else cell for key, cell in row.items()})


def print_table(rows):
    print(f"{'method':10}{'cores':>6}{'balls':>9}{'contacts':>10}{'listed':>8}{'ns':>7}{'M ball-steps/s':>16}"
          f"{'of limit':>10}{'process B':>11}{'held B':>8}{'make s':>8}")
    for row in rows:
        limit = min(row["memory_limit"], row["operation_limit"]) if "memory_limit" in row else None
        share = f"{100 * row['million_ball_steps_per_s'] / limit:.0f} %" if limit else ""
        print(f"{row['method']:10}{row['threads']:>6}{row['balls']:>9}{row['contacts_per_ball']:>10.2f}"
              f"{row['listed_per_ball']:>8.2f}{row['ns_per_ball_step']:>7.1f}{row['million_ball_steps_per_s']:>16.1f}"
              f"{share:>10}{row['process_bytes']:>11.0f}{row['held_bytes']:>8.0f}{row['make_s']:>8.2f}")


def count(value, _=None):
    return f"{value / 1e6:g} M" if value >= 1e6 else f"{value / 1e3:.0f} k"


def dress(axes, balls, title, label):
    axes.set_xscale("log")
    axes.set_xticks(balls)
    axes.xaxis.set_major_formatter(FuncFormatter(count))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.minorticks_off()
    axes.set(title=title, xlabel="balls", ylabel=label)
    axes.grid(color=GRID, lw=0.8)
    axes.set_axisbelow(True)


def legend_below(axes):
    axes.legend(frameon=False, fontsize=9, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


def column(rows, key):
    return [row[key] for row in rows]


def draw_speed(axes, rows):
    for threads, colour in ((1, ONE), (2, TWO)):
        of = [row for row in rows if row["method"] == "uniform" and row["threads"] == threads]
        if not of:
            continue
        balls, rate = column(of, "balls"), column(of, "million_ball_steps_per_s")
        spread = [[r - low for r, low in zip(rate, column(of, "slowest"))], [high - r for r, high in zip(rate, column(of, "fastest"))]]
        cores = "one core" if threads == 1 else "two cores"
        axes.errorbar(balls, rate, spread, color=colour, marker="o", lw=2.2, capsize=3, label=f"uniform, {cores}")
        axes.plot(balls, column(of, "memory_limit"), color=colour, ls="--", lw=1.4, label=f"memory's limit, {cores}")
        axes.plot(balls, column(of, "operation_limit"), color=colour, ls=":", lw=1.4, label=f"arithmetic's limit, {cores}")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    legend_below(axes)


def draw_memory(axes, rows):
    for method, colour in (("uniform", ONE), ("multirate", MULTIRATE)):
        of = [row for row in rows if row["method"] == method and row["threads"] == 1]
        axes.plot(column(of, "balls"), column(of, "process_bytes"), color=colour, marker="o", lw=2.2,
                  label=f"{method}, peak of the process")
        axes.plot(column(of, "balls"), column(of, "held_bytes"), color=colour, marker="o", mfc="white", lw=1.4, ls="--",
                  label=f"{method}, held while stepping")
    axes.axhline(600, color=MUTED, lw=1.2, ls=":")
    axes.annotate("target 600", (1, 600), xycoords=("axes fraction", "data"), ha="right", va="bottom", color=MUTED, fontsize=9)
    axes.set_ylim(bottom=0)
    legend_below(axes)


def draw_building(axes, rows):
    of = [row for row in rows if row["method"] == "uniform" and row["threads"] == 1]
    multirate = [row for row in rows if row["method"] == "multirate"]
    for key, source, colour, label in (("read_s", of, SUMS, "reading the state"), ("list_s", of, MEMORY, "first pair list"),
                                       ("list_again_s", of, TWO, "pair list of sorted balls"),
                                       ("make_s", of, ONE, "uniform stepper, its list included"),
                                       ("make_s", multirate, MULTIRATE, "multi-rate stepper, its step included")):
        axes.plot(column(source, "balls"), [1e6 * row[key] / row["balls"] for row in source], color=colour, marker="o", lw=1.8,
                  label=label)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    legend_below(axes)


def draw(rows, path):
    figure = Figure(figsize=(15, 5.6), layout="constrained")
    axes = figure.subplots(1, 3)
    balls = sorted({row["balls"] for row in rows})
    dress(axes[0], balls, "Speed, balls at rest", "million ball-steps per second")
    dress(axes[1], balls, "Memory", "bytes per ball")
    dress(axes[2], balls, "Time to be ready", "microseconds per ball")
    draw_speed(axes[0], rows)
    draw_memory(axes[1], rows)
    draw_building(axes[2], rows)
    figure.savefig(path, dpi=130)


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    directory = Path(sys.argv[1])
    rows = summarise(directory)
    write(directory / "scale.csv", rows)
    print_table(rows)
    draw(rows, directory / "scale.png")


if __name__ == "__main__":
    main()
