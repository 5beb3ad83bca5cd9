#!/usr/bin/python3
"""Fast tests of benchmarks/charts.py: the numbers behind the charts, and every chart drawn from synthetic studies."""

import importlib.util
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "benchmarks" / "charts.py"
specification = importlib.util.spec_from_file_location("study_charts", SCRIPT)
charts = sys.modules["study_charts"] = importlib.util.module_from_spec(specification)
specification.loader.exec_module(charts)

# Sums of a few logarithms of numbers near 1: errors of a few units of 2.2e-16.
ROUNDING = 1e-13


def row(name, method, error, sweeps, start="a", **more):
    """A row of /study as a current program writes it; wall time is a hundredth of the sweeps."""
    ok = error is not None
    uniform = {"integrator": "predicted", "events": "false", "dashpot": "explicit", "interface": ""}
    sundials = {"integrator": "", "events": "", "dashpot": "", "interface": ""}
    return {"name": name, "method": method, "variant": "", "roots": "", "step": None, "tolerance": None, "levels": 1.0, "rtol": None,
            "error_rms": error, "sweeps": sweeps if ok else None, "contact_evaluations": 1e3 * sweeps if ok else None,
            "wall_s": 0.01 * sweeps if ok else None, "counted_gain": None, "measured_gain": None, "gain_events_counted": None,
            "gain_events_measured": None, "start": start, "status": "ok" if ok else "failed: lost ball 7",
            **(sundials if method in ("cvode", "arkode") else uniform), **more}


def study_rows(start="a", factor=1.0, change=1e-7):
    """Plain: cost 1 / error; events: cost 0.1 / error; multi-rate: a hundredth of plain; CVODE: ten times plain."""
    rows = []
    for error in (1e-2, 1e-3, 1e-4):
        rows.append(row("plain", "uniform", factor * error, 1 / error, start, step=error))
        rows.append(row("events", "uniform", factor * error, 0.1 / error, start, step=error, events="true"))
        rows.append(row("ours", "multirate", factor * error, 0.01 / error, start, step=1e-4, tolerance=error, events="true",
                        interface="accumulate", levels=8.0, counted_gain=100.0, measured_gain=100.0, gain_events_counted=10.0,
                        gain_events_measured=10.0))
        rows.append(row("cvode", "cvode", factor * error, 10 / error, start, rtol=error, variant="adams", roots="false",
                        counted_gain=0.1, measured_gain=0.1, gain_events_counted=0.01, gain_events_measured=0.01))
    rows.append(row("reference", "uniform", None, 0, start, step=1e-6, events="true") | {"status": "ok"})
    rows.append(row("reference_check", "uniform", change, 1e4, start, step=2e-6, events="true"))
    return rows


def study_of(rows, name="scene", **tables):
    return charts.Study(Path("nowhere"), name, {"study": rows, **tables}, {})


def divergence_tables():
    time = np.linspace(0.0, 0.1, 21)
    return {"divergence": [{"start": "a", "time": t, "separation_rms": 1e-12 * math.exp(200 * t), "separation_max": None} for t in time],
            "horizon": [{"start": "a", "rate": 200.0, "trusted_until": None, "floor": 1e-12}]}


def stability_tables():
    place = {"system": "pair", "integrator": "predicted", "dashpot": "explicit"}
    limits = [{**place, "damping_ratio": z, "undamped_critical_step": 1e-4, "theory_limit": 1 - z / 2, "bound": 1 - z / 2,
               "measured_limit": None if z else 1.0} for z in (0.0, 0.5)]
    cells = [{**place, "damping_ratio": z, "step_ratio": r, "growth_per_step": None if z and r > 1 else 2 * r, "theory_growth": 1.0}
             for z in (0.0, 0.5) for r in (0.4, 0.8, 1.2)]
    growth = [{"system": "chain", "ratio": n, "damping_ratio": z, "step": h, "growth_rate": -1.0 if z else n * 1e15 * h**3,
               "exponent": None if z else 3.0} for n in (2.0, 4.0) for z in (0.0, 0.02) for h in (1e-5, 2e-5)]
    return {"stability": limits, "stability_map": cells, "growth": growth}


