#!/usr/bin/python3
"""Runs a scene over seeds and variants of its keys, and measures every run.

    ensemble.py ENSEMBLE.toml --out DIR --program GRAINCLOCK [--jobs N]    all members that are not done, N at once (default: all cores)
    ensemble.py ENSEMBLE.toml --out DIR --program GRAINCLOCK --member ID   this one (what the Snakefile beside calls)
    ensemble.py ENSEMBLE.toml --list                                       the members' ids

A member VARIANT/seed-N is a run of one thread in DIR/VARIANT/seed-N and what `grainclock measure` makes of it, measures.h5 there; a log and
what it was made of stand beside. Finished members are kept, stopped ones resumed from their checkpoints. In the file: `scene` (a
path from the file), `seeds`, and a table [variant.NAME] for each variant, with `set` (keys of the scene), `text` (its
name in charts) and, where they differ, `seeds` of its own. Members come seed by seed, so that a part of them is an ensemble too.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import tomllib
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

SAY_EVERY = 60.0  # s
STOPPED = 5       # exit code, as the program's


class WrongInput(Exception):
    """Names the file, what is wrong, and what would be right."""


# ------------------------------------------------------------------ what there is to do

@dataclass(frozen=True)
class Member:
    variant: str
    seed: int
    settings: tuple  # of --set

    @property
    def id(self):
        return f"{self.variant}/seed-{self.seed}"


def flat(table, before=""):
    """key.of.table=value for each value of nested tables; JSON's texts, numbers and truths are TOML's too."""
    return [setting for key, value in table.items()
            for setting in (flat(value, f"{before}{key}.") if isinstance(value, dict) else [f"{before}{key}={json.dumps(value)}"])]


def read_ensemble(path):
    """The scene's path and the members."""
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise WrongInput(f"{path}: cannot be read: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise WrongInput(f"{path}: {error}") from None
    unknown = [*(told.keys() - {"scene", "seeds", "variant"}),
               *(f"variant.{name}.{key}" for name, variant in told.get("variant", {}).items() for key in variant.keys() - {"set", "text", "seeds"})]
    if unknown:
        raise WrongInput(f"{path}: unknown key {unknown[0]}; there are scene, seeds and variant.NAME with set, text and seeds")
    if not told.get("scene") or not told.get("variant"):
        raise WrongInput(f"{path}: needs a scene and at least one [variant.NAME]")
    seeds = {name: variant.get("seeds", told.get("seeds", [])) for name, variant in told["variant"].items()}
    for name, its_seeds in seeds.items():
        if not its_seeds or any(type(seed) is not int or seed < 0 for seed in its_seeds) or len(set(its_seeds)) < len(its_seeds):
            raise WrongInput(f"{path}: variant {name}: seeds = {its_seeds} must be whole numbers from 0, each once")
    scene = path.parent / told["scene"]
    if not scene.is_file():
        raise WrongInput(f"{path}: there is no scene {scene}")
    order = list(dict.fromkeys(seed for its_seeds in seeds.values() for seed in its_seeds))
    return scene, [Member(name, seed, (f"seed={seed}", *flat(variant.get("set", {}))))
                   for seed in order for name, variant in told["variant"].items() if seed in seeds[name]]


# ------------------------------------------------------------------ one member

class Failed(Exception):
    def __init__(self, text, code):
        super().__init__(text)
        self.code = code


class Runner:
    """Runs members; stop() ends all of them, each after a checkpoint."""

    def __init__(self, scene, out, program):
        self.scene, self.out, self.program = scene, out, program
        self.lock, self.running, self.stopped = threading.Lock(), set(), False

    def directory(self, member):
        return self.out / member.id

    def log(self, member):
        return self.out / f"{member.id}.log"

    def is_done(self, member):
        return (self.directory(member) / "measures.h5").exists()

    def check(self, member):
        """What is there of a member must be of this scene and these settings."""
        wanted = json.dumps({"scene": self.scene.read_text(encoding="utf-8"), "settings": member.settings}, indent=1)
        made = self.out / f"{member.id}.json"
        if self.directory(member).exists() and made.exists() and json.loads(made.read_text(encoding="utf-8")) != json.loads(wanted):
            raise WrongInput(f"{self.directory(member)} was made of another scene or other settings; take another --out, or remove it and {made}")
        made.parent.mkdir(parents=True, exist_ok=True)
        aside = made.with_suffix(".part")
        aside.write_text(wanted, encoding="utf-8")
        os.replace(aside, made)

    def command(self, member):
        """The run's command: from its newest checkpoint where there is one."""
        directory = self.directory(member)
        if any((directory / "checkpoints").glob("*")):
            return [self.program, "resume", directory, "--threads", "1"]
        shutil.rmtree(directory, ignore_errors=True)  # stopped before its first checkpoint
        return [self.program, "run", self.scene, "--out", directory, "--threads", "1", *(part for setting in member.settings for part in ("--set", setting))]

    def run(self, member):
        """Seconds that it took."""
        began = time.monotonic()
        self.check(member)
        self.call(member, self.command(member))
        self.call(member, [self.program, "measure", self.directory(member), "--threads", "1"])
        return time.monotonic() - began

    def call(self, member, command):
        with open(self.log(member), "a", encoding="utf-8") as log:
            with self.lock:
                if self.stopped:
                    raise Failed("stopped", STOPPED)
                process = subprocess.Popen([str(part) for part in command], stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT)
                self.running.add(process)
            code = process.wait()
            with self.lock:
                self.running.discard(process)
        if code:
            raise Failed(f"{member.id}: exit code {code}: {self.last_line(member)} (all of it: {self.log(member)})", code if code > 0 else STOPPED)

    def last_line(self, member):
        log = self.log(member)
        lines = log.read_text(encoding="utf-8", errors="replace").split("\n") if log.exists() else []
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")

    def stop(self):
        with self.lock:
            self.stopped = True
            for process in self.running:
                process.terminate()


# ------------------------------------------------------------------ all members

def clock(seconds):
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def time_left(todo, began, took, jobs, now):
    """s, or None while no member is done. `began`: when the running ones began; `took`: seconds of those that are done, by variant."""
    every = [seconds for its_seconds in took.values() for seconds in its_seconds]
    if not every:
        return None
    expected = lambda member: sum(its) / len(its) if (its := took.get(member.variant)) else sum(every) / len(every)
    left = [max(0.0, expected(member) - (now - began[member] if member in began else 0.0)) for member in todo]
    return max(sum(left) / jobs, max(left, default=0.0))


class Story:
    """What is said while members run."""

    def __init__(self, runner, todo, jobs, done):
        self.runner, self.todo, self.jobs = runner, list(todo), jobs
        self.done, self.all = done, done + len(todo)
        self.began, self.took = {}, {}
        print(f"{self.all} members, {done} of them done before; {jobs} at a time", flush=True)

    def note_begin(self, member):
        self.began[member] = time.monotonic()

    def note_end(self, member, seconds):
        self.todo.remove(member)
        del self.began[member]
        if seconds is not None:
            self.done += 1
            self.took.setdefault(member.variant, []).append(seconds)

    def say(self, what):
        left = time_left(self.todo, self.began, self.took, self.jobs, time.monotonic())
        about = f", about {clock(left)} left" if left and self.todo else ""
        print(f"{what}; {self.done} of {self.all} done{about}", flush=True)

    def say_running(self):
        self.say(", ".join(f"{member.id}: {self.runner.last_line(member)}" for member in list(self.began)))


def run_all(runner, members, jobs):
    """Exit code. A member that fails does not keep the others from running."""
    for member in members:
        runner.check(member)
    todo = [member for member in members if not runner.is_done(member)]
    jobs = max(1, min(jobs, len(todo)))
    story, failures = Story(runner, todo, jobs, len(members) - len(todo)), []

    def run(member):
        story.note_begin(member)
        return runner.run(member)

    with ThreadPoolExecutor(jobs) as pool:
        try:
            futures = {pool.submit(run, member): member for member in todo}
            waiting = set(futures)
            while waiting:
                ended, waiting = wait(waiting, SAY_EVERY, FIRST_COMPLETED)
                for future in ended:
                    member, error = futures[future], future.exception()
                    if error and not isinstance(error, Failed):
                        raise error
                    story.note_end(member, None if error else future.result())
                    failures += [error] if error else []
                    story.say(f"failed: {error}" if error else f"{member.id} done in {clock(future.result())}")
                if not ended:
                    story.say_running()
        except BaseException:  # also a signal: what runs goes on from its checkpoint next time
            for future in futures:
                future.cancel()
            runner.stop()
            raise
    return failures[0].code if failures else 0


def interrupt(*_):
    raise KeyboardInterrupt


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("ensemble", type=Path, help="file (TOML) with scene, seeds and variants")
    parser.add_argument("--out", type=Path, help="directory of the runs: new, or that of an ensemble to go on with")
    parser.add_argument("--program", help="grainclock")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="members at once (default: %(default)s, all cores)")
    parser.add_argument("--member", metavar="ID", help="run this one only")
    parser.add_argument("--list", action="store_true", help="print the members' ids and run nothing")
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, interrupt)
    try:
        scene, members = read_ensemble(given.ensemble)
        if given.list:
            print("\n".join(member.id for member in members))
            return 0
        if not given.out or not given.program or given.jobs < 1:
            raise WrongInput("needs --out DIR and --program GRAINCLOCK, and --jobs from 1")
        program = shutil.which(given.program)
        if not program:
            raise WrongInput(f"--program {given.program}: there is no such program")
        given.out.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(given.ensemble, given.out / "ensemble.toml")  # for the page: variants in order, and their texts
        runner = Runner(scene, given.out, program)
        if given.member is None:
            return run_all(runner, members, given.jobs)
        chosen = [member for member in members if member.id == given.member]
        if not chosen:
            raise WrongInput(f"there is no member {given.member}; --list prints them")
        return run_all(runner, chosen, 1)
    except WrongInput as error:
        print(f"ensemble.py: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped; the same command goes on", file=sys.stderr)
        return STOPPED


if __name__ == "__main__":
    sys.exit(main())
