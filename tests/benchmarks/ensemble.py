#!/usr/bin/python3
"""Fast tests of benchmarks/ensemble: its files, what it runs, keeps, goes on with and says, on a silo of 60 balls.

The program is GRAINCLOCK_PROGRAM (set by CTest).
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
import unittest
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "benchmarks" / "ensemble"
sys.path.insert(0, str(HERE))
import ensemble

# The small silo of silo/scenes/mini.toml with few balls and a tenth of a second of each phase.
SHORT = """
set.silo = { balls = 60 }
set.phase.0 = { duration = 0.2 }
set.phase.1 = { duration = 0.1 }
set.phase.2 = { max_duration = 0.1 }
set.phase.3 = { duration = 0.1 }
set.phase.4 = { max_duration = 0.1 }
"""
FILE = f"""scene = "mini.toml"
seeds = [1, 2]
[variant.rough]
{SHORT}
[variant.one]
seeds = [2]
set.silo.r_min = 0.22
set.silo.r_max = 0.22
""" + SHORT.replace("set.silo = { balls = 60 }", "set.silo.balls = 60")


class Ensemble(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = Path(scratch.name)
        shutil.copy(ROOT / "silo" / "scenes" / "mini.toml", self.directory)
        self.write(FILE)

    def write(self, text):
        (self.directory / "ensemble.toml").write_text(text, encoding="utf-8")

    def command(self, *arguments, program=None, out="out"):
        return [sys.executable, "-B", HERE / "ensemble.py", self.directory / "ensemble.toml", "--out", self.directory / out, "--program",
                program or os.environ["GRAINCLOCK_PROGRAM"], *arguments]

    def call(self, *arguments, **more):
        done = subprocess.run(self.command(*arguments, **more), capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    def positions(self, member, out="out"):
        with h5py.File(self.directory / out / member / "run.h5") as file:
            return file["particles/content/position/value"][:]

    def program_of(self, text):
        """A program of the shell in place of grainclock."""
        path = self.directory / "program"
        path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        path.chmod(0o755)
        return path


class Files(Ensemble):
    def test_members_come_seed_by_seed(self):
        code, text = self.call("--list")
        self.assertEqual((code, text.split()), (0, ["rough/seed-1", "rough/seed-2", "one/seed-2"]))

    def test_settings_are_those_of_the_program(self):
        _, members = ensemble.read_ensemble(self.directory / "ensemble.toml")
        self.assertIn("silo.r_min=0.22", members[2].settings)
        self.assertEqual(ensemble.flat({"a": {"b": {"c": "text", "d": True}}, "e": 1.6e-4}), ['a.b.c="text"', "a.b.d=true", "e=0.00016"])

    def test_wrong_files_and_arguments_are_named(self):
        for file, arguments, told in (
                (FILE + "sets = 1\n", (), "unknown key variant.one.sets"), ("speed = 1\n" + FILE, (), "unknown key speed"),
                ("seeds = [1]\n[variant.a]\n", (), "needs a scene"), ('scene = "none.toml"\nseeds = [1]\n[variant.a]\n', (), "there is no scene"),
                ('scene = "mini.toml"\n[variant.a]\n', (), "variant a: seeds = []"), ('scene = "mini.toml"\nseeds = [1, 1]\n[variant.a]\n', (), "each once"),
                ('scene = "mini.toml"\nseeds = [true]\n[variant.a]\n', (), "whole numbers"), ("scene = \n", (), "line 1"),
                (FILE, ("--member", "one/seed-1"), "there is no member one/seed-1"), (FILE, ("--jobs", "0"), "--jobs from 1"),
                (FILE, ("--program", "none"), "there is no such program")):
            with self.subTest(told):
                self.write(file)
                code, text = self.call(*arguments)
                self.assertEqual(code, 2, text)
                self.assertIn(told, text)

    def test_the_files_of_the_repository(self):
        for file in sorted(HERE.glob("*.toml")):
            scene, members = ensemble.read_ensemble(file)
            for member in {member.variant: member for member in members}.values():
                with self.subTest(file=file.name, variant=member.variant):
                    settings = [part for setting in member.settings for part in ("--set", setting)]
                    done = subprocess.run([os.environ["GRAINCLOCK_PROGRAM"], "check", scene, *settings, "--set", "silo.balls=10"], capture_output=True, text=True)
                    self.assertEqual(done.returncode, 0, done.stderr)

    def test_time_left(self):
        a, b, c = (ensemble.Member(variant, 1, ()) for variant in ("slow", "slow2", "fast"))
        self.assertIsNone(ensemble.time_left([a], {a: 0.0}, {}, 1, 5.0))
        # fast ones take 10 s; of slow2 nothing is known, so it counts as the mean of all, 20 s; a has run for 25 of its 30 s.
        took = {"slow": [30.0], "fast": [10.0, 10.0, 30.0 - 20.0], "other": [40.0]}
        self.assertEqual(ensemble.time_left([a, b, c], {a: 75.0}, took, 1, 100.0), 5.0 + 20.0 + 10.0)
        self.assertEqual(ensemble.time_left([a, b, c], {a: 75.0}, took, 5, 100.0), 20.0)  # no sooner than its longest member


class Runs(Ensemble):
    def test_members_are_run_measured_and_kept(self):
        code, text = self.call("--jobs", "2")
        self.assertEqual(code, 0, text)
        self.assertIn("3 members, 0 of them done before; 2 at a time", text)
        self.assertIn("3 of 3 done", text)
        measures = [self.directory / "out" / member / "measures.h5" for member in ("rough/seed-1", "rough/seed-2", "one/seed-2")]
        times = [path.stat().st_mtime_ns for path in measures]
        with h5py.File(measures[2].with_name("run.h5")) as file:
            self.assertEqual(set(file["particles/content/radius"][:]), {0.22})
        self.assertEqual(tomllib.loads(measures[2].with_name("scene.toml").read_text(encoding="utf-8"))["seed"], 2)
        self.assertFalse(np.array_equal(self.positions("rough/seed-1"), self.positions("rough/seed-2"), equal_nan=True))

        code, text = self.call()
        self.assertEqual(code, 0, text)
        self.assertIn("3 members, 3 of them done before", text)
        self.assertEqual([path.stat().st_mtime_ns for path in measures], times)

        # A run whose measuring was cut off is only measured.
        os.remove(measures[0])
        before = self.positions("rough/seed-1")
        code, text = self.call("--member", "rough/seed-1")
        self.assertEqual(code, 0, text)
        self.assertTrue(measures[0].exists())
        np.testing.assert_array_equal(self.positions("rough/seed-1"), before)

        # Another scene under the same name does not mix with these.
        self.write(FILE.replace("balls = 60", "balls = 61"))
        code, text = self.call()
        self.assertEqual(code, 2, text)
        self.assertIn("was made of another scene or other settings", text)

    def test_a_stopped_member_goes_on_from_its_checkpoint(self):
        # Long enough to be stopped in the middle: a fill of a second.
        self.write('scene = "mini.toml"\nseeds = [1]\n[variant.a]\n' + SHORT.replace("0.2", "1.0"))
        code, text = self.call(out="whole")
        self.assertEqual(code, 0, text)
        process = subprocess.Popen(self.command(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        checkpoints = self.directory / "out" / "a" / "seed-1" / "checkpoints"
        while process.poll() is None and not any(checkpoints.glob("*.h5")):
            time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        text = process.communicate()[0]
        self.assertEqual(process.returncode, 5, text)
        self.assertFalse((checkpoints.parent / "measures.h5").exists())
        code, text = self.call()
        self.assertEqual(code, 0, text)
        self.assertIn("resuming at", (self.directory / "out" / "a" / "seed-1.log").read_text(encoding="utf-8"))
        np.testing.assert_array_equal(self.positions("a/seed-1"), self.positions("a/seed-1", "whole"))

    def test_a_member_that_fails_does_not_stop_the_others(self):
        program = self.program_of('case "$*" in *seed-1*) echo "too hot"; exit 3;; *measure*) touch "$2/measures.h5";; *) mkdir -p "$4";; esac')
        code, text = self.call("--jobs", "1", program=program)
        self.assertEqual(code, 3, text)
        self.assertRegex(text, r"failed: rough/seed-1: exit code 3: too hot \(all of it: .*/out/rough/seed-1.log\)")
        self.assertIn("2 of 3 done", text)
        self.assertTrue((self.directory / "out" / "one" / "seed-2" / "measures.h5").exists())

    @unittest.skipUnless(shutil.which("snakemake"), "Snakemake is not here")
    def test_snakemake_runs_the_same_members(self):
        program = self.program_of(f'echo "$*" >>{self.directory}/calls; case "$1" in measure) touch "$2/measures.h5";; *) mkdir -p "$4";; esac')
        self.call("--jobs", "1", program=program)
        calls = (self.directory / "calls").read_text(encoding="utf-8").replace("/out/", "/snake/")
        (self.directory / "calls").unlink()
        done = subprocess.run(["snakemake", "-s", HERE / "Snakefile", "--cores", "1", "--config", f"ensemble={self.directory}/ensemble.toml",
                               f"out={self.directory}/snake", f"program={program}"], cwd=self.directory, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(sorted((self.directory / "calls").read_text(encoding="utf-8").splitlines()), sorted(calls.splitlines()))


if __name__ == "__main__":
    unittest.main()
