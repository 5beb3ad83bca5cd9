#!/usr/bin/python3
"""Injects faults into runs of grainclock and looks at what is left: each must resume bitwise, or be refused clearly.

  faults.py           a few dozen of each kind that matters, in seconds (the fast test)
  faults.py --all     every kind, hundreds of kills (the slow test; half an hour), which gives the table of README.md
  --only NAME... --seed N   some kinds of fault; other moments
Every case has a number of its own from the seed; a failure prints it, and `--only NAME --seed N` repeats it.

GRAINCLOCK_PROGRAM is the program, GRAINCLOCK_FAULT_SHIM the library of shim.c; those of build/release if not set.
After each fault:
  1. run.h5, if there is one, opens with h5py alone, and its frames are bit for bit those of the undisturbed run;
  2. no other file under a final name is half-written: each HDF5 file opens, each text is whole;
  3. `resume` ends with 0, and then the final state, all frames and all observables are those of the undisturbed run,
     bit for bit; or it ends with 2 or 4 and the reason that is expected of this fault. All else has FAILED.
"""

import argparse
import contextlib
import ctypes
import errno
import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import h5py
import numpy as np

BUILD = Path(__file__).resolve().parents[2] / "build/release"
PROGRAM = os.environ.get("GRAINCLOCK_PROGRAM", BUILD / "bin/grainclock")
SHIM = os.environ.get("GRAINCLOCK_FAULT_SHIM", BUILD / "tests/faults/libfault_shim.so")
LONGEST = 1800  # s, for any call: a machine that others use may stop us for a while
# Lists are built at other times after a restart, and so are of another length: the work differs, not the result.
NOT_COMPARED = {"contact_evaluations"}

NO_CHECKPOINT = "holds no run|holds no checkpoint yet"


# ---------------------------------------------------------------- the program

def environment(fault):
    if not fault:
        return os.environ
    sanitizer = os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"  # the shim comes before it
    return {**os.environ, "LD_PRELOAD": SHIM, "ASAN_OPTIONS": sanitizer, **{f"FAULT_{name}": str(value) for name, value in fault.items()}}


def start(*words, fault=None, **options):
    """A running program. `fault`: what the shim does, by the names of its variables without FAULT_."""
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.Popen([PROGRAM, *map(str, words)], env=environment(fault), text=True, errors="replace", **options)


def end(process):
    """(exit code, standard output, standard error)."""
    out, err = process.communicate(timeout=LONGEST)
    return process.returncode, out or "", err or ""


def call(*words, **options):
    return end(start(*words, **options))


# ---------------------------------------------------------------- scenes

def pile(path):
    """48 balls above a floor of fixed balls with a plugged hole in its middle, as in tests/silo/program.cpp."""
    lines, number = ["id,kind,x,y,z,vx,vy,vz,radius"], 0
    for layer in range(3):
        for x in range(4):
            for y in range(4):
                at = (0.47 * x - 0.7 + 0.03 * layer, 0.48 * y - 0.72 - 0.02 * x, 0.42 + 0.46 * layer + 0.01 * y)
                lines.append(f"{number},content,{at[0]!r},{at[1]!r},{at[2]!r},{0.01 * y!r},0,-1,{0.215 + 0.001 * (number % 10)!r}")
                number += 1
    for x in range(-4, 5):
        for y in range(-4, 5):
            kind = "plug" if abs(x) <= 1 and abs(y) <= 1 else "wall"
            lines.append(f"{number},{kind},{0.3 * x!r},{0.3 * y!r},0,0,0,0,0.22")
            number += 1
    path.write_text("\n".join(lines) + "\n")


PILE = """
[initial]
state = "pile.csv"
[domain]
outlet_z = -1.0
[stepping]
method = "{method}"
step = {step}
tolerance = 1e-6
[output]
every = {every}
[[phase]]
name = "settle"
duration = {settle}
[[phase]]
name = "flow"
duration = {flow}
outlet = "open"
[[phase]]
name = "shut"
duration = {shut}
"""

# A silo that is filled, discharged and shut in about a second: most of a random moment lies in the filling.
SILO = """
seed = 3
[silo]
radius = 1.0
height = 2.0
hopper_height = 0.6
outlet = 1.4
balls = 60
r_min = 0.215
r_max = 0.225
surface = "inner"
collar = 4.0
[contact]
c_ball = 2e4
c_wall = 2e5
[domain]
outlet_z = -0.5
[output]
every = 0.05
[[phase]]
name = "fill"
duration = 0.5
outlet = "closed"
first_impact = true
method = "uniform"
step = {fill_step}
contact = {{ k_wall = 1e8, c_ball = 3e4, c_wall = 9e4 }}
[[phase]]
name = "discharge"
until = "discharged:0.1"
max_duration = 3.0
outlet = "open"
tolerance = 1e-5
[[phase]]
name = "hammer"
duration = 0.1
outlet = "closed"
"""


