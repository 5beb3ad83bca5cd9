#!/usr/bin/python3
"""Fast tests of notebooks/animation.py: what a slice holds, and films read back by ffprobe."""

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np

SCRIPT = Path(__file__).resolve().parents[2] / "notebooks" / "animation.py"
specification = importlib.util.spec_from_file_location("animation", SCRIPT)
animation = sys.modules["animation"] = importlib.util.module_from_spec(specification)
specification.loader.exec_module(animation)

FRAMES, BALLS = 7, 5
NOWHERE = np.nan


def write_run(path):
    """Five balls on a line fall for seven frames past three wall balls and a plug ball; ball 0 has left at frame 3."""
    position, velocity = np.zeros((FRAMES, BALLS, 3)), np.zeros((FRAMES, BALLS, 3))
    for k in range(FRAMES):
        position[k] = [[0.5 * ball, 0.1 * ball, 3.0 - 0.2 * k] for ball in range(BALLS)]
        velocity[k, :, 2] = -1.0 * k
    position[3:, 0] = velocity[3:, 0] = NOWHERE
    with h5py.File(path, "w") as file:
        content, wall = file.create_group("particles/content"), file.create_group("particles/wall")
        content["position/value"], content["position/time"] = position, 0.1 * np.arange(FRAMES)
        content["velocity/value"], content["radius"] = velocity, np.full(BALLS, 0.2)
        wall["position"] = np.array([[-1.0, 0, 1], [3, 0, 1], [0, 3, 1], [1, 0, 0]])
        wall["radius"], wall["kind"] = np.full(4, 0.3), np.array([1, 1, 1, 2], "u1")
    return path


class Slice(unittest.TestCase):
    position = np.array([[1.0, 0.0, 5.0], [2.0, 0.2, 6.0], [3.0, -0.2, 7.0], [4.0, 0.21, 8.0], [NOWHERE] * 3])

    def test_holds_centres_within_it_the_far_ones_first(self):
        number, place = animation.in_slice(self.position, 0.0, 0.2)
        self.assertEqual(list(number), [1, 0, 2])
        self.assertEqual(place.tolist(), [[2.0, 6.0], [1.0, 5.0], [3.0, 7.0]])

    def test_turns_about_the_axis(self):
        # Seen along -x: y is along the plane, x the depth, and what was near is at its side.
        number, place = animation.in_slice(np.array([[0.1, 2.0, 5.0], [0.3, 2.0, 5.0]]), np.pi / 2, 0.2)
        self.assertEqual(list(number), [0])
        np.testing.assert_allclose(place, [[2.0, 5.0]], atol=1e-15)  # rounding of pi / 2


class Frames(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.folder = Path(self.scratch.name)
        self.run_file = write_run(self.folder / "run.h5")

    def test_times_typed_in_decimals_find_their_frames(self):
        run = animation.Run(self.run_file)
        self.assertEqual(run.frames(0.3, 0.5), [3, 4, 5])  # 0.1 * 3 is 0.30000000000000004
        self.assertEqual(run.frames(-np.inf, np.inf), list(range(FRAMES)))
        self.assertEqual(run.frames(0.31, 0.39), [])

    def test_scale_ends_where_nearly_all_are_below(self):
        # Speeds 0 .. 6, five balls each and four from frame 3 on: 31 values, 98 % of them below 6.
        self.assertEqual(animation.fastest_of(animation.Run(self.run_file), list(range(FRAMES))), 6.0)
        self.assertEqual(animation.fastest_of(animation.Run(self.run_file), [0]), 1.0)  # all at rest: any scale will do

    def test_a_sample_has_both_ends(self):
        self.assertEqual(animation.sample(list(range(3, 300)))[::19], [3, 299])
        self.assertEqual(animation.sample([4]), [4])

    def test_pictures_show_balls_in_the_colour_of_their_speed(self):
        run = animation.Run(self.run_file)
        picture = animation.Picture(run, list(range(FRAMES)), 0.0, 6.0)
        for frame, shown in ((1, [2, 1, 0]), (4, [2, 1])):  # of half a mean diameter, 0.2 m, off the plane at most
            picture.draw(frame)
            colours = picture.balls.get_facecolor()
            self.assertEqual(len(colours), len(shown))
            np.testing.assert_array_equal(colours, picture.scale.to_rgba(np.full(len(shown), float(frame))))
            np.testing.assert_allclose(picture.balls.get_offsets()[:, 0], [0.5 * ball for ball in shown], atol=1e-15)  # rounding

    def film(self, *words):
        return subprocess.run([sys.executable, "-B", SCRIPT, self.run_file, self.folder / "film.mp4", *words], capture_output=True, text=True)

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not here")
    def test_film_has_a_picture_per_frame(self):
        for words, wanted in (((), FRAMES), (("--from", "0.2", "--to", "0.4", "--fps", "10"), 3)):
            done = self.film(*words)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(f"{wanted} pictures", done.stdout)
            probed = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_entries", "stream=codec_name,nb_read_frames,r_frame_rate",
                                     "-of", "csv=p=0", self.folder / "film.mp4"], capture_output=True, text=True, check=True)
            self.assertEqual(probed.stdout.strip(), f"h264,{'10' if words else '25'}/1,{wanted}")
        self.assertEqual(sorted(p.name for p in self.folder.iterdir()), ["film.mp4", "run.h5"])

    def test_wrong_calls_say_what_is_wrong_and_write_nothing(self):
        for words, said in ((("--from", "9"), "has no frame between"), (("--fps", "0"), "must be above 0"), (("--fastest", "-1"), "must be above 0")):
            done = self.film(*words)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(said, done.stderr)
        self.run_file = self.folder / "none.h5"
        self.assertIn("is not the file of a run", self.film().stderr)
        self.assertEqual([p.name for p in self.folder.iterdir()], ["run.h5"])

    def test_without_ffmpeg_nothing_is_left(self):
        done = subprocess.run([sys.executable, "-B", SCRIPT, self.run_file, self.folder / "film.mp4"], capture_output=True, text=True,
                              env={**os.environ, "PATH": str(self.folder)})
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("install Debian's package ffmpeg", done.stderr)
        self.assertEqual([p.name for p in self.folder.iterdir()], ["run.h5"])

    def test_a_film_that_ffmpeg_gives_up_leaves_nothing(self):
        broken = self.folder / "bin" / "ffmpeg"
        broken.parent.mkdir()
        broken.write_text("#!/bin/sh\nfor last; do :; done\necho half a film >\"$last\"\nexit 3\n")
        broken.chmod(0o755)
        done = subprocess.run([sys.executable, "-B", SCRIPT, self.run_file, self.folder / "film.mp4"], capture_output=True, text=True,
                              env={**os.environ, "PATH": f"{broken.parent}:{os.environ['PATH']}"})
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("exit code 3", done.stderr)
        self.assertEqual(sorted(p.name for p in self.folder.iterdir()), ["bin", "run.h5"])


if __name__ == "__main__":
    unittest.main()
