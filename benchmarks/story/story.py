"""Times a scene phase by phase, with uniform and selective steps: story.py PROGRAM SCENE THREADS OUT METHOD..."""

import csv
import pathlib
import re
import shutil
import subprocess
import sys
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

# The uniform step is 0.7 of the bound of the balls at the wall, which touch several of its balls; phases with a method of their own (filling) keep it.
METHODS = {
    "uniform": ['stepping.method="uniform"', "stepping.events=false", "stepping.step=8e-5"],
    "multirate": ['stepping.method="multirate"', "stepping.tolerance=1e-3"],
}
END = re.compile(r'phase "(?P<phase>[^"]+)" ends at (?P<end>[-+.0-9e]+) s: (?P<why>.*)')


def run(program, scene, threads, settings, out):
    """Rows (phase, simulated end [s], wall seconds since the start, why it ended), as the program reports them."""
    command = [program, "run", scene, "--threads", threads, "--out", str(out)]
    for setting in settings:
        command += ["--set", setting]
    rows, began = [], time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            found = END.match(line)
            if found:
                rows.append((found["phase"], float(found["end"]), time.monotonic() - began, found["why"]))
                print(f"  {found['phase']} until {rows[-1][1]:.2f} s: {rows[-1][2]:.1f} s on the clock ({found['why']})", flush=True)
    if process.returncode != 0:
        sys.exit(f"story.py: {' '.join(command)} ended with exit code {process.returncode}")
    return rows


def with_spans(rows):
    """Per phase: simulated and wall seconds, and their ratio."""
    table, simulated, wall = [], 0.0, 0.0
    for phase, end, clock, why in rows:
        table.append((phase, end - simulated, clock - wall, (clock - wall) / (end - simulated), why))
        simulated, wall = end, clock
    table.append(("all", simulated, wall, wall / simulated, ""))
    return table


def draw(stories, threads, path):
    figure, axes = plt.subplots(figsize=(7.5, 4.8), layout="constrained")
    longest = 0.0
    for name, rows in stories.items():
        axes.plot([0.0] + [end for _, end, _, _ in rows], [0.0] + [clock for _, _, clock, _ in rows], marker="o", label=name)
        longest = max([longest] + [end for _, end, _, _ in rows])
    axes.plot([0.0, longest], [0.0, longest], "--", color="0.5", label="real time")
    for rows in stories.values():
        for phase, simulated, wall, _, _ in with_spans(rows)[:-1]:
            end, clock = next((end, clock) for name, end, clock, _ in rows if name == phase)
            if simulated > 0.08 * longest:  # short ones would lie on top of each other
                axes.annotate(phase, (end - simulated / 2, clock - wall / 2), textcoords="offset points", xytext=(-40, 6), fontsize=8)
    axes.set_xlabel("simulated time [s]; dots: ends of phases")
    axes.set_ylabel("wall clock [s]")
    axes.set_title(f"The whole story, {threads} thread(s): below the dashed line is faster than real time", fontsize=10)
    axes.legend()
    figure.savefig(path, dpi=130)


def main():
    program, scene, threads, out, *methods = sys.argv[1:]
    out = pathlib.Path(out)
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    stories = {}
    for name in methods:
        print(f"{name} ({', '.join(METHODS[name])}): {scene}, {threads} thread(s)", flush=True)
        stories[name] = run(program, scene, threads, METHODS[name], out / name)
    with open(out / "story.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["method", "threads", "phase", "simulated_s", "wall_s", "wall_over_simulated", "ended_because"])
        for name, rows in stories.items():
            for row in with_spans(rows):
                writer.writerow([name, threads, *row])
                print(f"{name:10} {row[0]:12} {row[1]:8.2f} s simulated {row[2]:8.1f} s wall, ratio {row[3]:.2f}")
    draw(stories, threads, out / "story.png")
    print(f"table and chart: {out}/story.csv, {out}/story.png")


if __name__ == "__main__":
    main()