class Case:
    """A scene and its undisturbed run. `often`: a checkpoint before every step that may have one, so that the order of
    the program's calls is the same each time."""

    def __init__(self, scratch, name, text, often):
        self.directory = scratch / name
        self.directory.mkdir()
        pile(self.directory / "pile.csv")
        self.scene = self.directory / "scene.toml"
        self.scene.write_text(text)
        self.options = ["--checkpoint-every", "0" if often else "0.02"]
        self.reference = self.directory / "reference"
        begin = time.monotonic()
        code, out, err = call("run", self.scene, "--out", self.reference, *self.options)
        assert code == 0, err + out
        self.seconds = time.monotonic() - begin
        self.final = contents(self.reference / "final.h5")
        self.frames = contents(self.reference / "run.h5")

    def __str__(self):
        return self.directory.name

    def run(self, out, **options):
        return call("run", self.scene, "--out", out, *self.options, **options)

    def resume(self, out, **options):
        return call("resume", out, *self.options, **options)

    def calls(self, out, *words, fault=None):
        """How many file calls the program makes in a directory."""
        log = self.directory / "calls.log"
        log.unlink(missing_ok=True)
        call(*words, fault={"DIR": out, "LOG": log})
        return log.read_text().splitlines()


def contents(path):
    """Every dataset of an HDF5 file: {name: (shape, bytes)}; provenance and the checksums over it are not results."""
    found = {}

    def note(name, item):
        if isinstance(item, h5py.Dataset) and not name.startswith("provenance"):
            values = np.asarray(item[()])
            # An array of objects (texts) holds places in memory, which differ from file to file.
            found[name] = (item.shape, values.tolist() if values.dtype == object else values.tobytes())

    with h5py.File(path, "r") as file:
        file.visititems(note)
        # visititems goes to an object with several names once only, under one of them.
        for name in ("particles/content/position/time", "particles/content/position/step"):
            if name in file:
                found[name] = (file[name].shape, file[name][()].tobytes())
    return found


class Failure(Exception):
    """The program did what it must not."""


def require(condition, text):
    if not condition:
        raise Failure(text)


def is_series(name):
    return name.startswith("observables/") or (name.startswith("particles/content/") and name.count("/") == 3)


