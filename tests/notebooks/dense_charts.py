#!/usr/bin/python3
"""Fast tests of the charts of what lies between frames (notebooks/dense_charts.py), on a run and measures with known contents."""

import sys
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "notebooks"), str(ROOT / "benchmarks")]
import charts
import dense_charts

BEGIN, SHUT, AGAIN, END = 1.0, 41.0, 42.0, 60.0  # s: opened, shut, opened again, over


def write_run(directory, with_flow=True):
    """60 s of records each 0.05 s: a sinking speed that swings by a half about 0.1 m/s, and 6 Hz sideways along x of 2e8 N2/Hz over 0.5 Hz."""
    time = np.arange(0, END + 1e-9, 0.05)
    speed = 0.1 * (1 + 0.5 * np.sin(np.pi * time))
    with h5py.File(directory / "run.h5", "w") as file:
        for name, values in (("patch_pressure", 1e5 + 1e3 * time), ("phase", np.digitize(time, [BEGIN, SHUT, AGAIN])), ("wall_force_by_layer", np.ones((len(time), 2)))):
            file[f"observables/{name}/value"] = values
    with h5py.File(directory / "measures.h5", "w") as file:
        file.create_group("series").attrs["layer_edges"] = [0.0, 1.0, 2.0]
        if not with_flow:
            return
        group = file.create_group("between_frames")
        for name, values in (("time", time), ("energy_per_ball", 0.02 + 0 * time), ("sinking_speed", speed), ("discharge_rate", 60 + 0 * time)):
            group[name] = values
        for k, (name, span) in enumerate((("discharge", (BEGIN, SHUT)), ("emptying", (AGAIN, END)))):
            its = group.create_group(f"open_{k}")
            its.attrs["name"], its.attrs["span"], its.attrs["longest_pause"] = name, span, 0.3
            its["pauses"], its["stoppages"] = [[5.0, 5.3]], np.zeros((0, 2))
            its["energy_beats"], its["speed_beats"] = np.zeros((0, 3)), [[2.5, 0.15, 0.1], [4.5, 0.15, 0.1], [6.5, 0.15, 0.1]]
            frequency = np.arange(0, 10.1, 0.1)
            line = np.where(np.abs(frequency - 6.0) < 0.25, 2e8, 0.0)
            for series, values in (("frequency", frequency), ("lateral_x", line), ("lateral_y", 0 * line), ("lateral_by_layer", np.stack([line, line])),
                                   ("sinking_speed", 1 + line), ("energy", 1 + line)):
                its[f"spectra/{series}"] = values
        hammer = group.create_group("hammer")
        hammer["place"] = [b"0.00 to 1.00 m", b"1.00 to 2.00 m", b"patch", b"wall"]
        hammer["over_rest"] = hammer["over_flow"] = [[1.0, 1.5, SHUT + 0.25, 0.5, 0.4], [1.0, 1.0, SHUT, 0.0, 0.0], [1.0, 1.2, SHUT + 0.1, 0.2, 0.2], [1.0, 1.01, SHUT, 0.0, 0.0]]


class Charts(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = Path(scratch.name)

    def read(self):
        write_run(self.directory)
        return dense_charts.read_dense(self.directory)

    def test_all_are_drawn(self):
        dense = self.read()
        for name, chart in dense_charts.CHARTS.items():
            with self.subTest(name):
                self.assertTrue(charts.figure_of(chart, dense).axes)

    def test_the_hammer_is_between_the_open_phases(self):
        dense = self.read()
        self.assertEqual(dense.flow().name, "discharge")
        shut = dense.time[dense.shut()]
        self.assertAlmostEqual(shut[0], SHUT)
        self.assertAlmostEqual(shut[-1], AGAIN)

    def test_sentences(self):
        dense = self.read()
        rhythm = dense_charts.rhythm_words(dense)
        # The speed swings between 0.5 and 1.5 of a mean over whole periods; a sine deviates by its amplitude over root 2: 35 %.
        for part in ("0 stoppages", "0.30 s", "50 % and 150 %", "35 %", "3 beats", "2.0 s apart"):
            self.assertIn(part, rhythm)
        # Five frequencies of 2e8 N2/Hz, 0.1 Hz apart: 1e8 N2, 10 kN.
        sideways = dense_charts.sideways_words(dense)
        for part in ("10 kN rms", "100 % of its power lie between 4 and 9 Hz", "0.00 % below"):
            self.assertIn(part, sideways)
        hammer = dense_charts.hammer_words(dense)
        self.assertIn("layer 0.00 to 1.00 m: 1.50 of rest, 1.50 of the flow before, 0.25 s after closing, above 1.1 of it for 0.50 s", hammer)
        self.assertFalse("layer 1.00" in hammer)

    def test_runs_without_records_say_so(self):
        write_run(self.directory, with_flow=False)
        with self.assertRaisesRegex(charts.NothingToDraw, "nothing between frames"):
            dense_charts.read_dense(self.directory)


if __name__ == "__main__":
    unittest.main()
