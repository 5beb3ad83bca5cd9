#!/usr/bin/python3
"""Fast tests of benchmarks/peers: parsing, errors, interpolation, turns; the laws of the peers where they are installed."""

import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PEERS = ROOT / "benchmarks" / "peers"
sys.path.insert(0, str(PEERS))

import accuracy  # noqa: E402
import agreement  # noqa: E402
import command  # noqa: E402
import lammps_input  # noqa: E402
import peer_charts  # noqa: E402
import run_grainclock  # noqa: E402
import run_yade  # noqa: E402
import speed  # noqa: E402
import tables  # noqa: E402
from case import read_case  # noqa: E402
from run_lammps import Lammps  # noqa: E402
from run_liggghts import Liggghts  # noqa: E402
from turns import in_turns  # noqa: E402

PROGRAM = os.environ.get("GRAINCLOCK_PROGRAM", "")
# Sums of a few products and logarithms of numbers near 1: errors of a few units of 2.2e-16.
ROUNDING = 1e-13

# Two content balls that close at 0.5 m/s and one that parts from the wall so fast that the clamp acts; one falls free; a
# wall and a plug ball. Overlaps: 1-2 0.01, 3-wall 0.002, 2-plug 0.003. Rows as in a state's CSV, ids with a gap.
BALLS = """id,kind,x,y,z,vx,vy,vz,radius
1,content,0.0,0.0,1.0,0.5,0.0,0.0,0.22
2,content,0.43,0.0,1.0,0.0,0.0,0.0,0.22
3,content,-1.0,0.0,2.0,20.0,0.0,0.0,0.22
5,content,0.0,0.0,5.0,1.0,2.0,-3.0,0.22
7,wall,-1.438,0.0,2.0,0.0,0.0,0.0,0.22
8,plug,0.43,0.0,0.563,0.0,0.0,0.0,0.22
"""


def result(ids, position, seconds=1.0):
    return command.Result(seconds, np.array(ids), np.array(position, float))


class FlatCase:
    """Two balls at rest at the start; the outlet is at z = 0."""
    outlet_z = 0.0

    def start_positions(self):
        return np.array([4, 9, 11]), np.array([[0, 0, 1], [1, 0, 1], [2, 0, 0.1]], float)


def judge():
    """Ball 4 goes 3 m, ball 9 goes 4 m, ball 11 has left: rms displacement sqrt((9 + 16) / 2)."""
    return accuracy.Judge(FlatCase(), result([4, 9, 11], [[3, 0, 1], [1, 4, 1], [2, 0, -7]]))


def fake_point(value, error, seconds, code="LAMMPS", kernels="", method=""):
    """A point whose one ball ends so far from judge()'s reference that its rms error is `error`."""
    shift = error * math.sqrt(12.5)
    run = lambda turn: result([4, 9], [[3, 0, 1 + shift], [1, 4, 1 + shift]], seconds)  # noqa: E731
    return accuracy.Point(code, kernels, method, "step", value, None, run)