def statistics_tables():
    runs, summary = [], []
    for method, shift in (("fine", 0.0), ("fast", 1.0)):
        for measure, low in (("discharge_rate", None), ("wall_force", 0.0), ("wall_force", 1.0)):
            place = {"method": method, "measure": measure, "bin": low, "z_low": low, "z_high": None if low is None else low + 1}
            runs += [{**place, "start": s, "value": 60 + shift + n, "unit": "1/s"} for n, s in enumerate("abc")]
            summary.append({**place, "n": 3.0, "mean": 61 + shift, "ci_low": 58.5 + shift, "ci_high": None if low == 0.0 else 63.5 + shift,
                            "difference_low": None, "difference_high": None, "agrees": None if method == "fine" else 1.0,
                            "contact_evaluations": 4e6 - 2e6 * shift, "wall_s": 2.0 - shift})
    return {"statistics": runs, "statistics_summary": summary}


def write_study(directory, tables, plan='scene = "../scene.toml"'):
    """A study.h5 as the program writes it: texts as strings, unknown numbers nan."""
    directory.mkdir(parents=True, exist_ok=True)
    with h5py.File(directory / "study.h5", "w") as file:
        for name, rows in tables.items():
            for column in rows[0]:
                values = [r[column] for r in rows]
                if any(isinstance(v, str) for v in values):
                    file.create_dataset(f"{name}/{column}", data=values, dtype=h5py.string_dtype())
                else:
                    file[f"{name}/{column}"] = np.array([math.nan if v is None else v for v in values], float)
        file["provenance/study"] = plan
    return directory


class Numbers(unittest.TestCase):
    def test_geometric_mean(self):
        self.assertAlmostEqual(charts.geometric_mean([1, 10, 100]), 10, delta=10 * ROUNDING)
        self.assertAlmostEqual(charts.geometric_mean([7.0]), 7.0, delta=7 * ROUNDING)

    def test_short_and_amount(self):
        self.assertEqual([charts.short(x) for x in (1e-4, 2.5e-5, 3e-12)], ["1e-4", "2.5e-5", "3e-12"])
        self.assertEqual([charts.amount(x) for x in (0.01234, 267.4, 12800)], ["0.0123", "267", "12,800"])

    def test_range_is_told_of_several_values_only(self):
        self.assertEqual(charts.with_range([4.0]), "4×")
        self.assertEqual(charts.with_range([2.0, 8.0]), "4× (2 to 8)")

    def test_cost_is_interpolated_log_log(self):
        points = [(1e-2, 10.0), (1e-4, 1000.0)]
        self.assertAlmostEqual(charts.cost_at(1e-3, points), 100.0, delta=100 * ROUNDING)
        self.assertEqual(charts.cost_at(1e-4, points), 1000.0)

    def test_cost_of_loose_errors_is_the_cheapest_points(self):
        self.assertEqual(charts.cost_at(1.0, [(1e-2, 10.0), (1e-4, 1000.0)]), 10.0)

    def test_cost_of_errors_never_reached_is_unknown(self):
        self.assertIsNone(charts.cost_at(9e-5, [(1e-2, 10.0), (1e-4, 1000.0)]))
        self.assertIsNone(charts.cost_at(1.0, []))

    def test_points_that_others_beat_do_not_count(self):
        self.assertAlmostEqual(charts.cost_at(1e-3, [(1e-2, 10.0), (1e-1, 20.0), (1e-4, 1000.0)]), 100.0, delta=100 * ROUNDING)
        self.assertEqual(charts.cost_at(1e-3, [(1e-3, 50.0), (1e-3, 20.0)]), 20.0)

    def test_settings(self):
        self.assertEqual(charts.setting(row("u", "uniform", 1e-3, 1, step=4e-5)), "40 µs")
        self.assertEqual(charts.setting(row("m", "multirate", 1e-3, 1, step=4e-5, tolerance=3e-4)), "tol 3e-4")
        self.assertEqual(charts.setting(row("c", "cvode", 1e-3, 1, rtol=1e-6)), "rtol 1e-6")
        self.assertEqual(charts.setting(row("c", "arkode", 1e-3, 1, rtol=1e-6, variant="mri", step=2e-5)), "20 µs")


