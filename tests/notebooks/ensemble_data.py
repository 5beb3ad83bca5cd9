#!/usr/bin/python3
"""Fast tests of what the ensemble's page computes (notebooks/ensemble_data.py, ensemble_charts.py): statistics against tables, SciPy's tests and
made-up runs whose numbers are known."""

import sys
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np
from scipy import stats

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "notebooks"), str(ROOT / "benchmarks")]
import ensemble_charts
import ensemble_data as data
from charts import Frame, NothingToDraw
from silo_data import Phase, Story

ROUNDING = 1e-12  # sums of some hundred numbers near 1
LAYERS, SECTORS, HEIGHT = 10, data.SECTORS, 20.0


class Spread(unittest.TestCase):
    def test_interval_of_three(self):
        found = data.envelope([1.0, 2.0, 3.0])
        # Student's t for 2 degrees of freedom: 4.30265 in tables, to that many digits.
        self.assertAlmostEqual(found.high - found.mean, 4.30265 / np.sqrt(3), delta=1e-5)
        self.assertEqual((found.n, found.mean, found.min, found.max), (3, 2, 1, 3))

    def test_unknown_values_are_left_out(self):
        found = data.envelope([[1.0, np.nan, 5.0], [3.0, np.nan, np.nan]])
        np.testing.assert_array_equal(found.n, [2, 0, 1])
        np.testing.assert_array_equal(found.mean, [2, np.nan, 5])
        np.testing.assert_array_equal(found.min, [1, np.nan, 5])
        np.testing.assert_array_equal(np.isfinite(found.low), [True, False, False])

    def test_welch_is_the_dual_of_scipys_test(self):
        a, b = np.array([3.1, 4.2, 2.8]), np.array([1.0, 1.2, 0.7, 1.4, 0.9])
        found = data.difference(a, b, False)
        for edge in (found.low, found.high):
            # At the end of the interval the test is at 5 %; rounding through a quantile.
            self.assertAlmostEqual(stats.ttest_ind(a - edge, b, equal_var=False).pvalue, 0.05, delta=1e-9)
        self.assertTrue(found.differs)

    def test_pairs_are_the_dual_of_scipys_test(self):
        a, b = np.array([3.1, 4.2, 2.8]), np.array([3.0, 4.3, 2.6])
        found = data.difference(a, b, True)
        for edge in (found.low, found.high):
            self.assertAlmostEqual(stats.ttest_rel(a - edge, b).pvalue, 0.05, delta=1e-9)
        self.assertFalse(found.differs)
        # What pairs share does not count.
        self.assertLess(found.high - found.low, 0.5 * (data.difference(a, b, False).high - data.difference(a, b, False).low))

    def test_without_any_spread_a_difference_is_sure(self):
        found = data.difference([2.0, 2.0], [1.0, 1.0, 1.0], False)
        self.assertEqual((found.low, found.high), (1, 1))

    def test_a_single_run_differs_from_nothing(self):
        for paired in (False, True):
            self.assertFalse(data.difference([2.0], [1.0], paired).differs)

    def test_intervals_hold_the_truth_as_often_as_they_say(self):
        random, places = np.random.default_rng(1), 20000
        a, b = random.normal(1.0, 1.0, (3, places)), random.normal(0.0, 3.0, (5, places))
        held = data.envelope(a)
        # Binomial: five standard deviations of 95 % in 20,000 are 0.8 %. Welch's freedom is an approximation, good to 1 % at these numbers.
        self.assertAlmostEqual(np.mean((held.low <= 1) & (held.high >= 1)), 0.95, delta=0.008)
        found = data.difference(a, b, False)
        self.assertAlmostEqual(np.mean((found.low <= 1) & (found.high >= 1)), 0.95, delta=0.018)


