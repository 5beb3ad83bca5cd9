#!/usr/bin/python3
"""Tests of benchmarks/scale/charts.py on made-up figures."""

import csv
import importlib.util
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[3] / "benchmarks" / "scale" / "charts.py"
spec = importlib.util.spec_from_file_location("scale_charts", SOURCE)
charts = importlib.util.module_from_spec(spec)
spec.loader.exec_module(charts)

SPEED = "repeat,balls,method,threads,steps,step,seconds,ball_updates,contact_evaluations,list_builds,listed\n"


def fill(directory):
    """One size; seconds of 1, 2 and 9 for a thousand updates: the median is 500 a second."""
    (directory / "load.csv").write_text("balls,contacts_per_ball,mean_overlap,kinetic_per_ball\n100,3.2,1e-3,0.1\n")
    head = "balls,fixed,method,threads,read_s,make_s,list_s,list_again_s,state_bytes,reading_bytes,making_bytes,held_bytes,stepping_bytes,process_bytes\n"
    (directory / "memory.csv").write_text(
        head + "".join(f"100,20,{method},1,0.1,0.2,0.05,0.04,70,90,380,280,285,450\n" for method in ("uniform", "multirate")))
    (directory / "limits.csv").write_text(
        "threads,operation_rate,operations_per_ball,operations_per_pair,bytes_per_ball,bytes_per_pair\n1,1000,60,70,300,8\n")
    (directory / "bandwidth.csv").write_text(
        "threads,balls,method,rate\n" + "".join(f"1,100,{m},{r}\n" for m, r in (("MEMCPY", 1), ("MEMCPY", 1), ("DUMB", 3), ("DUMB", 5), ("DUMB", 4))))
    for method in ("uniform", "multirate"):
        (directory / f"speed-{method}.csv").write_text(
            SPEED + "".join(f"{k},100,{method},1,10,1e-4,{s},1000,4000,1,400\n" for k, s in enumerate((1, 2, 9))))


class ScaleCharts(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.directory = Path(self.scratch.name)
        fill(self.directory)

    def test_rates_are_medians_with_their_range(self):
        uniform, multirate = charts.summarise(self.directory)
        self.assertEqual((uniform["method"], multirate["method"]), ("uniform", "multirate"))
        self.assertAlmostEqual(uniform["million_ball_steps_per_s"], 500e-6)
        self.assertAlmostEqual(uniform["ns_per_ball_step"], 2e6)
        self.assertAlmostEqual(uniform["fastest"], 1000e-6)
        self.assertAlmostEqual(uniform["lists_per_1000_steps"], 100.0)

    def test_limits_come_from_counts_and_rates(self):
        uniform = charts.summarise(self.directory)[0]
        # Four listed pairs a ball: 300 + 4 x 8 bytes; the better copy moves 2 x 4 MiB a second.
        self.assertAlmostEqual(uniform["memory_limit"], 1e-6 * 2 * 4 * 1048576 / 332)
        self.assertAlmostEqual(uniform["operation_limit"], 1e-6 * 1000 / (60 + 4 * 70))
        self.assertNotIn("memory_limit", charts.summarise(self.directory)[1])

    def test_leaves_table_and_chart(self):
        rows = charts.summarise(self.directory)
        charts.write(self.directory / "scale.csv", rows)
        charts.draw(rows, self.directory / "scale.png")
        with open(self.directory / "scale.csv", newline="") as file:
            read = list(csv.DictReader(file))
        self.assertEqual([row["balls"] for row in read], ["100", "100"])
        self.assertEqual((self.directory / "scale.png").read_bytes()[:4], b"\x89PNG")


if __name__ == "__main__":
    sys.exit(unittest.main())
