#!/usr/bin/python3
"""Mutants: small faults put into the program one at a time; a fast test must fail on each.

mutants.toml lists them. `--check` only says whether every mutant's old text occurs exactly once in its file and its test
exists (a fast ctest). Without it a build is brought up to date, and each mutant is compiled beside it: the mutated file goes into
a scratch folder that comes first among the include paths, and the new objects come first where the test program is linked. Tree
and build stay as they are, so that there is nothing to restore, and others may use them meanwhile. Then the expected test runs;
if it passes, all fast tests of that program do.

A mutated header is compiled into the `units` that its test runs through, and if that test passes, into everything that includes
it. Mutated kernels are compiled for the portable instruction set alone, which the program is then bound to.

    tests/mutants/mutants.py --build build [NAME ...] [--readme]
"""
import argparse
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
LONGEST = 1800.0  # s, of a test run: a mutant may loop for ever
PROGRAMS = ["core", "multirate", "silo"]
KERNEL_CHOICE = "core/kernel_choice.cpp"
LIGHT = ["-O1", "-w", "-UGRAINCLOCK_X86"]  # added to the build's own options


def mutants():
    areas = tomllib.loads((HERE / "mutants.toml").read_text())["area"]
    return [{"area": area["name"], **mutant} for area in areas for mutant in area["mutant"]]


# ---- the list

def test_is_there(program, test):
    """Whether the sources of a test program have this test; instances of suites and tests are marked by * and /."""
    suite, _, name = test.partition(".")
    suite, name = suite.split("/")[-1], name.split("/")[0]
    pattern = re.compile(rf"\bTEST(_F|_P)?\({suite},\s*{name}\)")
    return any(pattern.search(path.read_text()) for path in sorted((ROOT / "tests" / program).glob("*.cpp")))


def faults(mutant):
    """What is wrong with an entry of the list."""
    path = ROOT / mutant["file"]
    if not path.is_file():
        return [f"{mutant['file']} is not there"]
    found = []
    times = path.read_text().count(mutant["old"])
    if times != 1:
        found.append(f"the old text occurs {times} times in {mutant['file']}")
    if mutant["old"] == mutant["new"]:
        found.append("old and new text are the same")
    if "equivalent" in mutant:
        return found
    program, _, tests = mutant["test"].partition(" ")
    found += [f"tests/{program} has no {test}" for test in tests.split(":") if not test_is_there(program, test)]
    found += [f"{unit} is not there" for unit in mutant.get("units", []) if not (ROOT / unit).is_file()]
    if mutant["file"].endswith(".hpp") and "units" not in mutant:
        found.append("a header needs units")
    return found


def check(all_mutants):
    names = [m["name"] for m in all_mutants]
    wrong = [f"{name}: the name is used twice" for name in sorted(set(names)) if names.count(name) > 1]
    for mutant in all_mutants:
        wrong += [f"{mutant['name']}: {fault}" for fault in faults(mutant)]
    print("\n".join(wrong) or f"{len(all_mutants)} mutants: every old text is in its place, every test exists")
    return 1 if wrong else 0


# ---- a mutated program beside a build

class Build:
    """Compile and link commands of a finished build with Ninja; nothing in it is changed."""

    def __init__(self, folder, jobs):
        self.folder = folder.resolve()
        if not (self.folder / "build.ninja").is_file():
            subprocess.run(["cmake", "-S", str(ROOT), "-B", str(self.folder), "-G", "Ninja"], check=True)
        targets = [f"test_{program}" for program in PROGRAMS]
        subprocess.run(["cmake", "--build", str(self.folder), "-j", str(jobs), "--target", *targets], check=True)
        entries = json.loads((self.folder / "compile_commands.json").read_text())
        self.compile = {}  # by source; of the kernels the portable ones
        for entry in entries:
            source = os.path.relpath(entry["file"], ROOT)
            command = shlex.split(entry["command"])
            output = command[command.index("-o") + 1]
            if source not in self.compile or "portable" in output:
                self.compile[source] = (command, output)

    def link(self, program):
        """The link command of a test program, without what the build does about it."""
        lines = self.run(["ninja", "-t", "commands", f"tests/test_{program}"]).splitlines()
        last = next(line for line in reversed(lines) if f"-o tests/test_{program}" in line)
        return shlex.split(next(part for part in last.split("&&") if f"-o tests/test_{program}" in part))

    def includers(self, header, program):
        """Sources of a test program and of the libraries that include a header."""
        uses = set()
        for block in self.run(["ninja", "-t", "deps"]).split("\n\n"):
            first, *rest = block.splitlines() or [""]
            if any(line.strip() == str(ROOT / header) for line in rest):
                uses.add(first.split(":")[0])
        linked = ("CMakeFiles/grainclock_", f"tests/CMakeFiles/test_{program}.dir/")
        return sorted(source for source, (_, output) in self.compile.items() if output in uses and output.startswith(linked))

    def run(self, command):
        return subprocess.run(command, cwd=self.folder, check=True, capture_output=True, text=True).stdout


