#!/usr/bin/python3
"""An hour of stepping the full silo: memory, descriptors, files and the ledger, watched from outside; pass or fail by stated rules.

    endurance.py [--program FILE] [--silo table1] [--state FILE] [--minutes 60] [--round 30] [--out DIR]

The filled silo is shut and opened in turn, so that phases change and the content lasts. Selective steps take five sixths of the
minutes: half of that is one process, then the run is stopped by SIGTERM and resumed three times. Uniform steps take the
last sixth, with one stop. Leaves DIR/rules.csv, samples.csv and endurance.png; exit code 1 if a rule is broken.

Without --state the silo is filled first. One thread; takes 0.3 GB of disk for each simulated minute.
"""

import argparse
import csv
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import h5py
import matplotlib
import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
SELECTIVE = ["stepping.method=multirate", "stepping.tolerance=1e-3"]
UNIFORM = ["stepping.method=uniform", "stepping.step=8e-5"]
# Name, settings, shares of the minutes that its processes take one after the other.
PARTS = [("selective", SELECTIVE, [5 / 12, 5 / 36, 5 / 36, 5 / 36]), ("uniform", UNIFORM, [1 / 12, 1 / 12])]
FRAMES_EVERY = 0.25  # s simulated
STOPPED = 5          # exit code of a run that a signal stopped

MEGABYTE = 1e6
# Bounds of the rules; README.md says where they come from.
WARM_UP, LEAST_WARM_UP = 0.1, 10.0  # of a process's computing, and s of it
LEAST_COMPUTING = 30.0     # s, for what is told of memory
IDLE = 0.5                 # of the clock, not spent computing
GROWTH = 0.02              # of resident memory in one process after its warm-up
PEAK_GROWTH = 64 * MEGABYTE
MOMENTUM = 1e-12
CREATED_SHARE = 0.03
SLOWER = 2.0
SPARE_BYTES = 1.1


# ------------------------------------------------------------------ watching

SAMPLE = ("part", "process", "wall_s", "cpu_s", "rss", "peak", "descriptors", "threads", "bytes", "frames")


def status_of(pid):
    """Numbers of /proc/PID/status; memory in bytes."""
    lines = (line.split() for line in Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines())
    return {words[0][:-1]: int(words[1]) * (1024 if words[-1] == "kB" else 1) for words in lines if len(words) > 1 and words[1].isdigit()}


def cpu_seconds(pid):
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def files_of(run):
    """Bytes of all files of a run, and frames in its segments. Files may come and go meanwhile."""
    size, frames = 0, 0
    for path in run.rglob("*"):
        try:
            size += path.stat().st_size
        except FileNotFoundError:
            continue
        segment = re.fullmatch(r"frames-\d{8}-(\d{8})\.h5", path.name)
        frames = max(frames, int(segment[1])) if segment else frames
    return size, frames


def sample(pid, run):
    """(resident bytes, their peak, open descriptors, threads, ...); nothing once the process has gone."""
    try:
        status = status_of(pid)
        descriptors = len(os.listdir(f"/proc/{pid}/fd"))
        return cpu_seconds(pid), status["VmRSS"], status["VmHWM"], descriptors, status["Threads"], *files_of(run)
    except (FileNotFoundError, ProcessLookupError, KeyError):
        return None


def newest_checkpoint(run):
    return max((path.stem for path in run.glob("checkpoints/*.h5")), default="")


def watch(command, run, seconds, every, log):
    """Runs the command and stops it by SIGTERM some seconds after its first checkpoint, from which on it heeds signals.
    Its samples since then behind their wall time [s] since the call, and its exit code."""
    called, began, rows, before = time.monotonic(), None, [], newest_checkpoint(run)
    with open(log, "ab") as out, subprocess.Popen(command, stdout=out, stderr=out) as process:
        while process.poll() is None and (began is None or time.monotonic() - began < seconds):
            time.sleep(every)
            if began is None and newest_checkpoint(run) != before:
                began = time.monotonic()
            row = sample(process.pid, run)
            if row and began:
                rows.append((time.monotonic() - called, *row))
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
    return rows, process.returncode


