#!/usr/bin/python3
"""Test of endurance.py: its rules fire on made-up hours with one fault each, and a few seconds of the small silo go through it.

The program is GRAINCLOCK_PROGRAM (set by CTest).
"""

import csv
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]
import endurance

N, BALLS, FRAMES = 600, 1000, 240


def hour(leak=0.0, taken=None, peak=0.0, descriptors=0.0, threads=0.0, slower=1.0, junk=0.0, share=1.0):
    """Samples of one process. What is given is gained evenly over the hour (`taken`: bytes at once, by the part of it that is over). `share`: of the clock, spent computing."""
    random = np.random.default_rng(1)
    rows = []
    for k in range(N):
        u = k / (N - 1)
        frames = 1 + int(u * (FRAMES - 1))
        writes = random.random() < 0.1  # a file is open, and a buffer held
        steady = 80e6 * (1 - 0.3 * np.exp(-50 * u)) + random.integers(-50, 50) * 4096
        rows.append({"part": "selective", "process": 0, "wall_s": 3600 * u, "cpu_s": 3600 * share * (u if u < 2 / 3 else 2 / 3 + (u - 2 / 3) * slower),
                     "rss": steady + leak * u + sum(size for at, size in (taken or {}).items() if u > at) + 30e6 * writes, "peak": 120e6 + peak * u, "descriptors": 5 + int(descriptors * u) + writes,
                     "threads": 1 + int(threads * u), "bytes": frames * 49 * BALLS * (1 + 0.05 * writes) + junk * u, "frames": frames})
    return rows


def ledger(momentum=0.0, created=0.0, late=0.0, missed=0, gap=0.0):
    """Frames of one run. `created`: of what is dissipated, the share from nowhere; `late`: in the last tenth only."""
    u = np.linspace(0, 1, FRAMES)
    made = 1e6 * (created * u + late * np.maximum(0, u - 0.9))
    time = 60 * u
    time[FRAMES // 2 :] += gap
    zero = np.zeros(FRAMES)
    return {"time": time, "balls": BALLS, "kinetic_energy": 4e4 + zero, "potential_energy": -1e6 * u + made, "elastic_energy": 5e5 + zero,
            "dissipated": 1e6 * u, "first_impact": zero, "removed_energy": zero, "event_work": zero, "switched_energy": zero,
            "momentum_residual": 1e-16 * u + momentum * u, "missed_contacts": np.round(missed * u), "contact_evaluations": 1e9 * u, "discharged": zero}


def broken(rows, series, codes=(endurance.STOPPED,)):
    return {verdict.rule for verdict in endurance.judge("selective", rows, list(codes), 1, series) if verdict.broken}


class Rules(unittest.TestCase):
    def only(self, rule, rows=None, series=None, **others):
        found = broken(rows or hour(), series or ledger(), **others)
        self.assertEqual([name.split(",")[0] for name in found], [rule])

    def test_an_hour_without_fault_breaks_none(self):
        self.assertEqual(broken(hour(), ledger()), set())

    def test_a_leak_of_a_kilobyte_each_second(self):
        self.only("resident memory", hour(leak=3.6e6))

    def test_memory_that_is_given_back_is_no_leak(self):
        self.assertEqual(broken(hour(leak=-20e6), ledger()), set())

    def test_memory_that_is_taken_once_is_no_leak(self):
        self.assertEqual(broken(hour(taken={0.5: 20e6}), ledger()), set())

    def test_memory_that_is_taken_twice_is_no_leak(self):
        self.assertEqual(broken(hour(taken={0.33: 10e6, 0.78: 10e6}), ledger()), set())

    def test_a_growing_peak(self):
        self.only("peak memory", hour(peak=100e6))

    def test_a_descriptor_that_is_never_closed(self):
        self.only("open descriptors between writes", hour(descriptors=2))

    def test_a_thread_more(self):
        self.only("threads", hour(threads=2))

    def test_steps_that_become_slower(self):
        self.only("computing per contact evaluation", hour(slower=2.5))

    def test_an_hour_of_waiting(self):
        self.only("share of the clock not spent computing", hour(share=0.1))

    def test_files_that_nobody_needs(self):
        self.only("bytes of files over those of the frames", hour(junk=5e6))

    def test_momentum_that_is_not_rounding(self):
        self.only("momentum residual", series=ledger(momentum=2e-12))

    def test_energy_from_nowhere_or_lost(self):
        for created in (0.04, -0.04):
            self.only("|created energy| / dissipated", series=ledger(created=created))

    def test_energy_from_nowhere_in_the_end_only(self):
        self.only("|created energy| / dissipated", series=ledger(late=0.15))  # 0.015 of all

    def test_a_missed_contact(self):
        self.only("missed contacts", series=ledger(missed=1))

    def test_a_frame_that_is_missing(self):
        self.only("gaps between frames", series=ledger(gap=0.25))

    def test_not_a_number(self):
        self.only("momentum residual", series=ledger(momentum=float("nan")))

    def test_a_process_that_failed(self):
        self.only("processes that ended neither in order nor by the signal", codes=(endurance.STOPPED, 3))


class Seconds(unittest.TestCase):
    maxDiff = None

    def test_small_silo(self):
        with tempfile.TemporaryDirectory() as scratch:
            out = Path(scratch) / "out"
            done = subprocess.run([sys.executable, "-B", HERE / "endurance.py", "--program", os.environ["GRAINCLOCK_PROGRAM"], "--silo", "mini",
                                   "--minutes", "0.06", "--round", "5", "--out", out], capture_output=True, text=True)
            self.assertEqual(done.stderr, "", done.stdout)
            # Seconds are too short for what is told of memory and speed; the rest holds.
            with open(out / "rules.csv", encoding="utf-8") as file:
                verdicts = {(row["part"], row["rule"]): row["broken"] for row in csv.DictReader(file)}
            for part, processes in (("selective", 4), ("uniform", 2)):
                # A quick machine comes to the end of the phases before all processes have had their turn.
                self.assertIn(f"process 1 of {processes}: exit code {endurance.STOPPED} ", done.stdout)
                self.assertIn(f"process 2 of {processes}: exit code", done.stdout)
                for rule in ("processes that ended neither in order nor by the signal", "momentum residual",
                             "gaps between frames, longest over shortest"):
                    self.assertEqual(verdicts[part, rule], "False", done.stdout)
            with open(out / "samples.csv", encoding="utf-8") as file:
                self.assertGreater(min(int(row["rss"]) for row in csv.DictReader(file)), 1e6)
            self.assertGreater((out / "endurance.png").stat().st_size, 10000)


if __name__ == "__main__":
    unittest.main()
