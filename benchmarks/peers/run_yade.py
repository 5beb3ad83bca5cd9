"""YADE: writes its start and plan, runs yade_script.py in it, reads what that left."""

import json
from pathlib import Path

import numpy as np

from case import EXPORT_DENSITY, GRAVITY
from command import CommandFailed, Result, Settings, run

SCRIPT = Path(__file__).resolve().parent / "yade_script.py"
AT_ONCE = Settings(step=8e-5, steps=0, skin=0.02)  # for the forces at the start, which depend on none of it


class Yade:
    name = "YADE"
    share = 0.2  # of the steps in a timed run: it takes ten times as long for one

    def run(self, case, settings, folder, with_end=False):
        """Steps from the state; `folder` takes all files."""
        ids, end = self.call(case, settings, folder)
        return Result(float(end["seconds"]), *((ids, end["position"]) if with_end else ()))

    def forces(self, case, folder):
        """Ids of the content and the contact forces on it at the start [N]."""
        ids, end = self.call(case, AT_ONCE, folder)
        return ids, end["force"]

    def call(self, case, settings, folder):
        rows = case.present()
        np.savez(folder / "start.npz", position=case.position[rows], velocity=case.velocity[rows], radius=case.radius[rows],
                 moves=case.content()[rows])
        plan = {**case.contact, "density": EXPORT_DENSITY, "gravity": [0.0, 0.0, -GRAVITY], "step": settings.step,
                "steps": settings.steps, "skin": settings.skin}
        (folder / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
        (folder / "end.npz").unlink(missing_ok=True)
        output = run(["yade", "-x", "-n", f"-j{settings.threads}", SCRIPT], folder, "output.txt")
        # YADE ends with 0 when its script fails.
        if not (folder / "end.npz").exists():
            raise CommandFailed(f"YADE's script left no end.npz in {folder}:\n  " + "\n  ".join(output.splitlines()[-8:]))
        return case.ids[case.content()], np.load(folder / "end.npz")
