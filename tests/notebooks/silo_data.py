#!/usr/bin/python3
"""Fast tests of what the silo's notebooks read off series (notebooks/silo_data.py), and of the errors of notebooks/build.sh."""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "notebooks"))
import silo_data

ROUNDING = 1e-12  # sums of some hundred numbers near 1


class Phases(unittest.TestCase):
    """Frames every second from phase to phase, and at each phase's end."""

    scene = {"contact": {"k_ball": 1.0}, "phase": [
        {"name": "rest", "duration": 2.0, "every": 1.0, "outlet": "closed"},
        {"name": "discharge", "until": "discharged:0.5", "every": 1.0, "outlet": "open"},
        {"name": "hammer", "duration": 0.5, "every": 0.25, "outlet": "closed", "contact": {"k_ball": 2.0}},
        {"name": "emptying", "until": "empty", "every": 1.0, "outlet": "open"}]}

    def ends(self, time, discharged):
        return [phase.end for phase in silo_data.read_phases(self.scene, np.array(time), np.array(discharged), 100)]

    def test_a_condition_ends_a_phase_at_the_frame_off_its_grid(self):
        # The frame at 4 s has the count already, and the run notices 0.01 s later.
        self.assertEqual(self.ends([0, 1, 2, 3, 4, 4.01, 4.26, 4.51, 5.51, 6.2], [0, 0, 0, 20, 50, 50, 50, 50, 80, 100]), [2, 4.01, 4.51, 6.2])

    def test_or_where_the_count_is_reached_on_the_grid(self):
        self.assertEqual(self.ends([0, 1, 2, 3, 4, 4.25, 4.5, 5.5, 6.5], [0, 0, 0, 20, 50, 50, 50, 80, 100]), [2, 4, 4.5, 6.5])

    def test_a_run_that_records_phases_tells_itself(self):
        time, phase = np.array([0, 1, 2, 3, 4, 4.01, 4.26, 5.26]), np.array([0, 0, 0, 1, 1, 1, 2, 3])
        phases = silo_data.read_phases(self.scene, time, np.zeros(8), 100, phase)
        self.assertEqual([(p.name, p.begin, p.end) for p in phases], [("rest", 0.0, 2), ("discharge", 2, 4.01), ("hammer", 4.01, 4.26), ("emptying", 4.26, 5.26)])

    def test_a_run_that_was_stopped_has_no_later_phases(self):
        self.assertEqual(self.ends([0, 1, 2, 3], [0, 0, 0, 20]), [2, 3])

    def test_phases_have_their_own_contact_law(self):
        phases = silo_data.read_phases(self.scene, np.array([0, 1, 2, 3, 4, 4.25, 4.5]), np.array([0, 0, 0, 20, 50, 50, 50]), 100)
        self.assertEqual([phase.contact["k_ball"] for phase in phases], [1, 1, 2])
        self.assertEqual([phase.is_open for phase in phases], [False, True, False])
        self.assertEqual(list(phases[1].holds(np.array([2.0, 2.5, 4.0, 4.1]))), [False, True, True, False])


