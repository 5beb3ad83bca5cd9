#!/usr/bin/python3
"""grainclock beside LAMMPS, LIGGGHTS and YADE on one state and law; run.sh prepares what it needs and calls it.

    peers.py --default BUILD --generic BUILD --filled STATE --flowing STATE --scene SCENE --study STUDY --out DIR
             [--threads "1 2"] [--quick]
"""

import argparse
import subprocess
import sys
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import accuracy
import agreement
import peer_charts
import speed
import tables
from case import read_case
from command import CommandFailed
from run_grainclock import Build, Study
from run_lammps import Lammps
from run_liggghts import Liggghts
from run_yade import Yade


@dataclass(frozen=True)
class Plan:
    """How much is run."""
    speed_steps: int       # of a timed run
    speed_rounds: int
    skins: tuple           # m, that are tried
    scan_steps: int        # of a run that tries one
    fine_step: float       # s, for which skins are tried once more
    steps: dict            # peer -> steps [s] of the sweep, the coarsest first


FINE_STEPS = (8e-5, 4e-5, 2e-5, 1e-5, 5e-6, 2.5e-6)
FULL = Plan(800, 5, (0.005, 0.01, 0.02, 0.03, 0.045, 0.07), 400, 1e-5,
            {"LAMMPS": FINE_STEPS, "LIGGGHTS": FINE_STEPS, "YADE": FINE_STEPS[:3]})
QUICK = Plan(2000, 2, (0.01, 0.03, 0.06), 1000, 1e-5,
             {"LAMMPS": FINE_STEPS[:5], "LIGGGHTS": FINE_STEPS[:5], "YADE": FINE_STEPS[:2]})


def options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("default", "generic", "filled", "flowing", "scene", "study", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--threads", default="1 2")
    parser.add_argument("--quick", action="store_true")
    return parser.parse_args()


class Comparison:
    """The measures, one after the other, on shared states and folders."""

    def __init__(self, given):
        self.plan = QUICK if given.quick else FULL
        self.out = given.out.resolve()
        self.builds = [Build(tables.OURS, given.default.resolve()), Build(tables.GENERIC, given.generic.resolve())]
        self.peers = [Lammps(), Liggghts(), Yade()]
        self.rest = read_case("rest", given.filled, given.scene, outlet_open=False)
        self.flow = read_case("flow", given.flowing, given.scene, outlet_open=True)
        self.study_file = given.study.resolve()
        self.threads = [int(count) for count in given.threads.split()]
        for case in (self.rest, self.flow):
            for peer in self.peers:
                self.builds[0].export(case, self.folder(case, peer.name))

    def folder(self, case, code):
        """Where a code works on a case."""
        folder = self.out / "work" / f"{case.name}-{code.lower()}"
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def agree(self):
        """Forces at step 0 of all codes."""
        found = [one for case in (self.rest, self.flow)
                 for one in agreement.agreements(case, self.builds[0], self.peers, lambda code, c=case: self.folder(c, code))]
        tables.write_csv(self.out / "agreement.csv", tables.agreement_rows(found))
        print(tables.agreement_text(found), flush=True)
        return all(one.holds() for one in found)

    def best_skin(self, peer, case, step):
        steps = max(1, int(self.plan.scan_steps * peer.share))
        return speed.best_skin(peer, case, step, steps, self.plan.skins, self.folder(case, peer.name))

    def speeds(self):
        """Ball-steps per second; also gives the skins that are best at that step."""
        say("trying skins")
        skins = {(peer.name, case.name): self.best_skin(peer, case, speed.STEP) for peer in self.peers for case in (self.rest, self.flow)}
        say("ball-steps per second")
        found = speed.speeds([self.rest, self.flow], self.builds, self.peers, skins, self.threads, self.plan.speed_steps,
                             self.plan.speed_rounds, self.folder)
        print(tables.speed_text(found), flush=True)
        peer_charts.draw_speeds(found, f"Ball-steps per second, {self.flow.balls():,} balls", self.out / "ball-steps.png")
        return found, skins

    def skin_at(self, peer, skins):
        """The best skin at a step: of two that were tried, that of the nearer step. Slow codes only get the coarse one."""
        coarse = skins[peer.name, self.flow.name]
        fine = self.best_skin(peer, self.flow, self.plan.fine_step) if peer.share == 1.0 else coarse
        return lambda step: coarse if step**2 > speed.STEP * self.plan.fine_step else fine

    def accuracy(self, skins):
        """Errors and clocks of all codes over the horizon."""
        default, generic = (Study(build, self.study_file, self.out / "work" / f"study-{build.name}") for build in self.builds)
        horizon = default.plan["horizon"]
        say("the reference")
        judge = accuracy.Judge(self.flow, default.reference()[0])
        points = accuracy.study_points(default) + accuracy.study_points(generic)
        for peer in self.peers:
            points += accuracy.peer_points(peer, self.flow, self.plan.steps[peer.name], self.skin_at(peer, skins), horizon,
                                           self.folder(self.flow, peer.name))
        say("errors and clocks")
        points = accuracy.measure(points, judge, default.plan["repeat"])
        require_same_errors([p for p in points if p.kernels == tables.OURS], default)
        costs = accuracy.costs(points)
        tables.write_csv(self.out / "accuracy.csv", tables.accuracy_rows(points))
        print(tables.accuracy_text(points, horizon), flush=True)
        print(tables.cost_text(costs), flush=True)
        peer_charts.draw_accuracy(points, costs, f"What accuracy costs: {self.flow.balls():,} balls over {horizon:g} s",
                                  self.out / "accuracy.png")
        return costs


def require_same_errors(points, study):
    """The program's own errors must be the ones that are measured here. Rounding: a few units of 2e-16 in sums of squares."""
    for point, told in zip(points, study.errors()):
        if abs(point.errors.rms / told - 1.0) > 1e-9:
            raise ValueError(f"{point.label()}, {point.value:g}: error {point.errors.rms} here, {told} by the program")


def say(what):
    print(f"\n.. {what}", flush=True)


def versions():
    """Versions of the peers' packages."""
    asked = subprocess.run(["dpkg-query", "-W", "-f=${Package} ${Version}, ", "lammps", "liggghts", "yade"],
                           capture_output=True, text=True)
    return asked.stdout.rstrip(", ")


def main():
    given = options()
    given.out.mkdir(parents=True, exist_ok=True)
    print(f"{date.today()}, peers as Debian builds them for any x86-64: {versions()}")
    comparison = Comparison(given)
    agrees = comparison.agree()
    found, skins = comparison.speeds()
    costs = comparison.accuracy(skins)
    tables.write_csv(given.out / "peers.csv", tables.peers_rows(found, costs))
    print(f"\nwritten to {given.out}: peers.csv agreement.csv accuracy.csv ball-steps.png accuracy.png")
    if not agrees:
        sys.exit("peers.py: forces at step 0 differ by more than rounding, see agreement.csv; the rest compares different laws")


if __name__ == "__main__":
    try:
        main()
    except (CommandFailed, ValueError, OSError) as error:
        sys.exit(f"peers.py: {error}")