class Mutated:
    """One mutant's files, objects and program, in a scratch folder."""

    def __init__(self, build, mutant, scratch):
        self.build, self.mutant, self.scratch = build, mutant, scratch
        self.overlay = scratch / "overlay"
        target = self.overlay / mutant["file"]
        target.parent.mkdir(parents=True)
        target.write_text((ROOT / mutant["file"]).read_text().replace(mutant["old"], mutant["new"]))
        self.objects = {}  # by source

    def compile(self, source):
        command, output = self.build.compile[source]
        place = self.overlay / source if source == self.mutant["file"] else ROOT / source
        target = self.scratch / (source.replace("/", "_") + ".o")
        # The tree's own folder is among the options; what comes first wins.
        words = command[:command.index("-o")] + LIGHT + ["-o", str(target), "-c", str(place)]
        at = next(k for k, word in enumerate(words) if word.startswith("-I"))
        words.insert(at, f"-I{self.overlay}")
        subprocess.run(words, cwd=self.build.folder, check=True, capture_output=True, text=True)
        self.objects[output] = str(target)

    def program(self, name, units):
        for source in units:
            if self.build.compile[source][1] not in self.objects:
                self.compile(source)
        command = self.build.link(name)
        target = self.scratch / f"test_{name}"
        command[command.index("-o") + 1] = str(target)
        kept = [word for word in command if word not in self.objects]
        first = next(k for k, word in enumerate(kept) if word.endswith(".o") or word.endswith(".a"))
        kept[first:first] = self.objects.values()
        subprocess.run(kept, cwd=self.build.folder, check=True, capture_output=True, text=True)
        return target


def units_of(mutant):
    """Sources that the first attempt compiles."""
    units = list(mutant.get("units", [mutant["file"]]))
    return units + [KERNEL_CHOICE] if "core/kernels.cpp" in units else units


def failed_tests(program, tests, scratch):
    """The tests that fail, or what else tells that something did; empty if all pass. None if no test ran."""
    command = [str(program), f"--gtest_filter={tests}", "--gtest_brief=1"]
    try:
        done = subprocess.run(command, cwd=scratch, capture_output=True, text=True, errors="replace", timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return [f"{tests} (does not end)"]
    if "0 tests from 0 test suites ran" in done.stdout:
        return None
    found = re.findall(r"^\[  FAILED  \] ([\w/]+\.[\w/]+)(?:, where .*)? \(\d+ ms\)$", done.stdout, re.MULTILINE)
    return found or ([f"{tests} (ends with code {done.returncode})"] if done.returncode != 0 else [])


def attempt(build, mutant):
    """Tries to kill one mutant. Returns the tests that do, all in words if none does."""
    name, _, tests = mutant["test"].partition(" ")
    with tempfile.TemporaryDirectory() as folder:
        mutated = Mutated(build, mutant, Path(folder))
        units = units_of(mutant)
        program = mutated.program(name, units)
        killers = failed_tests(program, tests, folder)
        if killers is None:
            return [], f"no test is called {tests}"
        if killers:
            return killers, ""
        if mutant["file"].endswith(".hpp"):
            program = mutated.program(name, units + build.includers(mutant["file"], name))
        killers = failed_tests(program, "-Slow*:SLOW*:*/Slow*", folder)
        return killers, "" if killers else "SURVIVES"


def write_readme(all_mutants, results):
    """The table of mutants; what this pass did not try stays as the file had it."""
    path = HERE / "README.md"
    before = dict(re.findall(r"^\| `([^`]+)` \|.*\| ([^|]*) \|$", path.read_text(), re.MULTILINE)) if path.is_file() else {}
    text = [INTRODUCTION]
    area = None
    for mutant in all_mutants:
        if mutant["area"] != area:
            area = mutant["area"]
            text.append(f"\n## {area}\n\n| mutant | file | what is wrong | killed by |\n| --- | --- | --- | --- |")
        name = mutant["name"]
        its = results.get(name, before.get(name, "not tried"))
        if "equivalent" in mutant:
            its = f"equivalent: {mutant['equivalent']}"
        text.append(f"| `{name}` | {mutant['file']} | {mutant['breaks']} | {its} |")
    path.write_text("\n".join(text) + "\n")


INTRODUCTION = """# Mutants

Faults put into the program on purpose, one at a time, and the fast test that fails on each: a test that no fault can make fail
shows nothing. `mutants.toml` holds the texts, `mutants.py` tries them and writes this file:

    tests/mutants/mutants.py --build build --jobs 4 --readme      # all; or names, or their beginnings

It brings the build up to date, compiles each mutated file beside it, links the test program with it and runs the expected
test, then all fast ones. Some seconds a mutant. The test `mutants` (fast, builds nothing) fails when the text of a mutant or
its test is no longer there."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="mutants to try, by name or its beginning; default: all")
    parser.add_argument("--check", action="store_true", help="look at the list only")
    parser.add_argument("--build", type=Path, default=ROOT / "build", help="a build with Ninja; made if it is not there")
    parser.add_argument("--jobs", type=int, default=1, help="compilers at once while the build is brought up to date")
    parser.add_argument("--readme", action="store_true", help="write README.md from this pass and what it says of other mutants")
    args = parser.parse_args()
    every = mutants()
    wrong = check(every)
    if args.check or wrong:
        return wrong
    chosen = every
    if args.names:
        chosen = [m for m in every if any(m["name"].startswith(name) for name in args.names)]
    build = Build(args.build, args.jobs)
    alive = 0
    results = {}
    for mutant in chosen:
        start = time.monotonic()
        if "equivalent" in mutant:
            print(f"{mutant['name']:34} equivalent: {mutant['equivalent']}", flush=True)
            continue
        try:
            killers, trouble = attempt(build, mutant)
        except subprocess.CalledProcessError as error:
            killers, trouble = [], f"does not compile: {error.stderr.strip().splitlines()[:3]}"
        alive += not killers
        results[mutant["name"]] = ", ".join(killers[:2]) or trouble
        print(f"{mutant['name']:34} {', '.join(killers[:2]) or trouble:74} {time.monotonic() - start:6.0f} s", flush=True)
    print(f"{len(chosen)} mutants, {alive} alive")
    if args.readme:
        write_readme(every, results)
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main())
