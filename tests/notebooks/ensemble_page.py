#!/usr/bin/python3
"""Slow test of the ensemble's page: the small silo over five seeds, run, measured and made a page by benchmarks/ensemble/run.sh.

The program is GRAINCLOCK_PROGRAM (set by CTest).
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOK = ROOT / "notebooks" / "ensemble.ipynb"
sys.path[:0] = [str(ROOT / "notebooks"), str(ROOT / "benchmarks")]
import ensemble_charts


class Page(unittest.TestCase):
    def build(self, out, *arguments):
        """The script's result and the page."""
        told = {**os.environ, "JUPYTER_CONFIG_DIR": str(out), "IPYTHONDIR": str(out)}
        done = subprocess.run([ROOT / "benchmarks" / "ensemble" / "run.sh", "--out", out, *arguments], capture_output=True, text=True, env=told)
        page = out / "ensemble.html"
        return done, page.read_text(encoding="utf-8") if page.exists() else ""

    def test_small_ensemble(self):
        with tempfile.TemporaryDirectory() as scratch:
            out = Path(scratch)
            done, page = self.build(out, "--quick")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("15 of 15 done", done.stdout)
            drawn = set(re.findall(r'<img alt="(\w+) chart of ([\w-]+)"', page))
            self.assertEqual(drawn, {("pressure", "uniform"), ("time", "uniform"), *((chart, "multirate") for chart in ("time", "layers", "numbers")),
                                     *((chart, "one-radius") for chart in ("time", "layers", "uneven", "numbers"))})
            self.assertEqual({chart for chart, _ in drawn}, set(ensemble_charts.CHARTS))
            self.assertIn("No finished run of smooth", page)
            self.assertIn("pairs of runs that share the filling", page)  # selective steps begin with the uniform ones' heap
            told = re.findall(r"<td>(.*?)</td>|<p>(.*?)</p>", page, re.DOTALL)
            self.assertGreater(len(told), 100)
            self.assertNotRegex(str(told), r"\bnan\b|\binf\b")

            # A page of what is there, with one variant gone and a member missing.
            shutil.rmtree(out / "one-radius")
            (out / "uniform" / "seed-3" / "measures.h5").unlink()
            done, page = self.build(out, "--quick", "--page")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("6 members of the ensemble are not finished", page)
            self.assertIn("No finished run of one-radius", page)

    def test_wrong_arguments(self):
        for arguments, told in ((("--fast",), "unknown option '--fast'"), (("--jobs", "none"), "--jobs takes a number"), (("--out",), "--out takes a directory")):
            done = subprocess.run([ROOT / "benchmarks" / "ensemble" / "run.sh", *arguments], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2)
            self.assertIn(told, done.stderr)

    def test_stored_without_outputs(self):
        cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
        self.assertEqual([cell["outputs"] for cell in cells if cell["cell_type"] == "code" and cell["outputs"]], [])


if __name__ == "__main__":
    unittest.main()