def scene_of(template, state, phase):
    """The scene up to its phases, from this state, and 24 new ones in which the outlet is shut and open in turn."""
    text = re.sub(r'(?m)^state = .*$', f'state = "{state}"', template.read_text(encoding="utf-8").split("[[phase]]")[0])
    for k in range(24):
        text += f'[[phase]]\nname = "{k}"\nduration = {phase}\nevery = {min(phase, FRAMES_EVERY)}\noutlet = "{("closed", "open")[k % 2]}"\n\n'
    return text


def run_part(options, name, settings, shares, began):
    """One run, in as many processes as there are shares of the minutes. Its samples and the exit codes."""
    run, rows, codes = options.out / name, [], []
    every = max(0.05, min(2.0, options.minutes / 4))
    for k, share in enumerate(shares):
        sets = [word for setting in settings for word in ("--set", setting)]
        command = [options.program, "resume", run] if k else [options.program, "run", options.out / "scene.toml", "--out", run, *sets]
        offset = time.monotonic() - began
        found, code = watch([*map(str, command), "--threads", "1"], run, 60 * options.minutes * share, every, options.out / f"{name}.log")
        rows += [dict(zip(SAMPLE, (name, k, offset + row[0], *row[1:]))) for row in found]
        codes.append(code)
        print(f"  {name}, process {k + 1} of {len(shares)}: exit code {code} after {time.monotonic() - began - offset:.0f} s, "
              f"{found[-1][1] if found else 0:.0f} s of them computing", flush=True)
        if code != STOPPED:
            break
    return rows, codes


def series_of(run):
    """Every observable of one number by name, and "time" [s]."""
    with h5py.File(run / "run.h5", "r") as file:
        found = {name: group["value"][()] for name, group in file["observables"].items() if group["value"].ndim == 1}
        position = file["particles/content/position"]
        return {**found, "time": position["time"][()], "balls": position["value"].shape[1]}


# ------------------------------------------------------------------ rules

@dataclass
class Verdict:
    part: str
    rule: str
    value: float
    limit: float
    broken: bool


def trend(x, y):
    """Slope of a line through points: the median over all pairs, which jumps up and back do not touch."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    x, y = x[::-(-len(x) // 400)], y[::-(-len(y) // 400)]
    i, j = np.triu_indices(len(x), 1)
    i, j = i[x[j] > x[i]], j[x[j] > x[i]]
    return float(np.median((y[j] - y[i]) / (x[j] - x[i]))) if len(i) else 0.0


def created(series):
    """Energy that nothing accounts for, since the run's start [J]; and what was dissipated on purpose [J]."""
    total = series["kinetic_energy"] + series["potential_energy"] + series["elastic_energy"]
    dissipated = series["dissipated"] + series["first_impact"]
    return total - total[0] + dissipated + series["removed_energy"] - series["event_work"] - series["switched_energy"], dissipated


def memory_rules(rows):
    """Over the samples of one process: {rule: (value, limit)}. Nothing where it has hardly computed."""
    t = np.array([row["cpu_s"] for row in rows])
    if t[-1] < LEAST_COMPUTING:
        return {}
    warm = t >= max(WARM_UP * t[-1], LEAST_WARM_UP)
    column = {name: np.array([row[name] for row in rows])[warm] for name in ("cpu_s", "rss", "peak", "descriptors", "threads")}
    quarters = zip(np.array_split(column["cpu_s"], 4), np.array_split(column["rss"], 4))
    growth = sorted(trend(x, y) for x, y in quarters)[1] * t[-1]  # memory taken once, or twice, shows in a quarter each
    least = [int(tenth.min()) for tenth in np.array_split(column["descriptors"], 10) if len(tenth)]
    return {"resident memory, its second least trend of four quarters, bytes": (growth, GROWTH * np.median(column["rss"])),
            "peak memory, gained after the warm-up, bytes": (column["peak"][-1] - column["peak"][0], PEAK_GROWTH),
            "open descriptors between writes, gained": (least[-1] - least[0], 0),
            "threads, gained": (column["threads"].max() - column["threads"].min(), 0)}