class Made(Story):
    """A run of rest to 5 s, discharge to 25 s with 50 balls/s, hammer to 26 s: pressures rise evenly with depth to `bottom` [Pa], fall to
    `freed` of that in the discharge, and have a wave of an eighth around the axis. Packing fraction 0.6, one ball in ten in crystals."""

    def __init__(self, run, bottom, freed=0.5, rate=50.0, start=0.0):
        self.run = run
        self.time = self.frame_times = 0.5 * np.arange(53)
        n = len(self.time)
        self.radius, self.scene = np.full(2000, 0.22), {"silo": {"hopper_height": 5.0}, "material": {"density": 1250.0}, "gravity": [0, 0, -10.0]}
        self.phases = [Phase("fill", 0.0, 4.0, False, {}), Phase("rest", 4.0, 5.0, False, {}), Phase("discharge", 5.0, 25.0, True, {}), Phase("hammer", 25.0, 26.0, False, {})]
        self.discharged_at_frames = np.clip(rate * (self.time - 5.0), 0, 20 * rate)
        self.kinetic_at_frames = np.full(n, 7.0)
        self.edges = np.linspace(0.0, HEIGHT, LAYERS + 1)
        # A wall ball in the middle of each sector of each layer.
        layer, sector = np.divmod(np.arange(LAYERS * SECTORS), SECTORS)
        angle, z = (sector + 0.5) * 2 * np.pi / SECTORS - np.pi, self.middles[layer]
        level = np.where((self.time > 5.0) & (self.time <= 25.0), freed, np.where(self.time > 25.0, 0.75, 1.0))
        profile = bottom * (1 - self.middles / HEIGHT)
        self.wall = {"angle": angle, "z": z, "area": np.full(len(z), 0.2), "pressure": level[:, None] * (profile[layer] * (1 + np.cos(angle) / 8))}
        self.fixed = Frame(np.stack([5 * np.cos(angle), 5 * np.sin(angle), z], axis=1), None, np.full(len(z), 0.22), np.ones(len(z), int))
        rows = lambda value: np.tile(value, (n, 1))
        self.series = {"pressure_by_layer": level[:, None] * profile, "janssen_by_layer": rows(0.8 * 1e5 * (1 - self.middles / HEIGHT)),
                       "water_by_layer": rows(1e5 * (1 - self.middles / HEIGHT)), "frictionless_by_layer": rows(0.5e5 * (1 - self.middles / HEIGHT)),
                       "surface_height": rows(np.full(3, HEIGHT)), "packing_by_layer": rows(np.full(LAYERS, 0.6)), "flux_asymmetry": rows([0.1, 0.2, 0.3]),
                       **{name: np.full(n, value) for name, value in dict(
                           density=0.6, density_peak_excess=0.15, crystalline_share=0.1, wall_friction=0.02, lateral_ratio=0.9, chain_share=0.3, unloaded_share=0.04).items()}}
        with h5py.File(run, "w") as file:
            file["particles/content/position/value"] = np.full((n, 2, 3), start)