class Methods(unittest.TestCase):
    def test_families(self):
        families = {s.label: s.family for s in charts.series_of(study_of(study_rows()))}
        self.assertEqual(families, {"plain": "plain", "events": "events", "ours": "multirate", "cvode": "sundials"})
        self.assertEqual(charts.family(row("l", "uniform", 1, 1, integrator="lagged")), "uniform")
        self.assertEqual(charts.family(row("r", "uniform", 1, 1, dashpot="relaxed", events="true")), "uniform")

    def test_variants_of_one_name_are_told_apart(self):
        rows = study_rows() + [row("cvode", "cvode", 1e-3, 1e5, rtol=1e-3, variant="bdf", roots="true")]
        self.assertEqual({s.label for s in charts.series_of(study_of(rows)) if s.family == "sundials"}, {"cvode adams", "cvode bdf roots"})

    def test_looks_differ(self):
        rows = study_rows() + [row(f"m{n}", "multirate", 1e-3, 10, tolerance=1e-3, events=e, interface=i)
                               for n, (e, i) in enumerate((e, i) for e in ("true", "false") for i in ("accumulate", "frozen"))]
        series = charts.series_of(study_of(rows))
        self.assertEqual(len({(s.family, s.colour, s.marker, s.dashed) for s in series}), len(series))

    def test_points_are_means_over_start_states(self):
        rows = study_rows("a", 0.5) + study_rows("b", 2.0)
        point = next(s for s in charts.series_of(study_of(rows)) if s.label == "ours").points[0]
        self.assertEqual(len(point.rows), 2)
        self.assertAlmostEqual(point.mean("error_rms"), 1e-2, delta=1e-2 * ROUNDING)

    def test_point_that_failed_from_one_start_state_is_left_out(self):
        rows = study_rows("a") + study_rows("b")
        failed = next(r for r in rows if r["start"] == "b" and r["name"] == "plain")
        failed |= row("plain", "uniform", None, 0, "b", step=failed["step"])
        series = charts.series_of(study_of(rows))
        self.assertEqual([len(s.points) for s in series if s.label == "plain"], [2])
        self.assertEqual([len(s.points) for s in series if s.label == "events"], [3])
        self.assertEqual(charts.failures(study_of(rows)), "1 of 28 runs failed in the numerics and are not drawn.")

    def test_infinite_errors_are_not_charted(self):
        rows = study_rows() + [row("wild", "uniform", math.inf, 1, step=1.0)]
        self.assertNotIn("wild", [s.label for s in charts.series_of(study_of(rows))])

    def test_errors_below_ten_times_the_references_change_are_not_trusted(self):
        for change, trusted in ((9e-6, [True, True, True]), (1.1e-5, [True, True, False])):
            series = charts.series_of(study_of(study_rows(change=change)))
            self.assertEqual([p.trusted for p in next(s for s in series if s.label == "ours").points], trusted)

    def test_nothing_is_trusted_without_a_check(self):
        rows = [r for r in study_rows() if r["name"] != "reference_check"]
        self.assertFalse(any(p.trusted for s in charts.series_of(study_of(rows)) for p in s.points))
        self.assertIsNone(charts.headline(study_of(rows)))

    def test_files_of_old_have_fewer_columns(self):
        old = [{k: v for k, v in r.items() if k not in ("variant", "roots", "host", "threads")} for r in study_rows()]
        self.assertEqual(len(charts.series_of(study_of(old))), 4)


class Choices(unittest.TestCase):
    def test_cheapest_method_and_what_sundials_costs_there(self):
        for quantity, cost in (("sweeps", 10.0), ("wall_s", 0.1)):
            found = charts.choice(study_of(study_rows()), 1e-3, quantity)
            self.assertEqual((found.best.label, found.sundials.label), ("ours", "cvode"))
            self.assertAlmostEqual(found.cost, cost, delta=cost * ROUNDING)
            self.assertAlmostEqual(found.sundials_factor, 1000.0, delta=1000 * ROUNDING)

    def test_no_choice_where_nothing_gets_or_nothing_is_known(self):
        self.assertEqual(charts.choice(study_of(study_rows()), 1e-5, "sweeps").why_none, "not reached by any method")
        self.assertEqual(charts.choice(study_of(study_rows(change=2e-4)), 1e-3, "sweeps").why_none, "finer than the reference can judge")

    def test_a_method_counts_only_where_it_gets_from_every_start_state(self):
        rows = study_rows("a") + study_rows("b", 10.0)
        self.assertTrue(charts.choice(study_of(rows), 1e-3, "sweeps").best)
        self.assertIsNone(charts.choice(study_of(rows), 1e-4, "sweeps").best)

    def test_times_of_several_machines_are_not_compared(self):
        rows = [r | {"host": "one" if n % 2 else "two", "threads": "1"} for n, r in enumerate(study_rows())]
        self.assertEqual(charts.choice(study_of(rows), 1e-3, "wall_s").why_none, "timed on several machines")
        self.assertTrue(charts.choice(study_of(rows), 1e-3, "sweeps").best)
        self.assertEqual(charts.headline(study_of(rows)).gains["wall_s", "plain"], [])

    def test_headline_has_a_gain_per_start_state(self):
        # From b everything is as before but twice as far off: costs at equal error double, the gains stay.
        found = charts.headline(study_of(study_rows("a") + study_rows("b", 2.0)), 1e-3)
        self.assertEqual(found.series.label, "ours")
        for kind, gain in (("plain", 100.0), ("events", 10.0), ("sundials", 1000.0)):
            for one in found.gains["sweeps", kind]:
                self.assertAlmostEqual(one, gain, delta=gain * ROUNDING)
            self.assertEqual(len(found.gains["sweeps", kind]), 2)

    def test_headline_is_loosened_to_what_is_reached(self):
        self.assertAlmostEqual(charts.headline(study_of(study_rows("a", 3.0)), 1e-4).error, 3e-4, delta=3e-4 * ROUNDING)