def ledger_rules(series):
    """Over the frames of one run: {rule: (value, limit)}."""
    made, dissipated = created(series)
    # In each tenth of what was dissipated, so that a late drift does not hide in the sum.
    marks = np.unique(np.minimum(np.searchsorted(dissipated, np.linspace(0, dissipated[-1], 11)), len(dissipated) - 1))
    shares = np.abs(np.diff(made[marks])) / np.maximum(np.diff(dissipated[marks]), 1e-300)
    steps = np.diff(series["time"])
    return {"momentum residual": (np.max(series["momentum_residual"]), MOMENTUM),
            "|created energy| / dissipated, worst tenth": (max(shares, default=0.0), CREATED_SHARE),
            "missed contacts": (series["missed_contacts"][-1], 0),
            "gaps between frames, longest over shortest": (steps.max() / steps.min() - 1 if len(steps) else 0.0, 1e-6)}


def file_rules(rows, series):
    """Over the samples and frames of one run: {rule: (value, limit)}."""
    row_bytes = 49 * series["balls"] + 1000  # position and velocity in doubles, a level, the observables
    # The start, the end, three checkpoints: each like a frame with ids and radii. Twice all: a merge writes aside.
    other = 20 * row_bytes
    return {"bytes of files over those of the frames": (rows[-1]["bytes"] / (len(series["time"]) * row_bytes + other), SPARE_BYTES)}