class Numbers(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.directory = Path(scratch.name)

    def variant(self, name, bottoms, **more):
        return data.Variant(name, f"the {name} one", {seed: Made(self.directory / f"{name}{seed}.h5", bottom, start=seed if name != "strange" else -seed, **more)
                                                     for seed, bottom in enumerate(bottoms, 1)})

    def ensemble(self):
        return data.Ensemble([self.variant("base", (90e3, 100e3, 110e3)), self.variant("same", (90e3, 100e3, 110e3)),
                              self.variant("higher", (91e3, 101.1e3, 110.9e3)), self.variant("strange", (80e3, 100e3), rate=60.0)])

    def test_numbers_of_a_run(self):
        story = Made(self.directory / "run.h5", 100e3)
        found = {quantity.text.split("  [")[0]: quantity.of(story) for quantity in data.QUANTITIES if not quantity.text.startswith("...")}
        for key, expected in (("discharge", 50), ("its slowest second over the mean", 1), ("packing fraction at rest", 0.6), ("balls in crystals at rest", 10),
                              ("pressure above the transition at rest", 75),  # in the middle of the layer from 4 to 6 m
                              ("largest pressure of a layer at rest", 95), ("highest dynamic over static pressure", 0.5), ("hammer over static, most", 0.75),
                              ("hammer over before, above the transition", 1.5), ("mean dynamic over static, above the transition", 0.5),
                              ("pressure over Janssen's at rest, most", 1.25), ("mode 1 of the flux between frames", 10),
                              ("pressure uneven around at rest", 100 / 8 / np.sqrt(2))):
            with self.subTest(key):
                self.assertAlmostEqual(found[key], expected, delta=1e3 * ROUNDING * abs(expected))

    def test_jitter_is_the_kinetic_energy_a_ball_over_its_weight_along_a_radius(self):
        story = Made(self.directory / "run.h5", 100e3)
        weight = 1250.0 * 4 / 3 * np.pi * 0.22 ** 3 * 10.0
        self.assertAlmostEqual(data.jitter(story) * weight * 0.22 * 2000, 7.0, delta=1e3 * ROUNDING)

    def test_energy_that_comes_from_nowhere(self):
        story = Made(self.directory / "run.h5", 100e3)
        self.assertTrue(np.isnan(data.energy_made(story)))  # an older run
        ends = lambda first, filled, last: np.interp(story.time, [0.0, 4.0, 26.0], [first, filled, last])
        with h5py.File(story.run, "a") as file:
            for name, values in dict(kinetic_energy=ends(0, 5, 1), potential_energy=ends(100, 50, 20), elastic_energy=ends(0, 2, 2), dissipated=ends(0, 40, 60),
                                     first_impact=ends(0, 3, 3), removed_energy=ends(0, 0, 12), event_work=ends(0, 1, 2), switched_energy=ends(0, 0, -1)).items():
                file[f"observables/{name}/value"] = values
        # After the filling: -4 - 30 + 0 + 20 + 0 + 12 less event work of 1, and -1 by switching.
        self.assertAlmostEqual(data.energy_made(story), (-2 - 1 + 1) / 20, delta=ROUNDING)

    def test_rate_over_time_is_that_of_the_discharge_alone(self):
        story = Made(self.directory / "run.h5", 100e3)
        found = data.rate_over_time(np.array([-0.5, 0.25, 0.5, 10.0, 19.5, 20.0]))(story)
        np.testing.assert_allclose(found, [np.nan, np.nan, 50, 50, 50, np.nan], rtol=ROUNDING)

    def test_envelopes_of_the_layers(self):
        found = self.ensemble().base.envelope(data.at_rest(data.PRESSURE))
        share = 1 - np.arange(1, 2 * LAYERS, 2) / (2 * LAYERS)
        np.testing.assert_allclose(found.mean, 100e3 * share, rtol=ROUNDING)
        np.testing.assert_allclose(found.min, 90e3 * share, rtol=ROUNDING)
        np.testing.assert_allclose(found.max, 110e3 * share, rtol=ROUNDING)
        np.testing.assert_allclose(found.high - found.mean, 4.30265 * 10e3 / np.sqrt(3) * share, rtol=1e-5)  # the table's digits

    def test_pairs_are_runs_of_the_same_filling(self):
        ensemble = self.ensemble()
        self.assertEqual([ensemble.is_paired(name) for name in ensemble.variants], [True, True, True, False])
        self.assertEqual(ensemble.common("strange"), [1, 2])
        # Paired, a thousand pascal more in each are seen under a spread of ten thousand; of independent runs they are not.
        self.assertTrue(ensemble.difference("higher", data.at_rest(data.PRESSURE)).differs.all())
        self.assertFalse(ensemble.difference("strange", data.at_rest(data.PRESSURE)).differs.any())
        self.assertTrue(ensemble.difference("strange", data.rate).differs)

    def test_verdicts(self):
        ensemble = self.ensemble()
        self.assertIn("Pressures at rest: 0 of 10 layers differ", ensemble_charts.verdict(ensemble, "same"))
        self.assertIn("pairs of runs", ensemble_charts.verdict(ensemble, "higher"))
        self.assertIn("Pressures at rest: 10 of 10 layers differ; differences are 1.0 % of the largest pressure", ensemble_charts.verdict(ensemble, "higher"))
        self.assertIn("Welch", ensemble_charts.verdict(ensemble, "strange"))

    def test_tables(self):
        ensemble = self.ensemble()
        titles, rows = ensemble_charts.number_rows(ensemble)
        self.assertEqual(titles[1:], ["the base one (3)", "the same one (3)", "the higher one (3)", "the strange one (2)"])
        self.assertEqual(rows[0][1], "50.0 ± 0.0 (50.0 to 50.0)")
        titles, rows = ensemble_charts.difference_rows(ensemble)
        self.assertEqual(titles[1:], ["the same one (3), paired", "the higher one (3), paired", "the strange one (2)"])
        self.assertEqual(rows[0][3], "+10.0 [+10.0, +10.0] differs")

    def test_all_charts(self):
        ensemble = self.ensemble()
        for name in ensemble.variants:
            for chart in ensemble_charts.CHARTS:
                with self.subTest(chart=chart, variant=name):
                    if name == "base" and chart in ("layers", "numbers"):
                        self.assertRaises(NothingToDraw, ensemble_charts.figure_of, chart, ensemble, name)
                    else:
                        ensemble_charts.figure_of(chart, ensemble, name).savefig(self.directory / "chart.png", dpi=40)
        self.assertRaises(NothingToDraw, ensemble_charts.figure_of, "time", ensemble, "none")

    def test_layers_that_are_not_full_are_left_out(self):
        found = data.whole(lambda story: np.array([0.56, 0.62, 0.64, 0.64, 0.32]))(None)  # 0.9 of the median: 0.558
        np.testing.assert_array_equal(found, [0.56, 0.62, 0.64, 0.64, np.nan])

    def test_a_difference_beyond_the_scale_is_told(self):
        ensemble = data.Ensemble([self.variant("base", (90e3, 100e3)), self.variant("faster", (90e3, 100e3), rate=90.0), self.variant("slower", (90e3, 100e3), rate=10.0)])
        for name, told in (("faster", "differs, +80 %"), ("slower", "differs, \N{MINUS SIGN}80 %")):
            self.assertIn(told, [text.get_text() for text in ensemble_charts.figure_of("numbers", ensemble, name).axes[0].texts])

    def test_one_run_of_each_is_drawn_without_intervals(self):
        ensemble = data.Ensemble([self.variant("base", (90e3,)), self.variant("higher", (91e3,))], missing=3)
        for chart in ensemble_charts.CHARTS:
            ensemble_charts.figure_of(chart, ensemble, "higher").savefig(self.directory / "chart.png", dpi=40)
        self.assertRaises(NothingToDraw, ensemble_charts.verdict, ensemble, "higher")

    def test_nothing_finished(self):
        (self.directory / "ensemble.toml").write_text("seeds = [1, 2]\n[variant.a]\n", encoding="utf-8")
        self.assertRaises(NothingToDraw, data.read_ensemble, self.directory)


class Walls(unittest.TestCase):
    def test_relief_of_a_square_lattice(self):
        """Balls of 0.22 m one diameter apart on a wide cylinder: as on a plane, where each place has a closed form."""
        radius, apart, wide = 0.22, 0.44, 60.0
        n = int(round(2 * np.pi * wide / apart))
        angle, z = (array.ravel() for array in np.meshgrid(2 * np.pi * np.arange(n) / n, apart * np.arange(30)))

        class Lattice:
            fixed = Frame(np.stack([wide * np.cos(angle), wide * np.sin(angle), z], axis=1), None, np.full(len(z), radius), np.ones(len(z), int))
            joint = 0.0
        Lattice.radius = np.array([radius])
        found = data.relief(Lattice, places=4000)
        x, y = np.meshgrid(*[(np.arange(400) + 0.5) / 400 * apart / 2] * 2)
        reach, aside = 2 * radius, np.hypot(x, y)
        depth = np.sqrt(reach ** 2 - aside ** 2)
        # 4,000 places: 1.1 % of a standard deviation each, three of them; the curvature of 60 m is 1e-3 of it.
        self.assertAlmostEqual(found.rms / depth.std(), 1.0, delta=0.04)
        self.assertAlmostEqual(found.slope / np.sqrt(np.mean((aside / depth) ** 2)), 1.0, delta=0.04)
        self.assertAlmostEqual(found.slope_up / np.sqrt(np.mean((y / depth) ** 2)), 1.0, delta=0.04)
        # The farthest of so many places is nearly in a hole, the nearest nearly before a ball.
        self.assertAlmostEqual(found.range / (reach - np.sqrt(reach ** 2 - apart ** 2 / 2)), 1.0, delta=0.03)


if __name__ == "__main__":
    unittest.main()
