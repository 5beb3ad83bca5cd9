"""grainclock itself: the export that peers start from, its forces at the start, its speed, its jobs of a study."""

import csv
import re
import shutil
import tomllib

import h5py
import numpy as np

from command import CommandFailed, Result, run

FORCE_STEP = 2.0**-13  # s; a power of two, so that dividing by it rounds nothing


class Build:
    """A build of the program. `name` tells its kernels apart: the machine's best, or the generic target's."""

    def __init__(self, name, folder):
        self.name = name
        self.program, self.uniform_speed = (folder / "bin" / file for file in ("grainclock", "uniform_speed"))

    def export(self, case, folder):
        """The state as LAMMPS data, state.data in `folder`."""
        run([self.program, "export", case.state, "--to", "lammps-data", "--output", "state.data"], folder, "export.txt")

    def forces(self, case, folder):
        """Ids of the content and the forces on it at the start [N], as the stepper has them.

        Without gravity a step evaluates its forces with the velocity v + h F/m, which a checkpoint within a phase holds:
        that after the first of two steps.
        """
        out = folder / "one-step"
        shutil.rmtree(out, ignore_errors=True)
        keys = {"initial.state": f'"{case.state}"', "gravity": "[0.0, 0.0, 0.0]", "stepping.method": '"uniform"',
                "stepping.events": "false", "stepping.step": repr(FORCE_STEP),
                "output.every": repr(FORCE_STEP), "phase.0.duration": repr(2 * FORCE_STEP),
                "phase.0.outlet": '"open"' if case.outlet_open else '"closed"'}
        run([self.program, "run", case.scene, "--out", out, "--checkpoint-every", 0,
             *(f"--set={key}={value}" for key, value in keys.items())], folder, "one-step.txt")
        ids, velocity = evaluated_after_one_step(out / "checkpoints")
        rows = np.searchsorted(ids, case.ids[case.content()])
        change = velocity[rows] - case.velocity[case.content()]
        return case.ids[case.content()], change / FORCE_STEP * case.mass()[case.content(), None]

    def speed(self, case, settings, folder):
        """Ball-steps per second of plain uniform steps. The one place that calls uniform_speed."""
        plug = ["--open"] if case.outlet_open else []
        output = run([self.uniform_speed, case.state, "--step", settings.step, "--threads", settings.threads,
                      "--steps", settings.steps, "--repeats", 1, *plug], folder, "speed.txt")
        return 1e6 * median_in(output)


def evaluated_after_one_step(folder):
    """Ids and velocities [m/s] with which the first step evaluated its forces. Raises CommandFailed if no file has them."""
    for path in sorted(folder.glob("*.h5")):
        with h5py.File(path) as file:
            state = file["state"]
            if file["position_in_run/total_steps"][0] == 1 and "evaluated_velocity" in state:
                return state["id"][()], state["evaluated_velocity"][()]
    raise CommandFailed(f"{folder}: no checkpoint after one step with the velocities of its forces")


def median_in(output):
    """Million ball-steps per second in the words of uniform_speed."""
    found = re.search(r"median ([0-9.]+) million ball-steps/s", output)
    if not found:
        raise CommandFailed("uniform_speed printed no median:\n  " + output)
    return float(found[1])


class Study:
    """The jobs of a study of trajectories, one at a time, so that they can take turns with the peers' runs."""

    def __init__(self, build, file, out):
        self.build, self.file, self.out = build, file, out
        out.mkdir(parents=True, exist_ok=True)
        self.plan = tomllib.loads(file.read_text(encoding="utf-8"))
        self.points = points_of(self.plan)
        self.ids = run([build.program, "study", file, "--list"], out, "list.txt").split()
        if len(self.ids) != 2 + self.plan["repeat"] * len(self.points):
            raise ValueError(f"{file}: {len(self.ids)} jobs; here a study has one start, one number of repetitions and no divergence")

    def job(self, place):
        """Runs the job at a place of the list, again if it was run before, and reads its end and clock."""
        path = self.out / "study" / "jobs" / f"{self.ids[place]}.h5"
        path.unlink(missing_ok=True)
        run([self.build.program, "study", self.file, "--out", self.out / "study", "--job", self.ids[place]], self.out, "job.txt")
        with h5py.File(path) as file:
            job = file["job"]
            status = job["status"][()].decode()
            if status != "ok":
                raise CommandFailed(f"{self.ids[place]}: {status}")
            if "state" not in job:
                return Result(float(job["wall_s"][()]))
            return Result(float(job["wall_s"][()]), job["state/id"][()], job["state/position"][()])

    def reference(self):
        """The end that all are measured against, and that at twice the step."""
        return self.job(0), self.job(1)

    def point(self, index, repetition):
        """Repetitions count from 0; only the first tells how the balls ended."""
        return self.job(2 + repetition * len(self.points) + index)

    def errors(self):
        """The program's own errors of all points, in their order, when all jobs are done."""
        run([self.build.program, "study", self.file, "--out", self.out / "study", "--collect", "--no-charts"], self.out, "collect.txt")
        with open(self.out / "study" / "study.csv", encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if not row["name"].startswith("reference")]
        return [float(row["error_rms"]) for row in rows]


def points_of(plan):
    """(method's name, its knob, the knob's value) of each point, in the program's order."""
    points = []
    for method in plan["method"]:
        knob = "tolerance" if "tolerance" in method else "step"
        points += [(method["name"], knob, value) for value in method[knob]]
    return points