def speed_rules(rows, series):
    """Seconds of computing that a contact evaluation takes, late over early: {rule: (value, limit)}."""
    cpu, frames, first = [], [], {}
    done = 0.0
    for k in sorted({row["process"] for row in rows}):
        mine = [row for row in rows if row["process"] == k]
        cpu += [done + row["cpu_s"] for row in mine]
        frames += [row["frames"] for row in mine]
        done = cpu[-1]
    seen = np.array(frames) > 0
    evaluations = series["contact_evaluations"][np.minimum(np.array(frames)[seen], len(series["time"])) - 1]
    cpu = np.array(cpu)[seen]
    early, late = (cpu[a:b] for a, b in ((0, len(cpu) // 3), (2 * len(cpu) // 3, None)))
    work = [evaluations[a:b] for a, b in ((0, len(cpu) // 3), (2 * len(cpu) // 3, None))]
    costs = [np.ptp(seconds) / max(np.ptp(count), 1.0) for seconds, count in zip((early, late), work) if len(count)]
    return {"computing per contact evaluation, last third over first": (costs[1] / costs[0] if len(costs) == 2 and costs[0] else 0.0, SLOWER)}


def idle_rules(rows):
    """Over the samples of one run: {rule: (value, limit)}. An hour in which little was done shows nothing."""
    ends = {row["process"]: row for row in rows}
    return {"share of the clock not spent computing": (1 - sum(row["cpu_s"] for row in ends.values()) / (rows[-1]["wall_s"] - rows[0]["wall_s"]), IDLE)}


def judge(name, rows, codes, n_processes, series):
    """All rules of a part."""
    def verdicts(rules, where):
        return [Verdict(where, rule, float(value), float(limit), not value <= limit) for rule, (value, limit) in rules.items()]

    found = verdicts({"processes that ended neither in order nor by the signal": (sum(code not in (0, STOPPED) for code in codes), 0)}, name)
    for k in sorted({row["process"] for row in rows}):
        rules = memory_rules([row for row in rows if row["process"] == k])
        found += verdicts(rules, f"{name} {k + 1}/{n_processes}")
        if not rules:
            print(f"  {name} {k + 1}/{n_processes}: computed for less than {LEAST_COMPUTING:g} s, too short to tell of its memory")
    return found + verdicts({**ledger_rules(series), **file_rules(rows, series), **speed_rules(rows, series), **idle_rules(rows)}, name)


# ------------------------------------------------------------------ telling

def draw(rows, all_series, path):
    """Memory above, residuals below, over wall time; dashed where a process was stopped and resumed."""
    matplotlib.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    figure = Figure(figsize=(9, 7), layout="constrained")
    memory, residuals = figure.subplots(2, 1, sharex=True)
    minutes = np.array([row["wall_s"] / 60 for row in rows])
    for key, label, style in (("peak", "peak", {"color": "0.65"}), ("rss", "resident", {"color": "#0072b2"})):
        memory.plot(minutes, [row[key] / MEGABYTE for row in rows], ".", ms=2, label=label, **style)
    memory.set_ylabel("memory [MB]")
    memory.set_ylim(bottom=0)
    memory.legend(loc="lower right")
    for name, series in all_series.items():
        mine = [(row["wall_s"] / 60, row["frames"]) for row in rows if row["part"] == name and row["frames"] > 1]
        if not mine:
            continue
        t, frames = np.array(mine).T
        frame = np.minimum(frames.astype(int), len(series["time"])) - 1
        made, dissipated = created(series)
        for values, label, colour in ((np.abs(made[frame]) / np.maximum(dissipated[frame], 1e-300), "|created energy| / dissipated", "#d55e00"),
                                      (series["momentum_residual"][frame], "momentum residual", "#009e73")):
            residuals.semilogy(t, np.maximum(values, 1e-20), color=colour, label=label if name == next(iter(all_series)) else None)
    for limit in (MOMENTUM, CREATED_SHARE):
        residuals.axhline(limit, color="0.5", ls=":", lw=1)
    ends = {(row["part"], row["process"]): row["wall_s"] / 60 for row in rows}
    for (part, _), end in list(ends.items()):
        for axes in (memory, residuals):
            axes.axvline(end, color="0.8", ls="--", lw=0.8)
    for name in all_series:
        memory.text(min(row["wall_s"] for row in rows if row["part"] == name) / 60, memory.get_ylim()[1], f" {name} steps", va="top")
    residuals.set_xlabel("wall clock [min]; dashed: stopped and resumed; dotted: bounds")
    residuals.legend(loc="center right")
    figure.savefig(path, dpi=130)


def write_csv(path, names, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([[row[name] if isinstance(row, dict) else getattr(row, name) for name in names] for row in rows])


def report(out, rows, all_codes, all_series):
    """Tables, chart and a line for each rule. Whether one was broken."""
    verdicts = []
    for name, _, shares in PARTS:
        verdicts += judge(name, [row for row in rows if row["part"] == name], all_codes[name], len(shares), all_series[name])
    write_csv(out / "samples.csv", SAMPLE, rows)
    write_csv(out / "rules.csv", ("part", "rule", "value", "limit", "broken"), verdicts)
    draw(rows, all_series, out / "endurance.png")
    for v in verdicts:
        print(f"  {'BROKEN' if v.broken else 'held  '} {v.part}: {v.rule}: {v.value:.3g} (at most {v.limit:.3g})")
    for name, series in all_series.items():
        print(f"  {name}: {series['time'][-1] - series['time'][0]:.1f} s simulated, {series['contact_evaluations'][-1]:.3g} contact evaluations, "
              f"{series['discharged'][-1]:.0f} balls out of {series['balls']}")
    return any(v.broken for v in verdicts)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, default=ROOT / "build/release/bin/grainclock")
    parser.add_argument("--minutes", type=float, default=60.0, help="of wall clock, in all")
    parser.add_argument("--silo", default="table1", choices=("table1", "mini"))
    parser.add_argument("--state", type=Path, help="the filled silo")
    parser.add_argument("--round", type=float, default=30.0, help="seconds for which the outlet is shut, and then open")
    parser.add_argument("--out", type=Path, default=ROOT / "out/endurance")
    options = parser.parse_args()
    if options.out.exists() and any(options.out.iterdir()):
        parser.error(f"--out {options.out}: exists and is not empty")
    options.out.mkdir(parents=True, exist_ok=True)
    scenes, filled = ROOT / "silo/scenes", options.out / "filled"
    if not options.state:
        subprocess.run([options.program, "run", scenes / f"{options.silo}-filled.toml", "--out", filled], check=True, stdout=subprocess.DEVNULL)
    state = (options.state or filled / "final.h5").resolve()
    (options.out / "scene.toml").write_text(scene_of(scenes / f"{options.silo}-flow.toml", state, options.round), encoding="utf-8")
    rows, codes, series, began = [], {}, {}, time.monotonic()
    for name, settings, shares in PARTS:
        found, codes[name] = run_part(options, name, settings, shares, began)
        rows += found
        series[name] = series_of(options.out / name)
    sys.exit(report(options.out, rows, codes, series))


if __name__ == "__main__":
    main()