class Reading(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = Path(scratch.name)

    def test_loop_time_is_that_of_the_run_with_steps(self):
        log = ("Loop time of 2.5e-07 on 1 procs for 0 steps with 9 atoms\nsetup\n"
               "Loop time of 2.73233 on 2 procs for 800 steps with 26411 atoms\n"
               "Loop time of 1.19e-07 on 2 procs for 0 steps with 26411 atoms\n")
        self.assertEqual(lammps_input.loop_time(log), 2.73233)
        self.assertEqual(lammps_input.loop_time("Loop time of 3.5 on 1 procs for 10 steps with 9 atoms, finish time\n"), 3.5)

    def test_log_without_a_run_is_an_error_that_shows_it(self):
        with self.assertRaisesRegex(command.CommandFailed, "Lost atoms"):
            lammps_input.loop_time("ERROR: Lost atoms\nLoop time of 1 on 1 procs for 0 steps with 9 atoms")

    def test_dump_is_sorted_and_counts_from_0(self):
        path = self.folder / "end.dump"
        path.write_text("\n".join(["head"] * 9 + ["12 1 2 3", "3 4.5 -0.1 0.10000000000000001"]) + "\n")
        ids, columns = lammps_input.read_dump(path)
        self.assertEqual(ids.tolist(), [2, 11])
        self.assertEqual(columns.tolist(), [[4.5, -0.1, 0.1], [1, 2, 3]])

    def test_dump_of_one_ball(self):
        path = self.folder / "end.dump"
        path.write_text("\n".join(["head"] * 9 + ["1 1 2 3"]) + "\n")
        self.assertEqual(lammps_input.read_dump(path)[1].shape, (1, 3))

    def test_median_speed(self):
        self.assertEqual(run_grainclock.median_in("41.0 million ball-steps/s\nmedian 45.1 million ball-steps/s with 9 pairs\n"), 45.1)
        with self.assertRaises(command.CommandFailed):
            run_grainclock.median_in("41.0 million ball-steps/s\n")

    def test_points_are_in_the_programs_order(self):
        plan = {"method": [{"name": "u", "step": [8e-5, 4e-5]}, {"name": "m", "tolerance": [1e-3]}]}
        self.assertEqual(run_grainclock.points_of(plan), [("u", "step", 8e-5), ("u", "step", 4e-5), ("m", "tolerance", 1e-3)])

    def test_failure_shows_the_programs_last_words(self):
        with self.assertRaisesRegex(command.CommandFailed, "out of balls"):
            command.run(["sh", "-c", "echo out of balls; exit 3"], self.folder, "log")
        self.assertEqual((self.folder / "log").read_text(), "out of balls\n")


class Errors(unittest.TestCase):
    def test_by_hand(self):
        errors = judge().errors(result([9, 4], [[1, 4, 1.3], [3.4, 0, 1]]), "x")
        scale = math.sqrt(12.5)
        self.assertAlmostEqual(errors.rms, math.sqrt((0.3**2 + 0.4**2) / 2) / scale, delta=ROUNDING)
        self.assertAlmostEqual(errors.median, 0.35 / scale, delta=ROUNDING)
        self.assertAlmostEqual(errors.p99, (0.3 + 0.99 * 0.1) / scale, delta=ROUNDING)

    def test_balls_that_left_do_not_count_and_need_not_be_there(self):
        self.assertEqual(judge().errors(result([4, 9], [[3, 0, 1], [1, 4, 1]]), "x").rms, 0.0)

    def test_missing_and_lost_balls_are_errors(self):
        with self.assertRaisesRegex(ValueError, "x: 1 balls"):
            judge().errors(result([4, 10], [[3, 0, 1], [1, 4, 1]]), "x")
        with self.assertRaisesRegex(ValueError, "no numbers"):
            judge().errors(result([4, 9], [[3, 0, 1], [math.nan, 4, 1]]), "x")

    def test_distance_of_two_codes_has_the_same_scale(self):
        one, other = result([4, 9], [[3, 0, 1], [1, 4, 1]]), result([9, 4], [[1, 4, 1.1], [3.1, 0, 1]])
        self.assertAlmostEqual(judge().between(one, other), 0.1 / math.sqrt(12.5), delta=ROUNDING)


class Costs(unittest.TestCase):
    def test_interpolated_log_log(self):
        self.assertAlmostEqual(accuracy.cost("c", 1e-3, [(1e-2, 10.0), (1e-4, 1000.0)]).seconds, 100.0, delta=100 * ROUNDING)

    def test_never_reached_is_extrapolated_at_first_order_and_says_so(self):
        far = accuracy.cost("c", 1e-4, [(2e-3, 10.0), (1e-3, 20.0)])
        self.assertAlmostEqual(far.seconds, 200.0, delta=200 * ROUNDING)
        self.assertTrue(far.extrapolated)
        self.assertFalse(accuracy.cost("c", 1e-3, [(2e-3, 10.0), (1e-3, 20.0)]).extrapolated)

    def test_ratios_are_to_the_program_at_the_same_error(self):
        costs = [accuracy.Cost("grainclock multirate default", 1e-3, 1.0), accuracy.Cost("grainclock multirate default", 1e-4, 2.0),
                 accuracy.Cost("grainclock multirate generic", 1e-4, 4.0), accuracy.Cost("LAMMPS", 1e-4, 100.0)]
        self.assertEqual(tables.cost_ratio(costs, costs[3], "default"), 50.0)
        self.assertEqual(tables.cost_ratio(costs, costs[3], "generic"), 25.0)


class Turns(unittest.TestCase):
    def test_another_one_begins_each_round(self):
        order = []
        tasks = {name: lambda turn, n=name: order.append(n) or turn for name in "abc"}
        self.assertEqual(in_turns(tasks, 2), {name: [0, 1] for name in "abc"})
        self.assertEqual("".join(order), "abcbca")

    def test_coarsest_of_all_codes_first_and_no_finer_than_needed(self):
        points = [fake_point(h, e, 1.0, code) for code in ("LAMMPS", "YADE") for h, e in ((4.0, 1e-2), (2.0, 9e-5), (1.0, 1e-5))]
        done = accuracy.measure(points, judge(), 2)
        self.assertEqual([(p.code, p.value, len(p.seconds)) for p in done],
                         [("LAMMPS", 4.0, 2), ("LAMMPS", 2.0, 2), ("YADE", 4.0, 2), ("YADE", 2.0, 2)])
        # Shifts of 1e-5 to a coordinate of 1 keep 11 digits.
        self.assertAlmostEqual(done[1].errors.rms, 9e-5, delta=9e-5 * 1e-10)
        self.assertEqual([p.from_lammps for p in done], [None, None, 0.0, 0.0])

    def test_long_runs_are_repeated_less(self):
        points = [fake_point(h, 1e-2, seconds) for h, seconds in ((3.0, 9.0), (2.0, 29.0), (1.0, 31.0))]
        self.assertEqual([len(p.seconds) for p in accuracy.measure(points, judge(), 3)], [3, 2, 1])

    def test_points_of_a_study_are_always_run_and_repeated(self):
        points = [fake_point(h, 1e-5, 40.0, "grainclock", "default", "m") for h in (2.0, 1.0)]
        self.assertEqual([len(p.seconds) for p in accuracy.measure(points, judge(), 3)], [3, 3])

    def test_best_skin_is_the_fastest(self):
        class Peer:
            def run(self, case, settings, folder):
                return command.Result(abs(settings.skin - 0.02) + 1.0)
        self.assertEqual(speed.best_skin(Peer(), None, 8e-5, 1, (0.01, 0.02, 0.04), None), 0.02)


class Tables(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = Path(scratch.name)
        self.points = accuracy.measure([fake_point(h, e, t, *code) for code in
                                        (("grainclock", "default", "multirate"), ("grainclock", "generic", "multirate"), ("LAMMPS",))
                                        for h, e, t in ((2.0, 2e-3, 1.0), (1.0, 5e-4, 2.0))], judge(), 1)
        self.speeds = [speed.Speed("flow", 1, "grainclock", "default", None, (6e7,)),
                       speed.Speed("rest", 2, "grainclock", "default", None, (2e8,)),
                       speed.Speed("rest", 1, "grainclock", "default", None, (8e7, 9e7, 1e8)),
                       speed.Speed("rest", 1, "LAMMPS", "", 0.02, (6e6, 5e6, 7e6))]

    def test_csv_has_every_row_and_ratios_of_the_same_case(self):
        rows = tables.peers_rows(self.speeds, accuracy.costs(self.points))
        tables.write_csv(self.folder / "peers.csv", rows)
        self.assertEqual(len((self.folder / "peers.csv").read_text().splitlines()), 1 + 4 + 2 * 3)
        self.assertAlmostEqual(rows[3]["grainclock_is_faster"], 15.0, delta=15 * ROUNDING)
        self.assertIsNone(rows[3]["grainclock_generic_is_faster"])

    def test_text_marks_what_is_extrapolated(self):
        text = tables.cost_text(accuracy.costs(self.points))
        self.assertEqual(text.count("10*"), 3)  # 1e-4 is a fifth of the finest error: five times 2 s
        self.assertNotIn("*", text.split("1e-4")[0].split("\n", 2)[2])

    def test_charts_are_drawn(self):
        peer_charts.draw_accuracy(self.points, accuracy.costs(self.points), "title", self.folder / "a.png")
        peer_charts.draw_speeds(self.speeds, "title", self.folder / "b.png")
        self.assertEqual(len(list(self.folder.glob("*.png"))), 2)


@unittest.skipUnless(PROGRAM, "GRAINCLOCK_PROGRAM is not set")
class Laws(unittest.TestCase):
    """The same six balls in every code."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.scratch.cleanup)
        cls.folder = Path(cls.scratch.name)
        cls.build = run_grainclock.Build("default", Path(PROGRAM).resolve().parents[1])
        cls.state = cls.written("start", BALLS)
        scene = ROOT / "silo" / "scenes" / "mini-flow.toml"
        cls.cases = [read_case(name, cls.state, scene, is_open) for name, is_open in (("closed", False), ("open", True))]
        cls.build.export(cls.cases[0], cls.folder)

    @classmethod
    def written(cls, name, text):
        (cls.folder / f"{name}.csv").write_text(text)
        subprocess.run([PROGRAM, "import", cls.folder / f"{name}.csv", "--output", cls.folder / f"{name}.h5"], check=True)
        return cls.folder / f"{name}.h5"

    def test_witness_by_hand(self):
        (ids, force), bound, contacts = agreement.witness(self.cases[0])
        self.assertEqual((ids.tolist(), contacts), ([1, 2, 3, 5], 3))
        # k d + c d' = 1e7 * 0.01 + 2e4 * 0.5 between 1 and 2; 1e9 * 0.003 from the plug; the wall's would pull: 0.
        # Rounding: 1e-16 m in an overlap times 1e9 N/m.
        np.testing.assert_allclose(force, [[-1.1e5, 0, 0], [1.1e5, 0, 3e6], [0, 0, 0], [0, 0, 0]], rtol=0, atol=1e-6)
        eps = 2.0**-52
        np.testing.assert_allclose(bound, [8 * eps * 0.44e7, 8 * eps * 0.44 * 1.01e9, 8 * eps * 0.44e9, 0], rtol=ROUNDING)

    def test_open_outlet_has_no_plug(self):
        force = agreement.witness(self.cases[1])[0][1]
        self.assertEqual(force[1, 2], 0.0)

    def agrees(self, forces_of):
        for case in self.cases:
            other, bound, contacts = agreement.witness(case)
            found = agreement.compared(case, ("it", forces_of(case)), ("numpy", other), bound, contacts)
            self.assertTrue(found.holds(), found)

    def test_program_agrees(self):
        self.agrees(lambda case: self.build.forces(case, self.folder))

    @unittest.skipUnless(shutil.which(Lammps.program), "LAMMPS is not installed")
    def test_lammps_agrees(self):
        self.agrees(lambda case: Lammps().forces(case, self.folder))

    @unittest.skipUnless(shutil.which(Liggghts.program), "LIGGGHTS is not installed")
    def test_liggghts_agrees(self):
        self.agrees(lambda case: Liggghts().forces(case, self.folder))

    @unittest.skipUnless(shutil.which("yade"), "YADE is not installed")
    def test_yade_agrees(self):
        self.agrees(lambda case: run_yade.Yade().forces(case, self.folder))

    @unittest.skipUnless(shutil.which(Lammps.program) and shutil.which("yade"), "LAMMPS or YADE is not installed")
    def test_ends_differ_by_the_steps_error_only(self):
        settings = command.Settings(step=2.0**-18, steps=256, skin=0.02)
        ends = [peer.run(self.cases[0], settings, self.folder, with_end=True) for peer in (Lammps(), run_yade.Yade())]
        self.assertEqual(ends[0].ids.tolist(), ends[1].ids.tolist())
        moved = np.abs(ends[0].position - self.cases[0].start_positions()[1]).max()
        # The same scheme but for velocities that are known half a step apart: C dt with C of the order of the acceleration
        # on the plug, 5e4 m/s2, times the horizon of 1e-3 s, and dt = 3.8e-6 s.
        self.assertLess(np.abs(ends[0].position - ends[1].position).max(), 5e4 * 1e-3 * 3.8e-6)
        self.assertGreater(moved, 1e-3)
        # Ball 5 falls freely: 1.0 * t in x, and leapfrog is exact. Rounding of 256 additions.
        for end in ends:
            self.assertAlmostEqual(end.position[3, 2], 5.0 - 3.0 * 2.0**-10 - 0.5 * 9.81 * 2.0**-20, delta=256 * 1e-15)

    def test_difference_beyond_the_bound_is_seen(self):
        case = self.cases[0]
        (ids, force), bound, contacts = agreement.witness(case)
        for row, shift, holds in ((0, 0.9 * bound[0], True), (0, 1.1 * bound[0], False), (3, 1e-300, False)):
            changed = force.copy()
            changed[row, 1] += shift
            found = agreement.compared(case, ("a", (ids, force)), ("b", (ids, changed)), bound, contacts)
            self.assertEqual(found.holds(), holds)

    def test_lost_ball_is_an_error(self):
        case = self.cases[0]
        (ids, force), bound, contacts = agreement.witness(case)
        with self.assertRaisesRegex(ValueError, "b: forces of 3 balls"):
            agreement.compared(case, ("a", (ids, force)), ("b", (ids[1:], force[1:])), bound, contacts)

    def test_errors_are_the_programs(self):
        reference = self.written("reference", BALLS.replace("0.43,0.0,1.0", "0.63,0.1,1.2").replace("0.0,0.0,5.0", "0.3,0.0,5.4"))
        end = self.written("end", BALLS.replace("0.43,0.0,1.0", "0.63,0.1,1.3").replace("0.0,0.0,5.0", "0.3,0.0,5.45"))
        told = json.loads(subprocess.run([PROGRAM, "compare", end, reference, "--start", self.state, "--json"], check=True,
                                         capture_output=True, text=True).stdout)["position"]
        ends = [read_case("x", path, self.cases[0].scene, False).start_positions() for path in (reference, end)]
        errors = accuracy.Judge(self.cases[0], command.Result(0.0, *ends[0])).errors(command.Result(0.0, *ends[1]), "x")
        for mine, its in ((errors.rms, "rms"), (errors.median, "median"), (errors.p99, "p99")):
            self.assertAlmostEqual(mine, told[its], delta=ROUNDING)

    def test_law_without_counterpart_is_refused(self):
        scene = self.folder / "sticky.toml"
        scene.write_text("[contact]\nk_ball = 1e7\ncohesion = 5.0\n[domain]\noutlet_z = 0.0\n")
        with self.assertRaisesRegex(ValueError, "cohesion"):
            read_case("x", self.state, scene, True)


class Script(unittest.TestCase):
    def test_usage(self):
        done = subprocess.run([PEERS / "run.sh", "--help"], capture_output=True, text=True)
        self.assertEqual((done.returncode, "--quick" in done.stdout), (0, True))
        for wrong in (["--slow"], ["--threads"], ["--threads", "two"], ["--out"]):
            self.assertEqual(subprocess.run([PEERS / "run.sh", *wrong], capture_output=True).returncode, 2)


if __name__ == "__main__":
    unittest.main()