class Frames(unittest.TestCase):
    def test_an_observable_between_frames_is_read_at_the_frames(self):
        with h5py.File("none", "w", driver="core", backing_store=False) as file:
            file["particles/content/position/step"] = [0, 10, 25]
            file["observables/dense/step"], file["observables/dense/value"] = [0, 5, 10, 15, 20, 25], [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
            file["observables/frames/step"], file["observables/frames/value"] = [0, 10, 25], [[1, 2], [3, 4], [5, 6]]
            self.assertEqual(list(silo_data.at_frames(file, "dense")), [0.0, 1.0, 2.5])
            self.assertEqual(silo_data.at_frames(file, "frames").tolist(), [[1, 2], [3, 4], [5, 6]])


class Series(unittest.TestCase):
    def test_running_mean_counts_each_sample_with_its_time(self):
        # 0 for two seconds in steps of 1 s, then 1 in steps of 0.1 s: the mean over all is by time, not by samples.
        time = np.concatenate([[0, 1, 2], 2 + 0.1 * np.arange(1, 21)])
        values = (time > 2.05).astype(float)
        middle = np.gradient(time)
        expected = np.sum(middle * values) / np.sum(middle)
        np.testing.assert_allclose(silo_data.running_mean(time, values, width=100.0), expected, rtol=ROUNDING)

    def test_running_mean_leaves_out_what_is_not_known(self):
        found = silo_data.running_mean(np.arange(5.0), np.array([1, np.nan, 1, 1, np.nan]), width=2.0)
        np.testing.assert_allclose(found, 1.0, rtol=ROUNDING)

    def test_spectrum_has_the_variance_and_the_line(self):
        # Eight whole periods under Hann's window: its three lines hold all of the variance 1/2.
        time = 0.25 * np.arange(128)
        frequency, density = silo_data.spectrum(time, np.sin(2 * np.pi * 0.25 * time))
        self.assertEqual(frequency[np.argmax(density)], 0.25)
        self.assertAlmostEqual(np.sum(density) * frequency[1], 0.5, delta=ROUNDING)
        self.assertAlmostEqual(frequency[-1], 2.0, delta=ROUNDING)

    def test_spectrum_of_stretches_keeps_the_variance(self):
        time = np.arange(4096.0)
        values = np.random.default_rng(1).standard_normal(4096)
        frequency, density = silo_data.spectrum(time, values, 7)
        # White noise: the sum over frequencies is its variance, known to 1 / sqrt(4096 / 2) = 2.2 %; five of these, and the mean that
        # each stretch loses (1 in 1024).
        self.assertAlmostEqual(np.sum(density) * frequency[1], 1.0, delta=0.11)

    def test_even_run_is_the_longest_stretch_of_equal_steps(self):
        class Run:
            time = np.array([0, 1, 2, 2.5, 3.0, 3.5, 4.0, 5.0])
        self.assertEqual(list(silo_data.even_run(Run, np.ones(8, bool))), [2, 3, 4, 5, 6])
        self.assertEqual(list(silo_data.even_run(Run, np.array([1, 1, 1, 0, 1, 1, 0, 0], bool))), [0, 1, 2])

    def test_overpressure_lasts_as_straight_lines_between_samples_say(self):
        # The level is 1.1: the line from 1 to 2 is above it for 0.9 of a second, from 2 to 0 for 0.45.
        found = silo_data.overpressure(np.arange(4.0), np.array([1.0, 2.0, 0.0, 0.0]), 1.0)
        self.assertAlmostEqual(found.lasts, 0.9 + 0.45, delta=ROUNDING)
        self.assertEqual((found.highest, found.at), (2.0, 1.0))
        self.assertEqual(silo_data.overpressure(np.arange(3.0), np.ones(3), 1.0).lasts, 0.0)


class Bridges(unittest.TestCase):
    def test_bonds_that_share_balls_are_one_bridge(self):
        bonds = np.array([[1, 9], [2, 9], [3, 7], [2, 4], [5, 7]])
        found = silo_data.connected(bonds)
        self.assertEqual([sorted(map(tuple, bridge)) for bridge in found], [[(1, 9), (2, 4), (2, 9)], [(3, 7), (5, 7)]])
        self.assertEqual(silo_data.connected(bonds[:0]), [])

    def test_beside_a_row_of_two(self):
        """Balls of radius 1; members 0 and 1 at (0, 0, 0) and (2, 0, 0)."""
        place = np.array([[0, 0, 0], [2, 0, 0], [0, 0, 2], [3.9, 0, -3], [4.1, 0, -3], [1, 0, 0.9], [0, 0, 5], [np.nan] * 3])
        above, below = silo_data.beside(place, np.ones(8), np.array([0, 1]), reach=4.0)
        self.assertEqual(list(np.flatnonzero(above)), [2])  # ball 5 is not higher by more than its radius, ball 6 too high
        self.assertEqual(list(np.flatnonzero(below)), [3])  # the shadow of ball 4 overlaps none
        # The nearest member decides: over a high member, under none.
        place[1, 2] = 6.0
        above, below = silo_data.beside(place, np.ones(8), np.array([0, 1]), reach=9.0)
        self.assertEqual((list(np.flatnonzero(above)), list(np.flatnonzero(below))), ([2, 6], [3]))


class Build(unittest.TestCase):
    """Wrong arguments are named and end with 2."""

    def call(self, *arguments):
        done = subprocess.run([ROOT / "notebooks" / "build.sh", *arguments], capture_output=True, text=True,
                              env={**os.environ, "GRAINCLOCK_PROGRAM": "false"})
        return done.returncode, done.stdout + done.stderr

    def test_wrong_arguments(self):
        with tempfile.TemporaryDirectory() as empty:
            for arguments, told in (((empty,), f"there is no {empty}/run.h5"),
                                    ((empty, "--out"), "--out takes a directory"), ((empty, "two"), "one RUN"), (("--fast", empty), "'--fast'"),
                                    ((empty, "--threads", "none"), "--threads takes a number"), ((empty, "--threads"), "--threads takes a number")):
                with self.subTest(arguments):
                    code, text = self.call(*arguments)
                    self.assertEqual(code, 2, text)
                    self.assertIn(told, text)

    def test_the_newest_story_is_taken_where_none_is_named(self):
        with tempfile.TemporaryDirectory() as scratch:
            copy = Path(scratch)
            (copy / "notebooks").mkdir()
            shutil.copy(ROOT / "notebooks" / "build.sh", copy / "notebooks")
            call = lambda *arguments: subprocess.run([copy / "notebooks" / "build.sh", *arguments], capture_output=True, text=True,
                                                     env={**os.environ, "GRAINCLOCK_PROGRAM": "false"})
            done = call()
            self.assertEqual(done.returncode, 2)
            self.assertIn("no RUN named", done.stderr)
            for k, name in enumerate(("story-2", "story-1", "mini-3")):
                (copy / "out" / name).mkdir(parents=True)
                (copy / "out" / name / "run.h5").touch()
                os.utime(copy / "out" / name / "run.h5", (k + 1, k + 1))
            done = call()
            self.assertNotEqual(done.returncode, 0)  # the program is `false`
            self.assertIn(f"Measuring {copy}/out/story-1/run.h5", done.stdout)

    def test_help(self):
        code, text = self.call("--help")
        self.assertEqual(code, 0)
        self.assertIn("notebooks/build.sh RUN --out DIR", text)

    def test_a_run_that_cannot_be_measured_makes_no_page(self):
        with tempfile.TemporaryDirectory() as scratch:
            (Path(scratch) / "run.h5").touch()
            code, _ = self.call(scratch)  # the program is `false`
            self.assertNotEqual(code, 0)
            self.assertEqual([path.name for path in Path(scratch).rglob("*.html")], [])


if __name__ == "__main__":
    unittest.main()