class Promise(unittest.TestCase):
    def test_kept(self):
        promise, = charts.promises([study_of(study_rows("a", 0.5) + study_rows("b", 2.5))])
        self.assertEqual(promise.verdict(), "kept")
        self.assertAlmostEqual(min(promise.ratios), 0.5, delta=ROUNDING)
        self.assertAlmostEqual(max(promise.ratios), 2.5, delta=ROUNDING)

    def test_broken_by_one_start_state(self):
        promise, = charts.promises([study_of(study_rows("a") + study_rows("b", 3.1))])
        self.assertTrue(promise.is_monotone())
        self.assertEqual(promise.verdict(), "not kept")

    def test_errors_below_the_band_are_named(self):
        promise, = charts.promises([study_of(study_rows("a", 0.3))])
        self.assertEqual(promise.verdict(), "more accurate")

    def test_broken_where_not_monotone(self):
        rows = study_rows()
        ours = [r for r in rows if r["name"] == "ours"]
        ours[1]["error_rms"] = 0.99 * ours[2]["error_rms"]
        promise, = charts.promises([study_of(rows)])
        self.assertFalse(promise.is_monotone())
        self.assertEqual(promise.verdict(), "not kept")


class Trust(unittest.TestCase):
    def test_row_per_start_state(self):
        rows = study_rows("a") + study_rows("b", 2.0, change=3e-7)
        first, second = charts.trust(study_of(rows, horizon=[{"start": "a", "rate": 1.0, "trusted_until": 0.5, "floor": 0.0}]))
        self.assertEqual((first.reference, first.change, first.smallest, first.accepted, first.until), ("uniform, 1 µs", 1e-7, 1e-4, "ok", 0.5))
        self.assertEqual((second.change, second.sundials, second.until), (3e-7, 2e-4, None))

    def test_rising_part_leaves_floor_and_ceiling_out(self):
        rising = charts.rising_part(np.array([1e-12, 2e-12, 1e-10, 1e-8, 1e-3, 1e-3]))
        self.assertEqual(list(rising), [False, False, True, True, False, False])