def require_frames(found, wanted, whole):
    """The frames that are there are the first ones of the undisturbed run."""
    times = "particles/content/position/time"
    count, all_frames = found[times][0][0], wanted[times][0][0]
    require(count == all_frames if whole else count <= all_frames, f"{count} frames of {all_frames}")
    for name, (shape, data) in wanted.items():
        if name.split("/")[-2:-1] and name.split("/")[1] in NOT_COMPARED:
            continue
        if is_series(name):
            if count == 0 and name not in found:
                continue  # observables have names from the first frame on
            data = data[: len(data) // all_frames * count]
        require(name in found, f"run.h5 lacks {name}")
        require(found[name][1] == data, f"run.h5: {name} differs from the undisturbed run")


def require_whole_files(directory, case):
    """1 and 2 of the list above."""
    for path in directory.rglob("*"):
        if path.name.startswith(".") or path.is_dir():
            continue
        if path.suffix == ".h5":
            try:
                found = contents(path)
            except (OSError, RuntimeError) as trouble:
                raise Failure(f"{path.relative_to(directory)} does not open: {trouble}")
            if path.name == "run.h5":
                require_frames(found, case.frames, whole=False)
        elif path.name == "scene.toml":
            require(path.read_bytes() == (case.reference / "scene.toml").read_bytes(), "scene.toml is not whole")


def checkpoints(directory):
    return sorted((directory / "checkpoints").glob("[0-9]*.h5")) if (directory / "checkpoints").is_dir() else []


def require_orderly(code, out, err, allowed=(0, 2, 4, 5)):
    require(code in allowed, f"exit {code}: {err.strip() or out.strip()[-300:]}")
    require(code in (0, 5, -9) or err.startswith("grainclock: "), f"exit {code} without a message: {err}")


def matches(text, pattern):
    return any(part in text for part in pattern.split("|"))


def settle(directory, case, refusal=None, look_first=True, must_refuse=False):
    """What became of a run after a fault: "resumed bitwise" or "refused clearly". `refusal`: texts of which one must
    be in the refusal, where the fault allows one; a run without a checkpoint always does."""
    if not directory.exists():
        return "nothing was written"
    if look_first:
        require_whole_files(directory, case)
    if not checkpoints(directory):
        refusal = NO_CHECKPOINT if refusal is None else f"{refusal}|{NO_CHECKPOINT}"
    code, out, err = case.resume(directory)
    require_orderly(code, out, err, (0, 2, 4))
    if code != 0:
        require(refusal is not None, f"resume: exit {code}: {err.strip()}")
        require(matches(err, refusal), f"resume refuses for another reason: {err.strip()}")
        return "refused clearly"
    require(not must_refuse, "resume went on, and should not have")
    require(contents(directory / "final.h5") == case.final, "final.h5 differs from the undisturbed run")
    require_frames(contents(directory / "run.h5"), case.frames, whole=True)
    parts = [str(path.relative_to(directory)) for path in directory.rglob("*.part")]
    require(not parts, f"left behind: {parts}")
    return "resumed bitwise"


# ---------------------------------------------------------------- the table

class Table:
    def __init__(self, scratch, only, seed):
        self.scratch, self.only, self.seed = scratch, only, seed
        self.rows, self.failures = [], []

    def wants(self, name):
        return self.only is None or name in self.only

    def fault(self, name, text, cases, attempt):
        """attempt(directory, random numbers, case) for each of the cases; gives a text for the table, or throws Failure."""
        if not self.wants(name) or not cases:
            return
        begin, counts = time.monotonic(), Counter()
        for number, case in enumerate(cases):
            directory = self.scratch / "case"
            numbers = random.Random(f"{self.seed} {name} {number}")
            try:
                counts[attempt(directory, numbers, case)] += 1
            except (Failure, subprocess.TimeoutExpired, AssertionError) as trouble:
                counts["FAILED"] += 1
                self.failures.append(f"{name} [{number}] {case}: {trouble}")
                print(f"FAILED {self.failures[-1]}", flush=True)
            remove(directory)
        self.rows.append((text, sum(counts.values()), counts))
        what = ", ".join(f"{count} {outcome}" for outcome, count in counts.most_common())
        print(f"{name}: {text}: {sum(counts.values())} times: {what} ({time.monotonic() - begin:.0f} s)", flush=True)

    def markdown(self):
        lines = ["| fault | how often | what happened |", "| --- | --- | --- |"]
        for text, total, counts in self.rows:
            lines.append(f"| {text} | {total} | {', '.join(f'{count} {outcome}' for outcome, count in counts.most_common())} |")
        return "\n".join(lines)


def remove(directory):
    for path in (directory, *directory.parent.glob(directory.name + "-*")):
        if path.exists():
            shutil.rmtree(path)


# ---------------------------------------------------------------- kills

def killed_at_random(directory, numbers, case):
    process = start("run", case.scene, "--out", directory, *case.options)
    time.sleep(numbers.uniform(0.0, 1.1 * case.seconds))
    process.kill()
    end(process)
    return settle(directory, case)


def killed_again_and_again(directory, numbers, case):
    """The run and every resume of it, until one comes to its end."""
    words = ["run", case.scene, "--out", directory]
    for _ in range(40):
        process = start(*words, *case.options)
        time.sleep(numbers.uniform(0.0, 0.4 * case.seconds))
        process.kill()
        if end(process)[0] == 0:
            break
        if directory.exists():
            require_whole_files(directory, case)
        if checkpoints(directory):
            words = ["resume", directory]
        elif directory.exists():
            shutil.rmtree(directory)
    return settle(directory, case)


def at_call(number, **what):
    """A fault at one file call of a run."""

    def attempt(directory, numbers, case):
        code, out, err = case.run(directory, fault={"DIR": directory, "AT": number, **what})
        if what.get("SIGNAL") == signal.SIGKILL:
            require(code in (-signal.SIGKILL, 0), f"exit {code}: {err}")
        elif "SIGNAL" in what:
            require_orderly(code, out, err, (0, 5))
        else:
            require_orderly(code, out, err, (0, 4))
            require(code == 4 or what.get("ONCE") or directory.exists(), "exit 0")
        return settle(directory, case, look_first=True)

    return attempt


def each_call(table, name, text, case, numbers, **what):
    """The same fault at these of the calls. One row of the table."""
    if not table.wants(name):
        return
    attempts = iter(numbers)
    table.fault(name, text, [case] * len(numbers), lambda directory, chance, its: at_call(next(attempts), **what)(directory, chance, its))


def stopped_midway(directory, case, numbers):
    """A run that was killed at some file call after its first checkpoint."""
    first = next(k for k, line in enumerate(case.all_calls) if "rename" in line and "checkpoints/000000.h5" in line)
    at = numbers.randrange(first + 2, len(case.all_calls))
    case.run(directory, fault={"DIR": directory, "AT": at, "SIGNAL": 9})


def resume_hurt(**what):
    """A fault at a random file call of a resume."""

    def attempt(directory, numbers, case):
        stopped_midway(directory, case, numbers)
        require_whole_files(directory, case)
        at = numbers.randrange(1, 60)
        code, out, err = case.resume(directory, fault={"DIR": directory, "AT": at, **what})
        if what.get("SIGNAL") != 9:
            require_orderly(code, out, err, (0, 4, 5))
        return settle(directory, case)

    return attempt


# ---------------------------------------------------------------- disks

def on_a_small_disk(directory, numbers, case):
    """A real file system that becomes full, is then made larger, and the run goes on."""
    directory.mkdir()
    size = numbers.randrange(80, 1500)  # kB
    mount("tmpfs", directory, f"size={size}k")
    try:
        code, out, err = case.run(directory / "out")
        require_orderly(code, out, err, (0, 4))
        require(code == 4 or size > 400, f"exit 0 on {size} kB")
        mount("tmpfs", directory, "remount,size=64m")
        return settle(directory / "out", case) if (directory / "out").exists() else "nothing was written"
    finally:
        unmount(directory)


def on_a_disk_made_read_only(directory, numbers, case):
    """Read-only from some moment on; a resume while it is so is refused, later it goes on."""
    directory.mkdir()
    mount("tmpfs", directory, "size=64m")
    try:
        process = start("run", case.scene, "--out", directory / "out", *case.options)
        time.sleep(numbers.uniform(0.0, case.seconds))
        for _ in range(1000):  # busy while a file is open to be written
            with contextlib.suppress(OSError):
                mount("tmpfs", directory, "remount,ro")
                break
        out = end(process)
        require_orderly(*out, (0, 4))
        if (directory / "out").exists() and checkpoints(directory / "out") and out[0] != 0:
            code, text, err = case.resume(directory / "out")
            require(code == 4 and "ead-only" in err, f"resume on a read-only disk: exit {code}: {err}")
        mount("tmpfs", directory, "remount,rw")
        return settle(directory / "out", case) if (directory / "out").exists() else "nothing was written"
    finally:
        unmount(directory)


LIBC = ctypes.CDLL(None, use_errno=True)
MS_RDONLY, MS_REMOUNT = 1, 32


def mount(kind, directory, options):
    words = options.split(",")
    flags = (MS_REMOUNT if "remount" in words else 0) | (MS_RDONLY if "ro" in words else 0)
    data = ",".join(word for word in words if word not in ("remount", "ro", "rw"))
    if LIBC.mount(kind.encode(), os.fsencode(directory), kind.encode(), flags, data.encode()) != 0:
        raise OSError(ctypes.get_errno(), "mount")


def unmount(directory):
    LIBC.umount2(os.fsencode(directory), 2)  # 2: MNT_DETACH


def may_mount(scratch):
    directory = scratch / "mount"
    directory.mkdir()
    try:
        mount("tmpfs", directory, "size=64k")
    except OSError:
        return False
    unmount(directory)
    return True


def not_writable(directory, numbers, case):
    """The directory above, as another user: nothing can be made there."""
    directory.mkdir()
    directory.chmod(0o555)
    options = {"user": 65534} if os.getuid() == 0 else {}
    try:
        code, out, err = case.run(directory / "out", **options)
    except PermissionError:
        return "not tried: only its owner may run the program"
    require(code == 4 and str(directory) in err and "ermission denied" in err, f"exit {code}: {err}")
    return "refused clearly"


# ---------------------------------------------------------------- signals and streams

def signalled(*signals, between=0.0):
    def attempt(directory, numbers, case):
        process = start("run", case.scene, "--out", directory, *case.options)
        time.sleep(numbers.uniform(0.0, case.seconds))
        for one in signals:
            process.send_signal(one)
            time.sleep(between * numbers.random())
        code, out, err = end(process)
        if code in {-one for one in signals} - {-signal.SIGKILL}:  # only before it has made its directory there is nothing to stop in order
            require(not directory.exists() or not list(directory.iterdir()), f"died of signal {-code}, and left a directory")
            shutil.rmtree(directory, ignore_errors=True)
            return "stopped before anything was written"
        require(code in (0, 5) or (code == -signal.SIGKILL and signal.SIGKILL in signals), f"exit {code}: {err}")
        require(code != 5 or ("stopped by SIG" in err and checkpoints(directory)), err)
        return settle(directory, case)

    return attempt


def reader_gone(directory, numbers, case):
    """As with `| head`: standard output is a pipe that nobody reads any more."""
    both = numbers.random() < 0.5  # `2>&1 | head`
    process = start("run", case.scene, "--out", directory, *case.options, **({"stderr": subprocess.STDOUT} if both else {}))
    process.stdout.close()
    err = "" if both else process.stderr.read()
    code = process.wait(LONGEST)
    require(code == 5 and (both or "stopped by SIGPIPE" in err), f"exit {code}: {err}")
    return settle(directory, case)


def no_streams(directory, numbers, case):
    """Standard output and error are closed: no file of the run may become their place."""
    closed = numbers.choice([(1,), (1, 2), (0, 1, 2)])
    code, _, _ = case.run(directory, preexec_fn=lambda: [os.close(one) for one in closed])
    require(code == 0, f"exit {code}")
    return settle(directory, case)


def full_log(directory, numbers, case):
    """Standard output goes to a full disk: the run is worth more than its log, but it says so at the end."""
    with open("/dev/full", "w") as full:
        code, out, err = case.run(directory, stdout=full)
    require(code == 4 and "standard output" in err, f"exit {code}: {err}")
    require((directory / "final.h5").exists(), "the run stopped")
    return settle(directory, case)


def clocks(directory, numbers, case):
    code, out, err = case.run(directory, fault={"CLOCK": numbers.randrange(1, 10**6)})
    require(code == 0, f"exit {code}: {err}")
    return settle(directory, case)


# ---------------------------------------------------------------- damaged, lost and moved files

def stopped_at_random(directory, case, numbers, least=1):
    """A run that was killed when it had so many checkpoints, or fewer where the machine is too quick for that."""
    for attempt in itertools.count(1):
        if attempt % 10 == 0:
            least = max(1, least - 1)
        process = start("run", case.scene, "--out", directory, *case.options)
        while len(checkpoints(directory)) < least and process.poll() is None:
            time.sleep(0.001)
        time.sleep(numbers.uniform(0.0, 0.7 * case.seconds))
        process.kill()
        end(process)
        if len(checkpoints(directory)) >= least and not (directory / "final.h5").exists():
            return
        shutil.rmtree(directory)  # it was over already


def files_by_age(directory):
    files = [path for path in directory.rglob("*.h5") if not path.name.startswith(".")]
    return sorted(files, key=lambda path: path.stat().st_mtime_ns, reverse=True)


def cut(path, numbers):
    """As after a power cut: shorter, or with zeros at the end, or empty."""
    data = left = path.read_bytes()
    while left == data:  # HDF5 files often end with zeros
        length = numbers.choice([0, numbers.randrange(len(data)), numbers.randrange(len(data))])
        left = data[:length] + (b"\0" * (len(data) - length) if numbers.random() < 0.5 else b"")
    path.write_bytes(left)


def flip(path, numbers):
    data = bytearray(path.read_bytes())
    bit = numbers.randrange(8 * len(data))
    data[bit // 8] ^= 1 << bit % 8
    path.write_bytes(data)


def newest_files_cut(directory, numbers, case):
    """The newest one to four files. Where they are the newest checkpoint and newer frames, an older checkpoint serves."""
    stopped_at_random(directory, case, numbers, least=3)
    for path in files_by_age(directory)[: numbers.randrange(1, 5)]:
        cut(path, numbers)
    return settle(directory, case, refusal="cannot be resumed", look_first=False)


def checkpoint_flipped(directory, numbers, case):
    """One bit of the newest checkpoint: it is passed over, unless the bit means nothing."""
    midway_copy(directory, case, numbers)
    flip(checkpoints(directory)[-1], numbers)
    return settle(directory, case, look_first=False)


def checkpoint_cut(directory, numbers, case):
    midway_copy(directory, case, numbers)
    cut(checkpoints(directory)[-1], numbers)
    return settle(directory, case, look_first=False)


def all_checkpoints_cut(directory, numbers, case):
    midway_copy(directory, case, numbers)
    for path in checkpoints(directory):
        cut(path, numbers)
    return settle(directory, case, refusal="cannot be resumed", look_first=False)


def frames_flipped(directory, numbers, case):
    """One bit of a segment: bad frames may not look right, and the run goes on all the same."""
    midway_copy(directory, case, numbers)
    path = numbers.choice([one for one in (directory / "segments").glob("frames-*.h5")])
    flip(path, numbers)
    code, out, err = case.resume(directory)
    require_orderly(code, out, err, (0, 4))
    if code == 4:
        require(matches(err, "are missing or damaged"), err)
        return "refused clearly"
    require(contents(directory / "final.h5") == case.final, "final.h5 differs from the undisturbed run")
    code, out, err = call("export", directory, "--to", "lammps-dump", "--all", "--output", directory / "all.dump")
    require_orderly(code, out, err, (0, 4))
    if code == 4:
        require(not (directory / "all.dump").exists(), "a dump of damaged frames")
        return "resumed bitwise, bad frames are refused when read"
    try:
        found = contents(directory / "run.h5")
    except (OSError, RuntimeError):
        return "resumed bitwise, bad frames are refused when read"
    require_frames(found, case.frames, whole=True)
    return "resumed bitwise"


def midway_copy(directory, case, numbers):
    """A copy of a run stopped midway: one of a few, so that hundreds of cases take no hundreds of runs."""
    if not hasattr(case, "midway"):
        case.midway = []
        for k in range(4):
            stopped = case.directory / f"midway{k}"
            stopped_at_random(stopped, case, random.Random(k), least=3)
            case.midway.append(stopped)
    shutil.copytree(numbers.choice(case.midway), directory)


def lost(*patterns, refusal=None):
    """Files are removed from a run that was killed."""

    def attempt(directory, numbers, case):
        midway_copy(directory, case, numbers)
        found = [path for pattern in patterns for path in directory.glob(pattern)]
        numbers.choice(sorted(found)).unlink()
        return settle(directory, case, refusal=refusal, look_first=False)

    return attempt


def lost_at_the_end(directory, numbers, case):
    """final.h5 or run.h5 of a run that is over is made again by resume."""
    shutil.copytree(case.reference, directory)
    (directory / numbers.choice(["final.h5", "run.h5"])).unlink()
    return settle(directory, case, look_first=False)


def lost_while_running(*names):
    def attempt(directory, numbers, case):
        process = start("run", case.scene, "--out", directory, *case.options)
        while not checkpoints(directory) and process.poll() is None:
            time.sleep(0.001)
        time.sleep(numbers.uniform(0.0, 0.5 * case.seconds))
        name = numbers.choice(names)
        for path in [directory] if name == "." else sorted(directory.glob(name))[-1:]:
            with contextlib.suppress(FileNotFoundError):
                shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()
        code, out, err = end(process)
        require_orderly(code, out, err, (0, 4))
        if code == 0 and (directory / "run.h5").exists():
            require(contents(directory / "final.h5") == case.final, "final.h5 differs from the undisturbed run")
        if not directory.exists():
            return "stopped clearly"
        return settle(directory, case, refusal="are missing or damaged|cannot be read|no checkpoint|No such file", look_first=False)

    return attempt


def moved(directory, numbers, case):
    """Elsewhere, and the scene and its start state are gone."""
    midway_copy(directory, case, numbers)
    elsewhere = directory.parent / "case-moved" / "deeper"
    elsewhere.parent.mkdir()
    directory.rename(elsewhere)
    state, scene = case.directory / "pile.csv", case.directory / "scene.toml"
    kept = [(path, path.read_bytes()) for path in (state, scene)]
    try:
        state.unlink()
        scene.write_text("colour = 1\n")
        return settle(elsewhere, case)
    finally:
        for path, data in kept:
            path.write_bytes(data)


def own_scene_changed(directory, numbers, case):
    """The copy in the run's own directory: another scene must not go on under the name of the first."""
    midway_copy(directory, case, numbers)
    path = directory / "scene.toml"
    path.write_text(path.read_text().replace("9.81", "9.80"))
    return settle(directory, case, refusal="scene.toml", look_first=False, must_refuse=True)


# ---------------------------------------------------------------- two processes

def two_at_once(*verbs):
    def attempt(directory, numbers, case):
        if "run" not in verbs:
            midway_copy(directory, case, numbers)
        words = {"run": ["run", case.scene, "--out", directory], "resume": ["resume", directory]}
        first = start(*words[verbs[0]], *case.options)
        time.sleep(numbers.uniform(0.0, 0.02 if verbs[0] == verbs[1] else 0.3 * case.seconds))
        second = start(*words[verbs[1]], *case.options)
        ends = [end(first), end(second)]
        for one in ends:
            require_orderly(*one, (0, 2, 4))
        require([one[0] for one in ends].count(0) >= 1, f"neither went on: {ends}")
        for code, out, err in ends:
            require(code == 0 or matches(err, f"at work|is not empty|{NO_CHECKPOINT}"), err)
        both = all(code == 0 for code, out, err in ends)
        require(not both or "nothing to resume" in ends[1][1] + ends[0][1], "both went on")
        settle(directory, case)
        return "one went on bitwise, the other was refused" if not both else "one went on bitwise, the other came when it was over"

    return attempt


# ---------------------------------------------------------------- other commands

def outputs(case, directory):
    """Calls that write files, and which; directory/in is a run."""
    out = directory / "out"
    return [("measure", ["measure", directory / "in", "--every", "0.2", "--output", out / "m.h5"]),
            ("csv", ["export", directory / "in", "--to", "csv", "--output", out / "a.csv"]),
            ("vtk", ["export", directory / "in", "--to", "vtk", "--all", "--output", out / "a.pvd"]),
            ("paraview", ["export", directory / "in", "--to", "paraview", "--output", out]),
            ("dump", ["export", directory / "in", "--to", "lammps-dump", "--all", "--output", out / "a.dump"]),
            ("data", ["export", directory / "in", "--to", "lammps-data", "--output", out / "a.data"]),
            ("import", ["import", case.directory / "pile.csv", "--output", out / "a.h5"])]


def files_of(directory):
    return {str(path.relative_to(directory)): contents(path) if path.suffix == ".h5" else path.read_bytes()
            for path in directory.rglob("*") if path.is_file() and not path.name.startswith(".")}


def written_whole(which, **what):
    """A fault at a random file call of a command: what stands under a final name is whole."""

    def attempt(directory, numbers, case):
        directory.mkdir()
        (directory / "in").symlink_to(case.reference)
        (directory / "out").mkdir()
        name, words = outputs(case, directory)[which]
        if not hasattr(case, "outputs"):
            case.outputs = {}
        if name not in case.outputs:
            log = directory / "calls.log"
            code, out, err = call(*words, fault={"DIR": directory / "out", "LOG": log})
            assert code == 0, err
            case.outputs[name] = len(log.read_text().splitlines()), files_of(directory / "out")
            shutil.rmtree(directory / "out")
            (directory / "out").mkdir()
        count, whole = case.outputs[name]
        code, out, err = call(*words, fault={"DIR": directory / "out", "AT": numbers.randrange(1, count + 1), **what})
        require_orderly(code, out, err, (0, 4, -9))
        for path, data in files_of(directory / "out").items():
            require(data == whole[path], f"{name}: {path} is not whole")
        if name == "paraview":
            shutil.rmtree(directory / "out")
        code, out, err = call(*words)
        require(code == 0 and files_of(directory / "out") == whole, f"{name} again: exit {code}: {err}")
        return "whole or not there, and made anew"

    return attempt


STUDY = """
scene = "scene.toml"
start = "pile.csv"
horizon = 0.01
[reference]
method = "uniform"
step = 1e-5
[[method]]
name = "plain"
method = "uniform"
step = [1e-4, 5e-5]
[[method]]
name = "classes"
tolerance = [1e-4, 1e-5]
"""
TIMED = ("wall", "measured", "time", "seconds")  # columns that differ from run to run


def study_rows(directory):
    lines = [line.split(",") for line in (directory / "study.csv").read_text().splitlines()]
    kept = [k for k, name in enumerate(lines[0]) if not any(part in name for part in TIMED)]
    return [[line[k] for k in kept] for line in lines]


def study_killed(directory, numbers, case):
    """The same call again goes on: as if nothing had been."""
    study = case.directory / "study.toml"
    study.write_text(STUDY)
    words = ["study", study, "--no-charts", "--out"]
    if not hasattr(case, "study"):
        begin = time.monotonic()
        code, out, err = call(*words, case.directory / "study")
        assert code == 0, err
        case.study = time.monotonic() - begin, study_rows(case.directory / "study")
    seconds, rows = case.study
    process = start(*words, directory)
    time.sleep(numbers.uniform(0.0, 1.1 * seconds))
    process.kill()
    end(process)
    for path in directory.rglob("[!.]*.h5"):
        contents(path)
    code, out, err = call(*words, directory)
    require(code == 0, f"exit {code}: {err}")
    require(study_rows(directory) == rows, "study.csv differs from the undisturbed study")
    return "went on, the same table"


# ---------------------------------------------------------------- all of them

def make_cases(scratch):
    """steps: 11 steps with a checkpoint and a frame each, whose file calls are the same each time; uniform, multirate,
    silo: some tenths of a second each, with a checkpoint each fiftieth."""
    steps_of = {"uniform": 1e-5, "multirate": 1e-4}
    lasts = {"every": 0.01, "settle": 0.2, "flow": 0.1, "shut": 0.05}
    steps = Case(scratch, "steps", PILE.format(method="uniform", step=1e-4, every=1e-4, settle=2e-4, flow=7e-4, shut=2e-4), often=True)
    steps.all_calls = steps.calls(scratch / "calls", "run", steps.scene, "--out", scratch / "calls", *steps.options)
    return {"steps": steps,
            **{name: Case(scratch, name, PILE.format(method=name, step=step, **lasts), often=False) for name, step in steps_of.items()},
            "silo": Case(scratch, "silo", SILO.format(fill_step=1e-4), often=False)}


def inject(table, cases, is_whole, can_mount):
    """`is_whole`: every fault, often; else some, a few times."""
    def times(most, few):
        return most if is_whole else few

    def mixed(most, few):
        return [cases[name] for name in ("uniform", "multirate", "silo") for _ in range(times(most, few) // 3)]

    def steps(most, few):
        return [cases["steps"]] * times(most, few)

    calls = cases["steps"].all_calls
    every = range(1, len(calls) + 1)
    writes = [k for k in every if "write" in calls[k - 1].split()[1]]
    places = sorted(set(every) - set(writes) | set(writes[::5]))

    def some(numbers, most, few):
        """`most` None: all of them."""
        wanted = times(len(numbers) if most is None else most, few)
        return sorted(random.Random(table.seed).sample(list(numbers), min(wanted, len(numbers))))

    ENOSPC, EIO, EROFS, EDQUOT = errno.ENOSPC, errno.EIO, errno.EROFS, errno.EDQUOT
    table.fault("kill", "kill -9 at a random moment: filling, phases and their changes", mixed(210, 6), killed_at_random)
    table.fault("kill-again", "kill -9 at random moments, and of each resume too, until one ends", mixed(15, 3), killed_again_and_again)
    each_call(table, "kill-call", "kill -9 before each open, truncate, fsync, rename and remove, and each fifth write", cases["steps"], some(places, None, 12), SIGNAL=9)
    each_call(table, "kill-torn", "kill -9 in the middle of a write", cases["steps"], some(writes, 60, 4), SIGNAL=9, TORN=1)
    table.fault("kill-resume", "kill -9 at a random file call of `resume`", steps(100, 3), resume_hurt(SIGNAL=9))

    each_call(table, "full", "disk full from each file call on, room again later", cases["steps"], some(places, 150, 5), ERRNO=ENOSPC)
    each_call(table, "quota", "quota exceeded from a file call on", cases["steps"], some(places, 20, 0), ERRNO=EDQUOT)
    each_call(table, "io", "one file call fails with an input/output error", cases["steps"], some(places, 150, 4), ERRNO=EIO, ONCE=1)
    each_call(table, "read-only", "read-only file system from a file call on", cases["steps"], some(places, 60, 3), ERRNO=EROFS)
    table.fault("full-resume", "disk full from a random file call of `resume` on", steps(40, 2), resume_hurt(ERRNO=ENOSPC))
    table.fault("read-only-resume", "read-only from a random file call of `resume` on", steps(20, 0), resume_hurt(ERRNO=EROFS))
    if can_mount:
        table.fault("full-disk", "a small disk (tmpfs of random size) becomes full, then is enlarged", steps(30, 1), on_a_small_disk)
        table.fault("read-only-disk", "a disk is remounted read-only at a random moment, later writable", mixed(15, 0), on_a_disk_made_read_only)
    table.fault("not-writable", "a directory without the right to write", steps(3, 1), not_writable)

    each_call(table, "term-call", "SIGTERM in the middle of a file call", cases["steps"], some(places, 60, 2), SIGNAL=int(signal.SIGTERM))
    table.fault("term", "SIGTERM at a random moment", mixed(30, 3), signalled(signal.SIGTERM))
    table.fault("int", "SIGINT", mixed(15, 0), signalled(signal.SIGINT))
    table.fault("hup", "SIGHUP", mixed(15, 3), signalled(signal.SIGHUP))
    table.fault("term-twice", "SIGTERM twice", mixed(15, 0), signalled(signal.SIGTERM, signal.SIGTERM, between=0.01))
    table.fault("term-kill", "SIGTERM, and kill -9 soon after", mixed(30, 3), signalled(signal.SIGTERM, signal.SIGKILL, between=0.02))
    table.fault("pipe", "standard output is a pipe that nobody reads (`| head`)", mixed(6, 3), reader_gone)
    table.fault("closed", "standard streams are closed", mixed(9, 3), no_streams)
    table.fault("full-log", "standard output goes to a full disk", mixed(6, 3), full_log)
    table.fault("clock", "every clock jumps by up to an hour at each reading", mixed(15, 3), clocks)

    table.fault("cut", "the newest files (1 to 4) cut or filled with zeros, as by a power cut", mixed(45, 3), newest_files_cut)
    table.fault("cut-checkpoint", "newest checkpoint cut or filled with zeros", mixed(45, 0), checkpoint_cut)
    table.fault("cut-all", "all checkpoints cut", mixed(9, 3), all_checkpoints_cut)
    table.fault("flip", "one bit of the newest checkpoint flipped", mixed(240, 6), checkpoint_flipped)
    table.fault("flip-frames", "one bit of a file of frames flipped", mixed(90, 3), frames_flipped)
    table.fault("lost-index", "run.h5 removed after a kill", mixed(9, 0), lost("run.h5"))
    table.fault("lost-checkpoint", "a checkpoint removed after a kill", mixed(15, 0), lost("checkpoints/*.h5"))
    table.fault("lost-frames", "a file of frames removed after a kill", mixed(15, 3), lost("segments/frames-*.h5", refusal="are missing or damaged"))
    table.fault("lost-start", "segments/start.h5 or scene.toml removed after a kill", mixed(6, 0),
                lost("segments/start.h5", "scene.toml", refusal="start.h5|holds no run"))
    table.fault("lost-end", "final.h5 or run.h5 removed after the end", mixed(6, 3), lost_at_the_end)
    table.fault("lost-running", "run.h5 or a checkpoint removed while running", mixed(15, 3), lost_while_running("run.h5", "checkpoints/*.h5"))
    table.fault("lost-frames-running", "a file of frames removed while running", mixed(15, 3), lost_while_running("segments/frames-*.h5"))
    table.fault("lost-directory-running", "a directory (its own, of segments, of checkpoints) removed while running", mixed(15, 0),
                lost_while_running(".", "segments", "checkpoints"))
    table.fault("moved", "run directory moved; its scene changed and its start state removed outside", mixed(9, 3), moved)
    table.fault("scene-changed", "the copy of the scene in the run's directory changed", mixed(6, 3), own_scene_changed)

    table.fault("two-runs", "two `run` into one directory at once", mixed(15, 3), two_at_once("run", "run"))
    table.fault("run-resume", "`resume` of a run that is at work", mixed(15, 3), two_at_once("run", "resume"))
    table.fault("two-resumes", "two `resume` at once, after a kill", mixed(15, 0), two_at_once("resume", "resume"))

    for which, name in enumerate(("measure", "csv", "vtk", "paraview", "dump", "data", "import")):
        runs = [cases["silo"]] * times(10, name in ("measure", "vtk"))  # with a wall that can be measured
        table.fault(f"kill-{name}", f"kill -9 at a file call of writing: {name}", runs, written_whole(which, SIGNAL=9))
        table.fault(f"full-{name}", f"disk full while writing: {name}", runs, written_whole(which, ERRNO=ENOSPC))
    table.fault("kill-study", "kill -9 of a study at a random moment", steps(15, 1), study_killed)


def fast_directory():
    """In memory if there is room: thousands of runs that flush each file would wait for the disk most of the time."""
    memory = Path("/dev/shm")
    return memory if memory.is_dir() and os.access(memory, os.W_OK) and shutil.disk_usage(memory).free > 2**28 else None


def main():
    parser = argparse.ArgumentParser(description="Injects faults into runs of grainclock.")
    parser.add_argument("--all", action="store_true", help="every fault, often")
    parser.add_argument("--only", nargs="+", help="these kinds of fault")
    parser.add_argument("--seed", type=int, default=1, help="of the random moments")
    parser.add_argument("--table", type=Path, help="file for the table (Markdown)")
    options = parser.parse_args()
    print(f"seed {options.seed}", flush=True)
    with tempfile.TemporaryDirectory(prefix="grainclock-faults-", dir=fast_directory()) as name:
        scratch = Path(name).resolve()
        scratch.chmod(0o755)
        table = Table(scratch, options.only, options.seed)
        cases = make_cases(scratch)
        for case in cases.values():
            print(f"scene {case}: {case.seconds:.2f} s, {case.final['state/id'][0][0]} balls at its end", flush=True)
        inject(table, cases, options.all, may_mount(scratch))
        print("\n" + table.markdown())
        if options.table:
            options.table.write_text(table.markdown() + "\n")
    for failure in table.failures:
        print(f"FAILED {failure}", file=sys.stderr)
    return 1 if table.failures else 0


if __name__ == "__main__":
    sys.exit(main())
