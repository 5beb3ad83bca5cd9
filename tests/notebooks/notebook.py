#!/usr/bin/python3
"""Slow test of the notebook: small studies made by the program, and the notebook executed on them as run.sh does.

The program is GRAINCLOCK_PROGRAM (set by CTest).
"""

import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOK = ROOT / "notebooks" / "accuracy_versus_speed.ipynb"

SCENE = """[domain]
outlet_z = -2.0
[initial]
state = "start.csv"
[[phase]]
name = "fall"
duration = 0.02
outlet = "open"
"""
TRAJECTORIES = """scene = "scene.toml"
start = "start.csv"
horizon = 0.02
repeat = 1
[reference]
step = 1e-6
[divergence]
step = 1e-5
horizon = 0.05
samples = 20
[[method]]
name = "plain"
method = "uniform"
events = false
step = [4e-5, 2e-5, 1e-5]
[[method]]
name = "with events"
method = "uniform"
step = [4e-5, 2e-5, 1e-5]
[[method]]
name = "selective"
tolerance = [1e-3, 1e-4, 1e-5]
[[method]]
name = "adams"
method = "cvode"
rtol = [1e-4, 1e-6]
"""
STABILITY = """kind = "stability"
systems = ["pair"]
integrators = ["lagged", "predicted"]
dashpots = ["explicit"]
damping_ratios = [0.0, 0.5]
step_ratios = [0.4, 0.8, 1.2]
steps = 200
"""
STATISTICS = """kind = "statistics"
scene = "scene.toml"
start = ["start.csv", "second.csv"]
duration = 0.1
every = 0.01
stop = 0.05
baseline = "uniform"
[[method]]
name = "uniform"
method = "uniform"
step = 4e-5
[[method]]
name = "selective"
tolerance = 1e-3
"""


def start_state(shift):
    """Eight balls that fall onto a floor of fixed balls; neighbours overlap, the floor does not yet."""
    lines, ball = ["id,kind,x,y,z,vx,vy,vz,radius"], 0
    for x in (0.0, 0.41):
        for y in (0.0, 0.42):
            for z in (0.45, 0.88):
                lines.append(f"{ball},content,{x},{y},{z + 0.003 * ball + shift},{0.1 * x},0.2,-0.5,0.22")
                ball += 1
    for x in (-0.4, 0.0, 0.4, 0.8):
        for y in (-0.4, 0.0, 0.4, 0.8):
            lines.append(f"{ball},wall,{x},{y},{0.05 * x},0,0,0,0.22")
            ball += 1
    return "\n".join(lines) + "\n"


def grainclock(*arguments):
    done = subprocess.run([os.environ["GRAINCLOCK_PROGRAM"], *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        raise AssertionError(f"grainclock {' '.join(map(str, arguments))}: exit {done.returncode}\n{done.stdout}{done.stderr}")


class Notebook(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.directory = Path(scratch.name)
        cls.write("start.csv", start_state(0.0))
        cls.write("second.csv", start_state(0.001))
        cls.write("scene.toml", SCENE)
        for name, text in (("trajectories", TRAJECTORIES), ("stability", STABILITY), ("statistics", STATISTICS)):
            cls.write(f"{name}.toml", text)
            grainclock("study", cls.directory / f"{name}.toml", "--out", cls.directory / name)
        # After 0.02 s the balls have levels but press on nothing; after 0.002 s they press, and uniform steps have no levels.
        grainclock("run", cls.directory / "scene.toml", "--out", cls.directory / "levels", "--set", "stepping.tolerance=1e-4")
        grainclock("run", cls.directory / "scene.toml", "--out", cls.directory / "forces", "--set", "phase.fall.duration=0.002",
                   "--set", 'stepping.method="uniform"')

    @classmethod
    def write(cls, name, text):
        (cls.directory / name).write_text(text, encoding="utf-8")

    def execute(self, studies, run=None):
        """nbconvert as run.sh calls it; returns its result and the page."""
        told = {**os.environ, "GRAINCLOCK_STUDIES": ":".join(str(self.directory / name) for name in studies),
                "GRAINCLOCK_RUN": str(run or ""), "JUPYTER_CONFIG_DIR": str(self.directory), "IPYTHONDIR": str(self.directory)}
        page = self.directory / "report.html"
        page.unlink(missing_ok=True)
        done = subprocess.run([sys.executable, "-B", "-m", "nbconvert", "--to", "html", "--execute", "--no-input", "--output-dir",
                               self.directory, "--output", "report", NOTEBOOK], capture_output=True, text=True, env=told)
        return done, page.read_text(encoding="utf-8") if page.exists() else ""

    def pictures(self, page):
        return re.findall(r'<img alt="(\w+) chart"', page)

    def test_all_kinds_of_studies(self):
        done, page = self.execute(["trajectories", "stability", "statistics"], self.directory / "levels" / "run.h5")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(set(self.pictures(page)), {"overview", "accuracy", "methods", "gains", "tolerance", "divergence", "stability",
                                                    "statistics", "section", "levels"})
        self.assertIn("No forces chart: no ball presses on another", page)
        self.assertIn("<b>selective</b> needs", page)
        self.assertIn("the best of SUNDIALS", page)
        self.assertIn("none of the studies has the table /growth", page)

    def test_one_study_of_trajectories(self):
        done, page = self.execute(["trajectories"], self.directory / "forces" / "run.h5")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.pictures(page).count("accuracy"), 1)
        self.assertIn("none of the studies has the table /stability_map", page)
        self.assertEqual(self.pictures(page)[-2:], ["section", "forces"])

    def test_without_trajectories(self):
        done, page = self.execute(["stability"])
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("there is no gain to state", page)
        self.assertIn("GRAINCLOCK_RUN names no run.h5", page)

    def test_a_cell_that_fails_fails_the_call(self):
        done, page = self.execute(["none"])
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("study.h5", done.stderr)
        self.assertEqual(page, "")


if __name__ == "__main__":
    unittest.main()
