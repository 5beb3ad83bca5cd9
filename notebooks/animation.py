#!/usr/bin/python3
"""Animates a run: a vertical slice through the silo's axis, balls coloured by speed, as MP4.

The slice is as thick as a mean ball: balls with their centre in it are drawn in full, the near ones over the far ones. The wall is grey;
of the plug, which is there only while the outlet is closed, the outlines. One recorded frame is one picture, so that a second of film
shows --fps times [output].every of simulated time.

    notebooks/animation.py out/mine/run.h5 out/mine/flow.mp4 [--from S] [--to S] [--fps N] [--fastest M/S] [--angle DEGREES]
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import EllipseCollection

DPI = 100
HEIGHT = 9.6  # inches
WALL, PLUG = 1, 2  # kinds of fixed balls


class Run:
    """The frames of a run.h5."""

    def __init__(self, path):
        self.file = h5py.File(path, "r")
        content, wall = self.file["particles/content"], self.file["particles/wall"]
        self.times = content["position/time"][:]  # s
        self.radius = content["radius"][:]  # m
        self.positions, self.velocities = content["position/value"], content["velocity/value"]
        self.fixed, self.fixed_radius, self.fixed_kind = wall["position"][:], wall["radius"][:], wall["kind"][:]

    def frames(self, begin, end):
        """Numbers of the frames between two times [s], both included."""
        rounding = 1e-9 * max(1.0, abs(self.times[-1]))  # times are typed in decimals
        return [k for k, t in enumerate(self.times) if begin - rounding <= t <= end + rounding]


def in_slice(position, angle, half_thickness):
    """Balls with their centre in a slice about the vertical plane through the axis at `angle` [rad] from x: numbers, places in the
    plane [m], the farthest from the viewer first. Balls that have left are NaN and in no slice."""
    along = position[:, 0] * np.cos(angle) + position[:, 1] * np.sin(angle)
    depth = position[:, 1] * np.cos(angle) - position[:, 0] * np.sin(angle)
    number = np.flatnonzero(np.abs(depth) <= half_thickness)
    number = number[np.argsort(-depth[number], kind="stable")]
    return number, np.column_stack([along, position[:, 2]])[number]


def speeds(velocity):
    return np.linalg.norm(velocity, axis=1)


def sample(frames, count=20):
    """Some of the frames, evenly spread, the first and the last among them."""
    return [frames[k] for k in np.unique(np.linspace(0, len(frames) - 1, min(count, len(frames))).astype(int))]


def fastest_of(run, frames):
    """A speed that nearly all balls stay below [m/s]: the 98th percentile over a sample of the frames, rounded to two digits."""
    all_speeds = np.concatenate([speeds(run.velocities[frame]) for frame in sample(frames)])
    all_speeds = all_speeds[np.isfinite(all_speeds)]
    top = np.percentile(all_speeds, 98) if all_speeds.size else 0.0
    return float(f"{top:.2g}") if top > 0 else 1.0


class Picture:
    """One figure that is drawn again for every frame."""

    def __init__(self, run, frames, angle, fastest):
        self.run, self.angle, self.half_thickness = run, angle, run.radius.mean()
        number, place = self.slice(run.fixed)
        (left, right), (low, high) = self.window(frames, number, place)
        width = HEIGHT * 0.86 * (right - left) / (high - low) + 2.0  # inches, with the scale beside it
        # Even numbers of dots, as the film's format wants them.
        self.figure = plt.figure(figsize=(2 * round(width * DPI / 2) / DPI, HEIGHT), dpi=DPI, layout="constrained")
        self.axes = self.figure.add_subplot(xlim=(left, right), ylim=(low, high), aspect="equal", xlabel="m", ylabel="z [m]")
        for kind, look in ((WALL, {"facecolor": "0.75", "edgecolor": "0.6"}), (PLUG, {"facecolor": "none", "edgecolor": "0.6"})):
            its = run.fixed_kind[number] == kind
            self.axes.add_collection(self.circles(place[its], run.fixed_radius[number][its], **look))
        self.balls = None
        self.scale = matplotlib.cm.ScalarMappable(plt.Normalize(0.0, fastest), "turbo")
        self.figure.colorbar(self.scale, ax=self.axes, label="speed [m/s]", extend="max", fraction=0.06, aspect=40)
        self.title = self.axes.set_title(" \n ", loc="left", fontsize=11)

    def slice(self, position):
        return in_slice(position, self.angle, self.half_thickness)

    def window(self, frames, fixed, place):
        """The piece of the plane that shows all fixed balls, and the content of a sample of the frames."""
        edges = [(place, self.run.fixed_radius[fixed])]
        for frame in sample(frames):
            number, place = self.slice(self.run.positions[frame])
            edges.append((place, self.run.radius[number]))
        corners = np.concatenate([place + sign * radius[:, None] for place, radius in edges for sign in (-1, 1)])
        if not corners.size:
            sys.exit("animation.py: the slice holds no ball; turn it with --angle")
        margin = 0.02 * max(corners.max(axis=0) - corners.min(axis=0))
        low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
        return (low[0], high[0]), (low[1], high[1])

    def circles(self, place, radius, **look):
        return EllipseCollection(2 * radius, 2 * radius, np.zeros(len(radius)), units="xy", offsets=place,
                                 offset_transform=self.axes.transData, linewidths=0.5, **look)

    def draw(self, frame):
        """The picture of a frame as RGBA bytes."""
        position, velocity = self.run.positions[frame], self.run.velocities[frame]
        number, place = self.slice(position)
        if self.balls is not None:
            self.balls.remove()
        self.balls = self.axes.add_collection(
            self.circles(place, self.run.radius[number], facecolor=self.scale.to_rgba(speeds(velocity[number])), edgecolor="black"))
        self.title.set_text(f"t = {self.run.times[frame]:.3f} s\n{np.isfinite(position[:, 0]).sum()} balls in the silo")
        self.figure.canvas.draw()
        return self.figure.canvas.buffer_rgba()

    def size_in_dots(self):
        width, height = self.figure.canvas.get_width_height()
        return f"{width}x{height}"


def clock(seconds):
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


class Progress:
    """One line rewritten on a terminal, plain lines now and then in a pipe."""

    def __init__(self, total):
        self.total, self.began, self.last = total, time.monotonic(), 0.0
        self.terminal = sys.stdout.isatty()

    def note(self, done):
        now = time.monotonic()
        if done < self.total and now - self.last < (0.5 if self.terminal else 10.0):
            return
        self.last = now
        rate = done / max(now - self.began, 1e-9)
        text = f"{done} of {self.total} pictures, {rate:.1f} a second, {clock((self.total - done) / rate)} left"
        print(("\r" + text + "\033[K") if self.terminal else text, end="" if self.terminal and done < self.total else "\n", flush=True)


def encoder(path, size, fps):
    """ffmpeg, fed with RGBA pictures, writing to `path`."""
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pixel_format", "rgba", "-video_size", size, "-framerate", f"{fps:g}", "-i", "-",
               "-c:v", "libx264", "-preset", "medium", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(path)]
    try:
        return subprocess.Popen(command, stdin=subprocess.PIPE)
    except FileNotFoundError:
        sys.exit("animation.py: ffmpeg is not here; install Debian's package ffmpeg")


def animate(run, frames, path, fps, angle, fastest):
    """Writes the film aside and renames it."""
    picture = Picture(run, frames, angle, fastest)
    part = path.with_name(f".{path.name}.part")
    try:
        with encoder(part, picture.size_in_dots(), fps) as process:
            progress = Progress(len(frames))
            try:
                for done, frame in enumerate(frames, 1):
                    process.stdin.write(picture.draw(frame))
                    progress.note(done)
            except BrokenPipeError:
                pass  # ffmpeg has said why, and its exit code tells
            finally:
                process.stdin.close()
        if process.returncode != 0:
            sys.exit(f"animation.py: ffmpeg ended with exit code {process.returncode}; {path} is not written")
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def arguments(words):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("run", type=Path, help="run.h5, or the directory that it stands in")
    parser.add_argument("film", type=Path, help="file to write (.mp4)")
    parser.add_argument("--from", type=float, default=-np.inf, dest="begin", metavar="S", help="first time shown")
    parser.add_argument("--to", type=float, default=np.inf, dest="end", metavar="S", help="last time shown")
    parser.add_argument("--fps", type=float, default=25.0, help="pictures a second (default: 25)")
    parser.add_argument("--fastest", type=float, metavar="M/S", help="speed at the end of the colour scale (default: what 98 %% stay below)")
    parser.add_argument("--angle", type=float, default=0.0, metavar="DEGREES", help="of the plane from the x axis (default: 0)")
    return parser.parse_args(words)


def main(words):
    options = arguments(words)
    path = options.run / "run.h5" if options.run.is_dir() else options.run
    if options.film.suffix != ".mp4":
        sys.exit(f"animation.py: {options.film}: a film's name ends with .mp4")
    if options.fps <= 0 or (options.fastest is not None and options.fastest <= 0):
        sys.exit("animation.py: --fps and --fastest must be above 0")
    try:
        run = Run(path)
    except (OSError, KeyError) as trouble:
        sys.exit(f"animation.py: {path}: is not the file of a run: {trouble}")
    frames = run.frames(options.begin, options.end)
    if not frames:
        sys.exit(f"animation.py: {path}: has no frame between {options.begin} and {options.end} s; it covers {run.times[0]} to {run.times[-1]} s")
    animate(run, frames, options.film, options.fps, np.radians(options.angle), options.fastest or fastest_of(run, frames))
    print(f"{options.film}: {len(frames)} pictures, {run.times[frames[0]]:.6g} to {run.times[frames[-1]]:.6g} s")


if __name__ == "__main__":
    main(sys.argv[1:])
