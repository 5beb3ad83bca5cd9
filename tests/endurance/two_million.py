#!/usr/bin/python3
"""Two million balls through the whole program: check, run, a stop by SIGTERM, resume, info, compare, export, import.

    two_million.py [--program FILE] [--state FILE] [--out DIR] [--method uniform multirate]

The state is the largest one of benchmarks/scale/run.sh. Each call's time, peak memory and bytes of output are told; a
resumed run must have the bits of one that was left alone. Leaves DIR/calls.csv; exit code 1 if something was wrong.
Takes 3.1 GB of memory, 3 GB of disk and ten minutes.
"""

import argparse
import csv
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SCENE = """# Two million balls: the outlet is open.
[initial]
state = "{state}"
[contact]
k_ball = 1e7
k_wall = 1e9
c_ball = 2e4
c_wall = 2e5
[domain]
outlet_z = -0.5
[[phase]]
name = "flow"
duration = {duration}
every = {every}
outlet = "open"
"""
METHODS = {"uniform": ["stepping.method=uniform", "stepping.step=8e-5"], "multirate": ["stepping.method=multirate", "stepping.tolerance=1e-3"]}
EVERY, FRAMES = 8e-3, 2  # s between frames, and how many after the first
STOPPED = 5
EXPORTS = {"csv": "state.csv", "lammps-data": "state.data", "lammps-dump": "state.dump", "vtk": "state.vtp"}


@dataclass
class Call:
    """What a call of the program took."""
    name: str
    exit_code: int
    wall_s: float
    cpu_s: float
    peak_mb: float


class Program:
    """Calls the program one after the other and keeps what each took."""

    def __init__(self, path, log):
        self.path, self.log, self.calls, self.trouble = path, log, [], []

    def call(self, name, *arguments, until=None, expected=0):
        """`until`: when it is true the process gets a SIGTERM."""
        began = time.monotonic()
        with open(self.log, "ab") as out:
            process = subprocess.Popen([str(word) for word in (self.path, *arguments)], stdout=out, stderr=out)
            while until:
                gone, status, usage = os.wait4(process.pid, os.WNOHANG)
                if gone:
                    break
                if until():
                    process.send_signal(signal.SIGTERM)
                    until = None
                time.sleep(0.05)
            else:
                _, status, usage = os.wait4(process.pid, 0)
        process.returncode = code = os.waitstatus_to_exitcode(status)
        self.calls.append(Call(name, code, time.monotonic() - began, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6))
        print(f"  {name}: exit {code}, {self.calls[-1].wall_s:.1f} s ({self.calls[-1].cpu_s:.1f} s computing), {self.calls[-1].peak_mb:.0f} MB", flush=True)
        if code != expected:
            self.trouble.append(f"{name}: exit code {code} instead of {expected}")


def same_bits(a, b):
    """Names of the datasets in which two HDF5 files differ, or that the second lacks; read piece by piece."""
    names, different = set(), []
    with h5py.File(a, "r") as first, h5py.File(b, "r") as second:
        first.visititems(lambda name, item: names.add(name) if isinstance(item, h5py.Dataset) else None)
        for name in sorted(names):
            x, y = first[name], second.get(name)
            if y is None or x.shape != y.shape:
                different.append(name)
            elif not x.shape:
                different += [name] if x[()] != y[()] else []
            elif any(x[k : k + step].tobytes() != y[k : k + step].tobytes()
                     for step in [max(1, x.shape[0] // 64) if x.ndim < 3 else 1] for k in range(0, x.shape[0], step)):
                different.append(name)
    return different


def frames_in(run):
    """Frames that are on the disk."""
    return max((int(path.stem.split("-")[-1]) for path in run.glob("segments/frames-*.h5")), default=0)


def runs(program, out, scene, method):
    """A run left alone and one that was stopped and resumed: names of what differs."""
    whole, stopped = out / method, out / f"{method}-stopped"
    sets = [word for setting in METHODS[method] for word in ("--set", setting)]
    program.call(f"{method}: check", "check", scene, *sets)
    program.call(f"{method}: run", "run", scene, "--out", whole, *sets)
    program.call(f"{method}: run, stopped", "run", scene, "--out", stopped, *sets, until=lambda: frames_in(stopped) > 1, expected=STOPPED)
    program.call(f"{method}: resume", "resume", stopped)
    for name in ("final.h5", "run.h5"):
        # The provenance tells when and where; lists are built at other times after a resume, and are of another length.
        different = [field for field in same_bits(whole / name, stopped / name) if not re.match("provenance|observables/contact_evaluations", field)]
        if different:
            program.trouble.append(f"{method}: after the resume {name} differs in {', '.join(different)}")
    program.call(f"{method}: info", "info", whole / "run.h5")
    program.call(f"{method}: compare", "compare", whole / "run.h5", stopped / "run.h5")


def exports(program, out, run):
    """Each format, and back where a state can be read from it."""
    for kind, name in EXPORTS.items():
        program.call(f"export to {kind}", "export", run / "run.h5", "--to", kind, "--output", out / name)
        print(f"    {(out / name).stat().st_size / 1e6:.0f} MB")
        if kind in ("csv", "lammps-data", "lammps-dump"):
            program.call(f"import from {kind}", "import", out / name, "--output", out / "again.h5")
            with h5py.File(out / "again.h5") as again, h5py.File(run / "final.h5") as final:
                for field in ("position", "velocity", "radius"):
                    if not np.array_equal(again["state"][field], final["state"][field]):
                        worst = np.abs(again["state"][field][()] - final["state"][field][()]).max() if again["state"][field].shape == final["state"][field].shape else np.inf
                        print(f"    {field} differs by at most {worst:.3g}")
            (out / "again.h5").unlink()
        (out / name).unlink()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, default=ROOT / "build/release/bin/grainclock")
    parser.add_argument("--state", type=Path, help="default: the newest build/cache/scale-2000000-*.h5")
    parser.add_argument("--out", type=Path, default=ROOT / "out/two-million")
    parser.add_argument("--method", nargs="+", choices=METHODS, default=list(METHODS))
    options = parser.parse_args()
    found = [options.state] if options.state else sorted((ROOT / "build/cache").glob("scale-2000000-*.h5"), key=os.path.getmtime)
    if not found:
        parser.error("there is no state: run benchmarks/scale/run.sh, or give one by --state")
    if options.out.exists() and any(options.out.iterdir()):
        parser.error(f"--out {options.out}: exists and is not empty")
    options.out.mkdir(parents=True, exist_ok=True)
    scene = options.out / "scene.toml"
    scene.write_text(SCENE.format(state=found[-1].resolve(), every=EVERY, duration=EVERY * FRAMES), encoding="utf-8")

    program = Program(options.program, options.out / "calls.log")
    for method in options.method:
        runs(program, options.out, scene, method)
        shutil.rmtree(options.out / f"{method}-stopped")
    exports(program, options.out, options.out / options.method[-1])
    with open(options.out / "calls.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Call.__annotations__)
        writer.writerows(vars(call).values() for call in program.calls)
    for text in program.trouble:
        print(f"  WRONG {text}")
    sys.exit(bool(program.trouble))


if __name__ == "__main__":
    main()
