#!/usr/bin/python3
"""Slow test of the silo's notebook: the small silo's story run by the program, measured and made a page by notebooks/build.sh.

The program is GRAINCLOCK_PROGRAM (set by CTest).
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import h5py

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOK = ROOT / "notebooks" / "silo_story.ipynb"
sys.path[:0] = [str(ROOT / "notebooks"), str(ROOT / "benchmarks")]
import silo_charts

THEORIES = ("janssen_by_layer", "water_by_layer", "frictionless_by_layer")

class Story(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.directory = Path(scratch.name)
        cls.run_of("story")

    @classmethod
    def run_of(cls, name, phases=None):
        """The small silo's story, or its first phases only."""
        start, *all_phases = (ROOT / "silo" / "scenes" / "mini.toml").read_text(encoding="utf-8").split("[[phase]]")
        scene = cls.directory / f"{name}.toml"
        scene.write_text("[[phase]]".join([start, *all_phases[:phases]]), encoding="utf-8")
        done = subprocess.run([os.environ["GRAINCLOCK_PROGRAM"], "run", scene, "--out", cls.directory / name], capture_output=True, text=True)
        if done.returncode:
            raise AssertionError(f"exit {done.returncode}\n{done.stdout}{done.stderr}")

    def build(self, name, *arguments):
        """The script's result and the page."""
        told = {**os.environ, "JUPYTER_CONFIG_DIR": str(self.directory), "IPYTHONDIR": str(self.directory)}
        done = subprocess.run([ROOT / "notebooks" / "build.sh", self.directory / name, *arguments], capture_output=True, text=True, env=told)
        page = self.directory / (arguments[1] if arguments else name) / "silo_story.html"
        return done, page.read_text(encoding="utf-8") if page.exists() else ""

    def test_whole_story(self):
        out = str(self.directory / "pages")
        done, page = self.build("story", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("frames measured", done.stdout)
        self.assertIn(f"{out}/silo_story.html", done.stdout)
        self.assertEqual(set(re.findall(r'<img alt="(\w+) chart"', page)), set(silo_charts.CHARTS))
        self.assertNotIn("Nothing to tell", page)
        self.assertEqual(page.count("<b>This run</b>"), page.count("<b>The paper</b>"))
        self.assertIn("500 balls, seed 1: fill to 2.0 s, rest to 3.0 s", page)
        # No sentence has a number that was not known.
        self.assertNotRegex(" ".join(re.findall(r"<b>This run</b>(.*?)</div>", page)), r"\bnan\b|\binf\b")

        # Measures that are there and newer than the run are used; what they do not have is not drawn.
        measures = self.directory / "story" / "measures.h5"
        with h5py.File(measures, "a") as file:
            for name in THEORIES:
                self.assertEqual(file["series"][name].shape, file["series/pressure_by_layer"].shape)
                del file["series"][name]
        self.assertIn("Janssen&#x27;s formula", page)
        done, page = self.build("story", "--out", out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("frames measured", done.stdout)
        self.assertNotIn("Janssen&#x27;s formula", page)
        self.assertEqual(set(re.findall(r'<img alt="(\w+) chart"', page)), set(silo_charts.CHARTS))
        # An older file is measured again.
        os.utime(measures, (1, 1))
        done, page = self.build("story")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("frames measured", done.stdout)
        self.assertIn("Janssen&#x27;s formula", page)

    def test_a_run_without_discharge_says_what_is_missing(self):
        self.run_of("closed", phases=2)
        done, page = self.build("closed")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("Nothing to tell: the run has no flow", page)
        self.assertIn("No hammer chart", page)
        self.assertIn('<img alt="density chart"', page)

    def test_stored_without_outputs(self):
        cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
        self.assertEqual([cell["outputs"] for cell in cells if cell["cell_type"] == "code" and cell["outputs"]], [])


if __name__ == "__main__":
    unittest.main()
