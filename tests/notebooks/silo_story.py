#!/usr/bin/python3
"""Slow test of the silo's notebooks: the small silo's story run by the program, measured and made pages by notebooks/build.sh.

The program is GRAINCLOCK_PROGRAM (set by CTest).
"""

import html
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "notebooks"
sys.path[:0] = [str(NOTEBOOKS), str(ROOT / "benchmarks")]
import dense_charts
import silo_charts
import silo_data

THEORIES = ("janssen_by_layer", "water_by_layer", "frictionless_by_layer")
LARGEST = 2.5e6  # bytes of all stored notebooks
ACCURACY = "accuracy_versus_speed"


def of_one_run():
    """Notebooks that need nothing but a run and its measures."""
    named = {path: set(re.findall(r"GRAINCLOCK_\w+", path.read_text(encoding="utf-8"))) for path in NOTEBOOKS.glob("*.ipynb")}
    return [path for path, names in named.items() if names <= {"GRAINCLOCK_RUN", "GRAINCLOCK_MEASURES"}]


def cells_of(notebook):
    return json.loads(notebook.read_text(encoding="utf-8"))["cells"]


def pictures(page):
    return set(re.findall(r'<img alt="(\w+) chart"', page))


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

    def copy_with(self, *names):
        """A copy of the repository as far as build.sh needs it, with these notebooks only (default: all of them)."""
        copy = Path(tempfile.mkdtemp(dir=self.directory))
        shutil.copytree(NOTEBOOKS, copy / "notebooks", ignore=shutil.ignore_patterns("__pycache__"))
        (copy / "benchmarks").symlink_to(ROOT / "benchmarks")
        for notebook in (copy / "notebooks").glob("*.ipynb"):
            if names and notebook.stem not in names:
                notebook.unlink()
        return copy

    def build(self, copy, name, *arguments):
        """The script's result and {name of page: text}."""
        told = {key: value for key, value in os.environ.items() if not key.startswith("GRAINCLOCK_") or key == "GRAINCLOCK_PROGRAM"}
        told |= {"JUPYTER_CONFIG_DIR": str(self.directory), "IPYTHONDIR": str(self.directory)}
        done = subprocess.run([copy / "notebooks" / "build.sh", self.directory / name, "--out", copy / "pages", *arguments],
                              capture_output=True, text=True, env=told)
        return done, {page.stem: page.read_text(encoding="utf-8") for page in (copy / "pages").glob("*.html")}

    def test_whole_story(self):
        copy = self.copy_with()
        done, pages = self.build(copy, "story", "--store")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f"{copy}/pages/index.html", done.stdout)
        self.assertEqual(set(pages), {path.stem for path in of_one_run()})
        self.assertLessEqual({"index", "arches", "crystals"} | {f"figure{k}" for k in range(3, 10)}, {name.split("_")[0] for name in pages})
        self.assertIn(f"No page of {ACCURACY}.ipynb: GRAINCLOCK_STUDIES is not set", done.stdout)
        # The index links every page that is there, and tells of the others.
        self.assertEqual(set(re.findall(r'href="(\w+)\.html"', pages["index"])) | {"index"}, set(pages))
        self.assertTrue(f'href="{ACCURACY}.ipynb"' in pages["index"])
        text = "".join(page for name, page in pages.items() if name != "between_frames")
        self.assertEqual(pictures(text), set(silo_charts.CHARTS))
        self.assertFalse("Nothing to tell" in text)
        # Its discharge is too short for a spectrum.
        self.assertEqual(pictures(pages["between_frames"]), {name for name in dense_charts.CHARTS if "spectrum" not in name})
        self.assertEqual(pages["between_frames"].count("the discharge is too short for a spectrum"), 3)
        self.assertTrue("500 balls, seed 1: fill to 2.0 s, rest to 3.0 s" in pages["index"])
        for name, page in pages.items():
            with self.subTest(name):
                self.assertTrue("The run: 500 balls in a round silo, seed 1" in page)
                # No sentence has a number that was not known.
                self.assertNotRegex(" ".join(re.findall(r"<td>(.*?)</td>", page)), r"\bnan\b|\binf\b")
                # What is stored is what was executed.
                self.assertTrue("500 balls" in (copy / "notebooks" / f"{name}.ipynb").read_text(encoding="utf-8"))

    def test_measures_are_made_where_they_are_missing_or_old(self):
        measures = self.directory / "story" / "measures.h5"
        measures.unlink(missing_ok=True)
        copy = self.copy_with("figure8_pressures", "arches", "index")
        done, pages = self.build(copy, "story")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("frames measured", done.stdout)
        self.assertTrue("Janssen&#x27;s formula" in pages["figure8_pressures"])
        self.check_bridges()
        # Measures that are there and newer than the run are used; what they do not have is not drawn.
        with h5py.File(measures, "a") as file:
            for name in THEORIES:
                self.assertEqual(file["series"][name].shape, file["series/pressure_by_layer"].shape)
                del file["series"][name]
            del file["bridges"]
        done, pages = self.build(copy, "story")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("frames measured", done.stdout)
        self.assertFalse("Janssen&#x27;s formula" in pages["figure8_pressures"])
        self.assertTrue("No bridges chart: measures of an earlier version" in pages["arches"])
        # An older file is measured again.
        os.utime(measures, (1, 1))
        done, pages = self.build(copy, "story")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("frames measured", done.stdout)
        self.assertTrue("Janssen&#x27;s formula" in pages["figure8_pressures"])
        self.assertEqual(pictures(pages["arches"]), {"bridges", "arches"})

    def check_bridges(self):
        """The bonds of each frame make as many bridges of each size as were counted."""
        story = silo_data.read_story(self.directory / "story")
        found = 0
        for moment in range(len(story.time)):
            sizes = [len(set(bonds.ravel())) for bonds in story.bridges(moment)]
            counts = np.bincount(np.minimum(sizes, 20), minlength=21) if sizes else np.zeros(21, int)
            self.assertEqual(list(counts), [0, 0, 0, 0, *story["bridges_by_size"][moment, 4:].astype(int)], story.time[moment])
            found += len(sizes)
        self.assertGreater(found, 100)  # else next to nothing was compared

    def test_a_run_without_discharge_says_what_is_missing(self):
        self.run_of("closed", phases=2)
        done, pages = self.build(self.copy_with(), "closed")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue("Nothing to tell: the run has no flow" in pages["figure7_meandering"])
        self.assertTrue("No hammer chart" in pages["figure9_history_and_hammer"])
        self.assertIn("density", pictures(pages["figure3_density_and_surface"]))

    def test_stored_outputs(self):
        """Silo notebooks show their figures to who reads them only; they are small, and tell nothing of when and where they were made."""
        self.assertLess(sum(path.stat().st_size for path in NOTEBOOKS.glob("*.ipynb")), LARGEST)
        for path in of_one_run():
            with self.subTest(path.name):
                cells = [cell for cell in cells_of(path) if cell["cell_type"] == "code"]
                outputs = [output for cell in cells for output in cell["outputs"]]
                self.assertEqual({output["output_type"] for output in outputs}, {"display_data"})
                self.assertTrue(any("image/png" in output["data"] for output in outputs))
                self.assertEqual([cell["execution_count"] for cell in cells], list(range(1, len(cells) + 1)))
                self.assertFalse([cell for cell in cells_of(path) if cell["metadata"]])
                texts = [line for output in outputs for kind, lines in output["data"].items() if kind != "image/png" for line in lines]
                self.assertNotRegex(html.unescape("".join(texts)), r"(^|[\s\"'=>])/\w+/")  # no path of a machine


if __name__ == "__main__":
    unittest.main()