class Files(unittest.TestCase):
    maxDiff = None

    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.directory = Path(self.scratch.name)

    def draw(self, tables, **plan):
        study = write_study(self.directory / "study", tables, **plan)
        done = subprocess.run([sys.executable, "-B", SCRIPT, study, "--out", self.directory / "out"], capture_output=True, text=True)
        return done, {path.name for path in (self.directory / "out").glob("*")}

    def test_cells_come_back(self):
        study = charts.read_study(write_study(self.directory / "study", {"study": study_rows()}))
        self.assertEqual(study.name, "scene")
        self.assertEqual(study.rows("study"), study_rows())

    def test_name_is_the_directorys(self):
        self.assertEqual(charts.read_study(write_study(self.directory / "mine", {"study": study_rows()})).name, "mine")

    def test_name_without_a_scene_is_the_kind(self):
        place = self.directory / "study"
        self.assertEqual(charts.read_study(write_study(place, stability_tables(), 'kind = "stability"')).name, "stability")
        self.assertEqual(charts.read_study(write_study(place, stability_tables(), "no toml")).name, "study")

    def test_newest_of_each_name(self):
        for run in ("old", "new"):
            write_study(self.directory / run / "scene", {"study": study_rows()})
        write_study(self.directory / "new" / "other", {"study": study_rows()})
        os.utime(self.directory / "old" / "scene" / "study.h5", (1, 1))
        self.assertEqual({(s.name, s.path.parent.name) for s in charts.newest_studies(self.directory)}, {("scene", "new"), ("other", "new")})

    def test_every_chart_is_drawn(self):
        done, files = self.draw({"study": study_rows("a") + study_rows("b", 2.0), **divergence_tables(), **stability_tables(),
                                 **statistics_tables()})
        self.assertEqual((done.stderr, done.returncode), ("", 0))
        self.assertEqual(files, {f"{chart.name}.png" for chart in charts.STUDY_CHARTS})
        self.assertEqual(len(done.stdout.splitlines()), len(charts.STUDY_CHARTS))

    def test_missing_tables_are_told_in_a_line_each(self):
        done, files = self.draw({"study": [r for r in study_rows() if r["name"] != "ours"]})
        self.assertEqual((done.stderr, done.returncode), ("", 0))
        self.assertEqual(files, {"accuracy.png", "gains.png", "methods.png"})
        self.assertIn("no divergence chart: the study has no table /divergence", done.stdout)
        self.assertIn("no tolerance chart: ", done.stdout)

    def test_study_where_all_failed_draws_nothing(self):
        done, files = self.draw({"study": [row("plain", "uniform", None, 0, step=1.0)]})
        self.assertEqual((done.returncode, done.stderr, files), (0, "", set()))
        self.assertIn("no accuracy chart: no point of the study has an error", done.stdout)

    def test_missing_file_is_told(self):
        done = subprocess.run([sys.executable, "-B", SCRIPT, self.directory / "none"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("none", done.stderr)
        self.assertIn("give the --out directory of `grainclock study`", done.stderr)


class Pictures(unittest.TestCase):
    def test_pairs_are_those_of_brute_force(self):
        random = np.random.default_rng(1)
        position, radius = random.uniform(0, 2, (200, 3)), random.uniform(0.05, 0.15, 200)
        distance = np.linalg.norm(position[:, None] - position[None], axis=2)
        expected = {(i, j) for i, j in np.argwhere(distance < radius[:, None] + radius[None]) if i < j}
        self.assertGreater(len(expected), 50)
        self.assertEqual({tuple(pair) for pair in charts.pairs_within(position, radius)}, expected)

    def test_a_run_that_has_run_empty_has_no_pictures(self):
        with tempfile.TemporaryDirectory() as scratch:
            path = Path(scratch) / "run.h5"
            with h5py.File(path, "w") as file:
                file["particles/content/position/value"] = np.full((2, 3, 3), np.nan)
                file.create_group("particles/wall")
            with self.assertRaisesRegex(charts.NothingToDraw, "all balls have left"):
                charts.read_flow(path)

    def test_forces_by_hand(self):
        # Overlaps 0.1 (content pair, closing at 2 m/s), 0.05 (content on wall, opening so fast that it would pull).
        frame = charts.Frame(np.array([[0, 0, 0], [0.9, 0, 0], [0, 0, -0.95]]), np.array([[2.0, 0, 0], [0, 0, 0], [0, 0, -9.0]]),
                             np.full(3, 0.5), np.array([0, 0, 1]))
        contact = {"k_ball": 100.0, "c_ball": 5.0, "k_wall": 1000.0, "c_wall": 10.0}
        force = {(i, j): f for i, j, f in zip(*charts.contact_forces(frame, contact))}
        self.assertAlmostEqual(force[0, 1], 20.0, delta=1e-12)  # 100 * 0.1 + 5 * 2; rounding of the overlap times k
        self.assertEqual(force[0, 2], 0.0)
        force = {(i, j): f for i, j, f in zip(*charts.contact_forces(frame, contact | {"tension": True}))}
        self.assertAlmostEqual(force[0, 2], -40.0, delta=1e-11)  # 1000 * 0.05 - 10 * 9


class Notebook(unittest.TestCase):
    def test_stored_without_outputs(self):
        notebook = json.loads((ROOT / "notebooks" / "accuracy_versus_speed.ipynb").read_text(encoding="utf-8"))
        code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
        self.assertTrue(code)
        self.assertTrue(all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code))


if __name__ == "__main__":
    unittest.main()
