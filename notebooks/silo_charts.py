"""Charts of a silo's story beside the paper's figures, from a run and its measures.

As a module: CHARTS, by name, each drawn from the Story that silo_data.read_story() gives; every draw_... fills an empty figure and
raises NothingToDraw where the run has nothing to show. The notebooks put them beside the paper's statements.
"""

import matplotlib
import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize

from silo_data import (BESIDE, FLOOR, MEAN_OVER, beside, chance_of_flux, charts, discharge_moment, even_run, extremes, filling_views, flux_mode,
                       bridged_view, hammer_curves, hammer_views, lasting_wave, lattice, mean, mean_flux_mode, mean_of_rows, meandering_views, percent, running_mean, spectrum,
                       stoppage_views, surface_moments, turned, unsymmetrical_views)
from charts import GRID, INK, MUTED, WALL, Chart, Frame, NothingToDraw, colour_bar, fixed, soft_grid

BLUE, ORANGE, GREEN, RED, SKY, PURPLE = "#0072b2", "#d55e00", "#009e73", "#b2182b", "#56b4e9", "#8c5aa8"
# Both ends of turbo are dark; without them the lowest and the highest cannot be taken for each other.
RAINBOW = LinearSegmentedColormap.from_list("rainbow", matplotlib.colormaps["turbo"](np.linspace(0.07, 0.93, 256)))
LOADED = LinearSegmentedColormap.from_list("loaded", ["#eef0f3", *matplotlib.colormaps["inferno_r"](np.linspace(0.12, 0.9, 8))])
NEAR = 2.0  # mean ball diameters: the surroundings of a place on the wall
SHADES = {"filling": "#e8ecf1", "flow": "white", "hammer": "#f7d7cf"}

# ------------------------------------------------------------------ axes over time

def shade_phases(axes, story, labels=False):
    """Closed outlet grey, hammer red; the names of the phases above."""
    low, high = axes.get_xlim()
    for k, phase in enumerate(story.phases):
        kind = "filling" if k < story.first_open else "hammer" if phase is story.hammer_phase else "flow"
        axes.axvspan(phase.begin, phase.end, color=SHADES[kind], lw=0, zorder=0)
        if kind == "hammer":  # a second of minutes
            axes.axvline(phase.begin, color=RED, lw=1.0, alpha=0.7, zorder=1)
    if labels:
        where = axes.get_xaxis_transform()
        if story.hammer_phase and low <= story.hammer_phase.begin <= high:
            axes.text(story.hammer_phase.begin, 1.01, "hammer", color=RED, fontsize=9, ha="center", va="bottom", transform=where)
        if low <= story.opened <= high:
            axes.text(story.opened, 1.01, "opening", color=MUTED, fontsize=9, ha="left", va="bottom", transform=where)
    axes.set_xlim(low, high)


def over_time(axes, story, ylabel, labels=False, **more):
    axes.set(xlim=more.pop("xlim", (story.time[0], story.time[-1])), ylabel=ylabel, **more)
    shade_phases(axes, story, labels)
    soft_grid(axes)
    return axes


def end_label(axes, text, colour, y, x=1.01):
    axes.text(x, y, text, color=colour, fontsize=10, va="center", transform=axes.get_yaxis_transform())


# ------------------------------------------------------------------ the story in one chart

def draw_story(figure, story):
    top, below = figure.subplots(2, 1, sharex=True)
    time, left = story.frame_times, len(story.radius) - story.discharged_at_frames
    top.plot(time, left / 1e3, color=BLUE, lw=2)
    over_time(top, story, "balls in the silo\n[thousands]", True, ylim=(0, None))
    # Over a second at least: single balls leave between the frames of the hammer.
    rate = -np.array([(left[(time >= t - 2.5) & (time <= t + 2.5)][[0, -1]] @ [-1, 1])
                      / max(np.ptp(time[(time >= t - 2.5) & (time <= t + 2.5)]), 1e-9) for t in time])
    below.plot(time, rate, color=ORANGE, lw=1.6)
    over_time(below, story, "discharge, mean over 5 s\n[balls/s]", ylim=(0, None), xlabel="time  [s]")


# ------------------------------------------------------------------ Fig. 3: density and surface

def draw_density(figure, story):
    axes = figure.subplots(3, 1, sharex=True)
    shown = story.left > 0.02
    time = np.where(shown, story.time, np.nan)
    axes[0].plot(time, story["density"], color=BLUE, lw=1.8)
    over_time(axes[0], story, "mean packing\nfraction", True)
    excess = np.where(shown & story.settled, 100 * story["density_peak_excess"], np.nan)
    axes[1].plot(time, excess, color=ORANGE, lw=1, alpha=0.45)
    axes[1].plot(time, running_mean(story.time, excess), color=ORANGE, lw=2)
    for level, text, place in ((14, "paper, filling: up to 14 %", 12.6), (17, "paper, discharge: up to 17 %", 18.4)):
        axes[1].axhline(level, color=INK, lw=1, ls=(0, (4, 3)))
        end_label(axes[1], text, INK, place)
    over_time(axes[1], story, "densest place\nover the mean  [%]", ylim=(0, 27))
    axes[2].plot(np.where(story.settled, time, np.nan), story["density_peak_z"], ".", color=GREEN, ms=4)
    axes[2].axhline(story.joint, color=INK, lw=1, ls=(0, (4, 3)))
    end_label(axes[2], "transition", INK, story.joint)
    axes[2].plot(story.time, np.nanmax(story["surface_height"], axis=1, initial=-np.inf, where=np.isfinite(story["surface_height"])),
                 color=MUTED, lw=1)
    over_time(axes[2], story, "its height  [m]", xlabel="time  [s]", ylim=(0, story.edges[-1] * 1.05))


def draw_layers(figure, story):
    axes = figure.subplots()
    packing = story["packing_by_layer"]
    drawn = 0
    for mask, name, colour in ((story.rest, "at rest", MUTED), (story.discharge, "discharge to the hammer", BLUE),
                               (story.hammer, "hammer", RED)):
        if mask.any():
            full = story.covered(mask)
            axes.plot(packing[mask].mean(axis=0)[full], story.middles[full], "o-", color=colour, label=name, ms=4)
            drawn += full.any()
    if not drawn:
        raise NothingToDraw("no layer is full")
    axes.axhline(story.joint, color=INK, lw=1, ls=(0, (4, 3)))
    axes.text(0.01, story.joint, "transition", va="bottom", transform=axes.get_yaxis_transform(), fontsize=10)
    axes.set(xlabel="packing fraction of the layer, mean over the phase", ylabel="height z  [m]", ylim=(0, story.edges[-1]))
    soft_grid(axes)
    axes.legend(frameon=False)


def draw_surface(figure, story):
    profile, rise = figure.subplots(1, 2, width_ratios=[1.15, 1])
    chosen = [k for k in surface_moments(story) if np.isfinite(story["surface_height"][k]).any()]
    if not chosen:
        raise NothingToDraw("no frame has a surface")
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, len(chosen)))
    for k, colour in zip(chosen, colours):
        radius, height = story["surface_radius"][k], story["surface_height"][k]
        middle = np.nanmean(height)
        profile.plot(radius, height - middle, "o-", color=colour, ms=3.5, label=f"{story.time[k]:.0f} s, {percent(story.left[k])}, {middle:.1f} m")
    profile.axhline(0, color=INK, lw=0.8)
    profile.set(xlabel="distance from the axis  [m]", ylabel="height of the surface over its mean  [m]")
    soft_grid(profile)
    profile.legend(frameon=False, fontsize=9, loc="center left", bbox_to_anchor=(1.0, 0.5), title="time, share of balls\nstill there, mean height", title_fontsize=9)
    shown = np.where(story.left > 0.1, story["surface_rise"], np.nan)
    rise.axhline(0, color=INK, lw=0.8)
    rise.plot(story.time, shown, color=BLUE, lw=1.8)
    flowing = shown[(story.time > story.opened) & np.isfinite(shown)]
    reach = 1.25 * np.abs(flowing).max() if flowing.size else None
    over_time(rise, story, "surface at the wall above that at the axis  [m]", True, xlabel="time  [s]", ylim=(-reach, reach) if reach else None)
    rise.text(0.02, 0.97, "above 0: concave", transform=rise.transAxes, fontsize=10, va="top", color=MUTED)


# ------------------------------------------------------------------ Fig. 4: contact forces

def draw_lattice(figure, story):
    rest = np.flatnonzero(story.rest)
    moments = [int(k) for k in rest[-1:]] + [discharge_moment(story)]
    found = [lattice(story, moment) for moment in moments]
    strongest = [np.quantile(force, 0.99) for _, _, force in found if force.size]
    if not strongest:
        raise NothingToDraw("no ball presses on another")
    top = float(max(strongest)) / 1e3
    all_axes = figure.subplots(1, len(moments), sharey=True, squeeze=False)[0]
    for axes, moment, (walls, ends, force) in zip(all_axes, moments, found):
        charts.discs(axes, charts.cut_by_plane(walls), facecolors=WALL, edgecolors="none")
        thickness = 0.2 + 2.6 * np.clip(force / (1e3 * top), 0, 1) ** 0.8
        lines = axes.add_collection(LineCollection(ends, array=force / 1e3, cmap=RAINBOW, norm=Normalize(0, top), linewidths=thickness,
                                                   capstyle="round"))
        section_axes(axes, story, f"{story.phase_at(moment).name}, {story.time[moment]:.1f} s")
    all_axes[0].set_ylabel("z  [m]")
    colour_bar(figure, list(all_axes), lines, "normal force  [kN]", extend="max", shrink=0.8, aspect=34)


def section_axes(axes, story, title):
    wall = story.fixed.position[story.fixed.kind == 1]
    side = np.hypot(wall[:, 0], wall[:, 1]).max() + story.diameter
    axes.set(xlim=(-side, side), ylim=(story.fixed.position[:, 2].min() - story.diameter, wall[:, 2].max() + story.diameter),
             aspect="equal", xlabel="across  [m]")
    axes.set_title(title, loc="left")


def draw_forces(figure, story):
    distribution, over = figure.subplots(1, 2)
    middle = 0.5 * (story.force_edges[1:] + story.force_edges[:-1])
    for mask, name, colour in ((story.rest, "at rest", MUTED), (story.discharge, "discharge", BLUE), (story.hammer, "hammer", RED)):
        if mask.any():
            density = story["force_distribution"][mask].mean(axis=0)
            distribution.plot(middle, np.where(density > 0, density, np.nan), "o-", color=colour, ms=4, label=name)
    distribution.plot(middle, np.exp(-middle), color=INK, lw=1, ls=(0, (4, 3)), label="exponential")
    distribution.set(yscale="log", xlabel="normal force over its mean", ylabel="probability density")
    soft_grid(distribution)
    distribution.legend(frameon=False)
    shown = np.where(story.left > 0.02, 1.0, np.nan)
    over.plot(story.time, 100 * shown * story["unloaded_share"], color=GREEN, lw=1.6, label="nearly unloaded balls")
    over.plot(story.time, 100 * shown * story["chain_share"], color=RED, lw=1.6, label="balls in compression chains")
    over_time(over, story, "share of the content  [%]", True, xlabel="time  [s]", ylim=(0, 100))
    over.legend(frameon=False, loc="upper right")


# ------------------------------------------------------------------ Fig. 5 to 7: velocities

def draw_views(figure, story, views):
    if not views:
        raise NothingToDraw("the run has no such moment")
    rows = figure.subplots(1, 2 * len(views), sharey=True, squeeze=False)[0]
    frames = [turned(story.balls(view.moment), view.azimuth) for view in views]
    speeds = np.concatenate([np.linalg.norm(f.velocity[f.kind == 0], axis=1) for f in frames])
    top = max(float(np.quantile(speeds, 0.995)), 1e-6) if speeds.size else 1.0
    norm = LogNorm(top / 300, top)
    for k, (view, frame) in enumerate(zip(views, frames)):
        balls = draw_speeds(rows[2 * k], story, frame, norm)
        section_axes(rows[2 * k], story, f"{view.title}\n{frame.time:.2f} s: speed")
        apart = draw_arrows(rows[2 * k + 1], story, view, norm)
        section_axes(rows[2 * k + 1], story, f"{azimuth_words(view.azimuth)}\nmean over {apart:.2g} s")
    rows[0].set_ylabel("z  [m]")
    colour_bar(figure, list(rows), balls, "speed  [m/s]", extend="both", shrink=0.8, aspect=34)


def azimuth_words(azimuth):
    return f"seen across {np.degrees(azimuth):.0f}°" if azimuth else "seen across x"


def draw_speeds(axes, story, frame, norm):
    section = charts.cut_by_plane(frame)
    content = section.keep(section.kind == 0)
    charts.discs(axes, section.keep(section.kind > 0), facecolors=WALL, edgecolors="#9aa2ad", linewidths=0.4)
    balls = charts.discs(axes, content, cmap=RAINBOW, norm=norm, edgecolors="white", linewidths=0.2)
    balls.set_array(np.maximum(np.linalg.norm(content.velocity, axis=1), 1e-12))
    return balls


def draw_arrows(axes, story, view, norm):
    """Mean velocities in squares of two diameters of a slab three thick; the length grows as the root of the speed."""
    place, velocity, apart, _ = story.mean_motion(view.moment)
    content = turned(Frame(place, velocity, np.zeros(len(place)), np.zeros(len(place), int)), view.azimuth)
    fixed_balls = turned(story.fixed, view.azimuth)
    stays = (fixed_balls.kind == 1) | (not story.phase_at(view.moment).is_open)
    charts.discs(axes, charts.cut_by_plane(fixed_balls.keep(stays)), facecolors=WALL, edgecolors="none")
    near = np.abs(content.position[:, 1]) < 1.5 * story.diameter
    size = 2.0 * story.diameter
    cell = np.floor(content.position[near][:, [0, 2]] / size).astype(int)
    cells, which = np.unique(cell, axis=0, return_inverse=True)
    which, number = which.ravel(), np.bincount(which.ravel(), minlength=len(cells))
    flow = np.column_stack([np.bincount(which, content.velocity[near][:, a], len(cells)) for a in (0, 2)]) / np.maximum(number, 1)[:, None]
    speed = np.maximum(np.linalg.norm(flow, axis=1), 1e-12)
    length = 1.9 * size * np.sqrt(np.clip(speed / norm.vmax, 0, 1))
    arrows = flow / speed[:, None] * length[:, None]
    middle = (cells + 0.5) * size
    axes.quiver(middle[:, 0] - 0.5 * arrows[:, 0], middle[:, 1] - 0.5 * arrows[:, 1], arrows[:, 0], arrows[:, 1], speed, cmap=RAINBOW, norm=norm,
                angles="xy", scale_units="xy", scale=1.0, width=0.011, headwidth=3.6, headlength=4.2, headaxislength=3.8)
    return apart


def views_chart(name, views):
    return Chart(name, "", lambda figure, story: draw_views(figure, story, views(story)),
                 lambda story: (3.1 * 2 * max(len(views(story)), 1) + 1.4, 9.4))


def draw_motion(figure, story):
    share, asymmetry = figure.subplots(2, 1, sharex=True)
    shown = np.where(story.left > 0.05, 1.0, np.nan)
    flowing = story.time > story.opened
    known = np.where(flowing & ~story.hammer, shown, np.nan)
    for name, colour, text in (("intensive_share", ORANGE, "faster than the mean sinking"), ("resting_share", BLUE, "slower than a tenth of it")):
        values = 100 * known * story[name]
        share.plot(story.time, values, color=colour, lw=0.8, alpha=0.5)
        share.plot(story.time, running_mean(story.time, values), color=colour, lw=2, label=text)
    over_time(share, story, "share of the content\n[% of its mass]", True, ylim=(0, 100))
    share.legend(frameon=False, loc="upper right")
    mode, _ = flux_mode(story)
    asymmetry.plot(story.time, 100 * known * np.abs(mode), color=PURPLE, lw=0.8, alpha=0.55, label="over one frame interval")
    asymmetry.plot(story.time, 100 * known * np.abs(mean_flux_mode(story)), color=PURPLE, lw=2, label=f"mean over {MEAN_OVER:.0f} s")
    top = np.nanmax(np.append(100 * known * np.abs(mode), 1.0))
    over_time(asymmetry, story, "mode 1 of the flux at the\ntransition over its sum  [%]", xlabel="time  [s]", ylim=(0, min(top, 60) * 1.25))
    chance = 100 * chance_of_flux(story)
    if np.isfinite(chance):
        asymmetry.axhline(chance, color=INK, lw=1, ls=(0, (4, 3)))
        end_label(asymmetry, "chance (rms)", INK, chance)
    asymmetry.legend(frameon=False, loc="upper left", ncols=2)


def draw_meander(figure, story):
    axes, over = figure.subplots(1, 2, width_ratios=[1, 1.5])
    steady = story.steady_flow()
    if steady.sum() < 3:
        raise NothingToDraw("too few frames of the flow")
    weight = np.maximum(story["flux"], 0)
    path = np.column_stack([running_mean(story.time, np.where(steady, story["flux_centroid"][:, a], np.nan), weight) for a in (0, 1)])
    path = np.where(steady[:, None], path, np.nan)
    raw = np.where(steady[:, None], story["flux_centroid"], np.nan)
    axes.plot(*raw.T, ".", color=GRID, ms=4, zorder=1)
    ends = np.stack([path[:-1], path[1:]], axis=1)
    line = axes.add_collection(LineCollection(ends, array=story.time[:-1], cmap="viridis", linewidths=2, zorder=2))
    axes.plot(0, 0, "+", color=INK, ms=12, mew=1.5, zorder=3)
    reach = np.nanmax(np.abs(raw)) * 1.08
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="x  [m]", ylabel="y  [m]")
    axes.set_title("centroid of the flux through the transition", loc="left", fontsize=11)
    soft_grid(axes)
    colour_bar(figure, axes, line, "time  [s]")
    for a, (name, colour) in enumerate((("x", BLUE), ("y", ORANGE))):
        over.plot(story.time, raw[:, a], color=colour, lw=0.7, alpha=0.4)
        over.plot(story.time, path[:, a], color=colour, lw=2, label=name)
    over_time(over, story, "centroid  [m]", True, xlabel="time  [s]")
    over.legend(frameon=False)


# ------------------------------------------------------------------ beats

def draw_beats(figure, story):
    """Between frames; what is shorter does not show."""
    rate, energy = figure.subplots(2, 1, sharex=True)
    shown = story.left > 0.02
    apart = np.append(np.nan, np.diff(story.time))
    gone = np.append(np.nan, -np.diff(story.left)) * len(story.radius)
    # Single balls leave between the frames of the hammer.
    values = np.where(shown & (story.time > story.opened) & (apart > 0.2), gone / np.where(apart > 0, apart, np.nan), np.nan)
    rate.plot(story.time, values, ".-", color=ORANGE, lw=0.8, ms=2.5)
    rate.plot(story.time, running_mean(story.time, values), color=INK, lw=1.6, label=f"mean over {MEAN_OVER:.0f} s")
    over_time(rate, story, "discharge between\nframes  [balls/s]", True, ylim=(0, None))
    rate.legend(frameon=False, loc="lower right")
    inside = np.maximum(story.left * len(story.radius), 1)
    moving = np.where(shown, story.kinetic_at_frames[story.frame_of] / inside, np.nan)
    energy.plot(story.time, moving, color=BLUE, lw=1)
    energy.set_yscale("log")
    over_time(energy, story, "kinetic energy\n[J a ball in the silo]", xlabel="time  [s]")


# ------------------------------------------------------------------ arches

def draw_bridges(figure, story):
    """The larger bridges of one moment: in a section, the widest from near, and speeds on both sides of all of them."""
    view = bridged_view(story)
    moment, bridges = view.moment, story.bridges(view.moment)
    place, velocity, apart = story.motion_by_row(moment)
    here = np.isfinite(velocity[:, 0])
    speed = np.linalg.norm(velocity, axis=1)
    top = np.nanquantile(speed, 0.995)
    norm = LogNorm(top / 100, top)
    section, near, sides = figure.subplots(1, 3, width_ratios=[1, 1.15, 1.2])
    moved = Frame(place, velocity, story.radius, np.zeros(len(place), int))
    draw_bridged_section(section, story, moved, here, bridges, norm, story.phase_at(moment).is_open)
    section_axes(section, story, f"{view.title}, {story.time[moment]:.1f} s")
    section.set_ylabel("z  [m]")
    balls = draw_widest(near, story, moved, here, bridges, norm)
    colour_bar(figure, [section, near], balls, f"mean speed over {apart:.2g} s  [m/s]", extend="both", shrink=0.7, location="bottom", aspect=50)
    draw_sides(sides, story, place, speed, here, bridges)


def bond_lines(axes, place, bonds, width):
    """Bonds as dark lines with a light rim, seen along y."""
    ends = place[bonds][:, :, [0, 2]]
    for colour, more in (("white", 2.2), (INK, 0.0)):
        axes.add_collection(LineCollection(ends, colors=colour, linewidths=width + more, capstyle="round", zorder=4))


def draw_bridged_section(axes, story, moved, here, bridges, norm, is_open):
    stays = (story.fixed.kind == 1) | (not is_open)
    charts.discs(axes, charts.cut_by_plane(story.fixed.keep(stays)), facecolors=WALL, edgecolors="none")
    content = charts.cut_by_plane(moved.keep(here))
    discs = charts.discs(axes, content, cmap=RAINBOW, norm=norm, linewidths=0, alpha=0.55)
    discs.set_array(np.linalg.norm(content.velocity, axis=1))
    for bonds in bridges:
        if np.abs(moved.position[np.unique(bonds), 1]).mean() < story.diameter:
            bond_lines(axes, moved.position, bonds, 1.4)


def draw_widest(axes, story, moved, here, bridges, norm):
    """The surroundings of the widest bridge, seen across its span; other balls than those beside it are pale."""
    flat = lambda balls: moved.position[balls][:, :2]
    spans = [max(np.linalg.norm(flat(np.unique(b))[:, None] - flat(np.unique(b))[None], axis=2).ravel()) for b in bridges]
    bonds = bridges[int(np.argmax(spans))]
    members = np.unique(bonds)
    middle = moved.position[members].mean(axis=0)
    way = np.linalg.svd(flat(members) - middle[:2])[2][0]  # in which it extends most
    shifted = Frame(moved.position - [middle[0], middle[1], 0], moved.velocity, moved.radius, moved.kind)
    seen = turned(shifted, np.arctan2(way[1], way[0]))
    above, below = beside(moved.position, moved.radius, members, BESIDE * story.diameter)
    near = here & (np.abs(seen.position[:, 1]) < 1.5 * story.diameter)
    discs = None
    for mask, looks in ((near & ~above & ~below, {"facecolors": "#f0f1f4", "edgecolors": "#d9dce2"}),
                        (here & (above | below), {"cmap": RAINBOW, "norm": norm, "edgecolors": "white", "alpha": 0.8}),
                        (np.isin(np.arange(len(here)), members), {"cmap": RAINBOW, "norm": norm, "edgecolors": INK, "linewidths": 2.0})):
        size = 2 * seen.radius[mask]
        discs = axes.add_collection(EllipseCollection(size, size, np.zeros(len(size)), units="xy", offsets=seen.position[mask][:, [0, 2]],
                                                      offset_transform=axes.transData, **looks))
        if "cmap" in looks:
            discs.set_array(np.linalg.norm(seen.velocity[mask], axis=1))
    bond_lines(axes, seen.position, bonds, 2.6)
    speed = np.linalg.norm(moved.velocity, axis=1)
    coloured = here & (above | below)
    way_of = seen.velocity[coloured][:, [0, 2]]
    length = 0.9 * story.diameter * np.sqrt(np.clip(speed[coloured] / norm.vmax, 0, 1)) / np.maximum(speed[coloured], 1e-12)
    axes.quiver(*seen.position[coloured][:, [0, 2]].T, *(way_of * length[:, None]).T, color=INK, angles="xy", scale_units="xy", scale=1.0,
                width=0.005, zorder=5)
    reach = (BESIDE + 1.0) * story.diameter
    across = max(reach, np.abs(seen.position[members, 0]).max() + 2 * story.diameter)
    axes.set(xlim=(-across, across), ylim=(seen.position[members, 2].min() - reach, seen.position[members, 2].max() + reach), aspect="equal",
             xlabel="along the bridge  [m]")
    axes.set_title(f"the widest, {max(spans):.1f} m, {len(members)} balls\nabove {100 * mean(speed[above & here]):.1f}, below {100 * mean(speed[below & here]):.1f} cm/s",
                   loc="left", fontsize=11)
    return discs


def draw_sides(axes, story, place, speed, here, bridges):
    """Mean speeds above over those below, bridge by bridge."""
    rows = np.flatnonzero(here)
    found = []
    for bonds in bridges:
        above, below = beside(place[rows], story.radius[rows], np.searchsorted(rows, np.unique(bonds)), BESIDE * story.diameter)
        if above.any() and below.any():
            found.append((speed[rows][below].mean(), speed[rows][above].mean(), len(np.unique(bonds))))
    below, above, size = np.array(found).reshape(-1, 3).T
    if not len(size):
        return axes.set_axis_off()
    for mask, text, colour, area in ((size < 7, "4 to 6 balls", GREEN, 14), (size >= 7, "7 and more", RED, 34)):
        axes.scatter(100 * below[mask], 100 * above[mask], s=area, color=colour, alpha=0.7, lw=0, label=text)
    ends = 100 * np.array([min(below.min(), above.min()), max(below.max(), above.max())]) * [0.8, 1.25]
    axes.plot(ends, ends, color=INK, lw=1)
    axes.plot(ends, 0.1 * ends, color=INK, lw=1, ls=(0, (4, 3)))
    axes.text(ends[1], ends[1], "alike ", ha="right", va="bottom", fontsize=9)
    axes.text(ends[1], 0.1 * ends[1], "a tenth ", ha="right", va="bottom", fontsize=9)
    axes.set(xscale="log", yscale="log", xlim=ends, ylim=(0.5 * ends[0], ends[1]), xlabel="mean speed below  [cm/s]", ylabel="above  [cm/s]")
    axes.set_title(f"both sides of {len(size)} bridges", loc="left", fontsize=11)
    soft_grid(axes)
    axes.legend(frameon=False, title="balls in the bridge", fontsize=9, title_fontsize=9)


def draw_arches(figure, story):
    counts, beside = figure.subplots(2, 1, sharex=True)
    by_size = story["bridges_by_size"]
    shown = story.left > 0.02
    groups = (((2, 2), "2 balls", SKY), ((3, 3), "3", BLUE), ((4, 6), "4 to 6", GREEN), ((7, 11), "7 to 11", ORANGE), ((12, 99), "12 and more", RED))
    per = 1e3 / np.maximum(story.left * len(story.radius), 1)
    stack = [np.where(shown, per * by_size[:, a:b + 1].sum(axis=1), np.nan) for (a, b), _, _ in groups]
    stack = [running_mean(story.time, values, width=0.4 * MEAN_OVER) for values in stack]
    counts.stackplot(story.time, np.nan_to_num(stack), colors=[colour for _, _, colour in groups], labels=[name for _, name, _ in groups], lw=0)
    over_time(counts, story, "bridges per thousand\nballs of content", True)
    counts.legend(frameon=False, ncols=5, loc="upper center", title="balls in the bridge", fontsize=9, title_fontsize=9)
    counts.set_ylim(0, np.nanmax(np.nansum(stack, axis=0)) * 1.3)
    flowing = np.where(shown & (story.time > story.opened), 1.0, np.nan)
    for name, text, colour in (("speed_above_bridges", "above", BLUE), ("speed_below_bridges", "below", ORANGE)):
        beside.plot(story.time, flowing * story[name], color=colour, lw=0.7, alpha=0.4)
        beside.plot(story.time, running_mean(story.time, flowing * story[name]), color=colour, lw=2, label=text)
    over_time(beside, story, "mean speed of balls\nbeside bridges  [m/s]", xlabel="time  [s]")
    steady = story.steady_flow()
    if steady.any():
        beside.set_ylim(0, 2.0 * np.nanmax(story["speed_below_bridges"][steady]))
    beside.legend(frameon=False, loc="upper left")


# ------------------------------------------------------------------ Fig. 8, Table 2: pressures

def draw_wall(figure, story):
    pressure, discharge = story.wall["pressure"] / 1e3, np.flatnonzero(story.discharge)
    rest, moment = np.flatnonzero(story.rest), discharge_moment(story)
    maps = [(f"at rest, {story.time[rest[-1]]:.1f} s", pressure[rest[-1]])] if rest.size else []
    maps.append((f"{story.phase_at(moment).name}, {story.time[moment]:.1f} s", pressure[moment]))
    if discharge.size > 1:
        maps.append((f"mean of {discharge.size} moments of the discharge", pressure[discharge].mean(axis=0)))
    near = near_on_wall(story, NEAR * story.diameter)
    rows = [maps, [("", near @ values) for _, values in maps]]
    grid = figure.subplots(2, len(maps), sharex=True, sharey=True, squeeze=False)
    for line, (all_axes, row, text) in enumerate(zip(grid, rows, ("ball by ball", "mean of the surroundings"))):
        top = max(float(np.quantile(values, 0.98)) for _, values in row)
        if top <= 0:
            raise NothingToDraw("nothing presses on the wall")
        for axes, (title, values) in zip(all_axes, row):
            balls = unfolded(axes, story, values, Normalize(0, top))
            axes.set_title(title, loc="left", fontsize=11)
            axes.set_xlabel("around the wall from +x  [m]" if line else "")
        all_axes[0].set_ylabel(f"{text}\nup along the wall from the outlet  [m]")
        colour_bar(figure, list(all_axes), balls, "horizontal pressure  [kPa]", extend="max", aspect=24, shrink=0.85)


def near_on_wall(story, reach):
    """Weights (wall balls squared) that give each wall ball the mean of all within a distance, by their areas."""
    place = story.fixed.position[np.searchsorted(story.fixed_ids, story.wall["id"])]
    square = np.sum(place ** 2, axis=1)
    weight = (square[:, None] + square - 2 * place @ place.T <= reach ** 2) * story.wall["area"]
    return weight / weight.sum(axis=1, keepdims=True)


def unfolded(axes, story, values, norm):
    """The wall ball by ball, cut open at -x; the dashed line is the transition."""
    side = np.sqrt(story.wall["area"])
    place = np.column_stack([story.wall["around"], story.wall["along"]])
    balls = axes.add_collection(EllipseCollection(side, side, np.zeros(len(side)), units="xy", offsets=place, offset_transform=axes.transData,
                                                  cmap=LOADED, norm=norm, linewidths=0))
    balls.set_array(values)
    reach = np.abs(place[:, 0]).max() + story.diameter
    axes.set(xlim=(-reach, reach), ylim=(place[:, 1].min() - story.diameter, place[:, 1].max() + story.diameter), aspect="equal")
    away = np.abs(story.wall["z"] - story.joint)
    axes.axhline(np.median(story.wall["along"][away <= away.min() + 0.25 * story.diameter]), color=INK, lw=1, ls=(0, (4, 3)))
    return balls


THEORIES = (("janssen_by_layer", "Janssen", BLUE), ("water_by_layer", "water", SKY), ("frictionless_by_layer", "frictionless heap", PURPLE))


def draw_pressure(figure, story):
    found = extremes(story)
    levels, ratios = figure.subplots(1, 2, sharey=True, width_ratios=[1.25, 1])
    z = story.middles
    levels.fill_betweenx(z, found.lowest / 1e3, found.highest / 1e3, color=ORANGE, alpha=0.2, lw=0, label="discharge, from lowest to highest")
    levels.plot(found.mean / 1e3, z, color=ORANGE, lw=2, label="discharge, mean")
    levels.plot(found.static / 1e3, z, color=INK, lw=2, label="at rest")
    levels.plot(found.hammer / 1e3, z, color=RED, lw=1.4, ls=(0, (1, 1.2)), label="hammer, highest")
    for name, text, colour in THEORIES:
        if name in story.series and np.isfinite(story[name][story.rest]).any():
            levels.plot(mean_of_rows(story[name][story.rest]) / 1e3, z, color=colour, lw=1.4, ls=(0, (5, 3)), label=f"{text}, at rest")
    levels.set(xlabel="mean horizontal pressure of the layer  [kPa]", ylabel="height z  [m]", xlim=(0, None), ylim=(0, story.edges[-1]))
    levels.legend(frameon=False, fontsize=9.5)
    ratios.axvline(1, color=INK, lw=0.8)
    for values, text, colour in ((found.highest, "highest in discharge", ORANGE), (found.lowest, "lowest in discharge", GREEN),
                                 (found.hammer, "highest in the hammer", RED)):
        ratios.plot(found.ratio(values), z, "o-", color=colour, ms=4, label=text)
    ratios.set(xlabel="dynamic over static pressure", xlim=(0, None))
    for axes in (levels, ratios):
        axes.axhline(story.joint, color=MUTED, lw=1, ls=(0, (4, 3)))
        soft_grid(axes)
    levels.text(0.01, story.joint, "transition", va="bottom", transform=levels.get_yaxis_transform(), fontsize=9, color=MUTED)
    ratios.legend(frameon=False, fontsize=9.5, loc="upper right" if not np.nanmax(found.ratio(found.highest)) < 1.3 else "upper center")


def pressure_rows(story):
    """Rows of a table like the paper's Table 2, the highest layer first."""
    found = extremes(story)
    number = lambda value: "–" if not np.isfinite(value) else f"{value:.2f}"
    kilo = lambda value: "–" if not np.isfinite(value) else f"{value / 1e3:.1f}"
    theories = [mean_of_rows(story[name][story.rest]) if name in story.series and np.isfinite(story[name][story.rest]).any() else None
                for name, _, _ in THEORIES]
    titles = ["layer  [m]", "static  [kPa]", "discharge, mean", "lowest", "highest", "lowest / static", "highest / static", "hammer / static",
              *(f"{text}  [kPa]" for (_, text, _), values in zip(THEORIES, theories) if values is not None)]
    rows = [[f"{story.edges[k]:.2f} to {story.edges[k + 1]:.2f}", kilo(found.static[k]), kilo(found.mean[k]), kilo(found.lowest[k]), kilo(found.highest[k]),
             number(found.ratio(found.lowest)[k]), number(found.ratio(found.highest)[k]), number(found.ratio(found.hammer)[k]),
             *(kilo(values[k]) for values in theories if values is not None)] for k in reversed(range(len(found.static)))]
    return titles, rows


# ------------------------------------------------------------------ Fig. 9: one place through all phases

def draw_history(figure, story):
    grid = figure.add_gridspec(2, 2)
    whole, start, close = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    patch, layer = story.patch_pressure() / 1e3, story["pressure_by_layer"][:, story.transition] / 1e3
    windows = [(whole, None), (start, (0, story.opened + min(5.0, story.opened)))]
    if story.hammer_phase:
        windows.append((close, (story.hammer_phase.begin - 3.0 * story.hammer_span, story.hammer_phase.end + 3.0 * story.hammer_span)))
    else:
        close.set_axis_off()
    for axes, window in windows:
        window = window or (story.time[0], story.time[-1])
        inside = (story.time >= window[0]) & (story.time <= window[1])
        axes.plot(story.time[inside], patch[inside], color=ORANGE, lw=0.9 if axes is whole else 1.3, label="patch", marker="." if axes is not whole else None, ms=3)
        axes.plot(story.time[inside], layer[inside], color=INK, lw=1.5, label="mean of its layer")
        over_time(axes, story, "pressure  [kPa]", axes is whole, xlabel="time  [s]", xlim=window, ylim=(0, None))
    whole.legend(frameon=False, loc="upper right")
    start.set_title("filling, rest, opening", loc="left", fontsize=11)
    if story.hammer_phase:
        close.set_title("hammer", loc="left", fontsize=11)


# ------------------------------------------------------------------ unevenness of the pressure, lateral force

def draw_modes(figure, story):
    over, layers = figure.subplots(1, 2, width_ratios=[1.5, 1])
    k = story.transition
    shown = np.where((story.left > 0.1) & (story.time > 0.5), 100.0, np.nan)
    for m, colour in enumerate((PURPLE, SKY, GREEN)):
        values = shown * story["pressure_modes"][:, k, m]
        over.plot(story.time, running_mean(story.time, values), color=colour, lw=2 if m == 0 else 1.3, label=f"mode {m + 1}")
    over.fill_between(story.time, 0, running_mean(story.time, shown * story["pressure_scatter"][:, k]), color=GRID, lw=0, label="chance (rms)", zorder=1)
    over_time(over, story, "amplitude over the mean pressure  [%]", True, xlabel="time  [s]", ylim=(0, None))
    over.set_title(f"layer above the transition, mean over {MEAN_OVER:.0f} s", loc="left", fontsize=11, pad=18)
    over.legend(frameon=False, ncols=2)
    mask = story.discharge if story.discharge.any() else story.flow
    static = mean_of_rows(story["pressure_by_layer"][mask])
    heavy = static > FLOOR * np.nanmax(np.append(static, 0))
    if heavy.any():
        wave = lasting_wave(story, mask)
        layers.plot(100 * mean_of_rows(story["pressure_modes"][mask][:, :, 0])[heavy], story.middles[heavy], "o-", color=PURPLE, ms=4, label="mode 1 of a moment, mean")
        layers.plot(100 * np.abs(wave)[heavy], story.middles[heavy], "o-", color=ORANGE, ms=4, label="of it standing at one place")
        layers.plot(100 * mean_of_rows(story["pressure_scatter"][mask])[heavy], story.middles[heavy], color=MUTED, ls=(0, (4, 3)), label="chance (rms) in a moment")
    layers.set(xlabel="discharge: amplitude over the mean  [%]", ylabel="height z  [m]", xlim=(0, None), ylim=(0, story.edges[-1]))
    layers.legend(frameon=False, fontsize=9)
    soft_grid(layers)


def draw_lateral(figure, story):
    grid = figure.add_gridspec(2, 2)
    over, slow, fast = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    force = story["lateral_force"] / 1e3
    for a, (name, colour) in enumerate((("x", BLUE), ("y", ORANGE))):
        over.plot(story.time, force[:, a], color=colour, lw=1, label=f"{name}")
    top = np.nanquantile(np.abs(force[story.time > story.opened]), 0.998) if (story.time > story.opened).any() else np.abs(force).max()
    over_time(over, story, "lateral force\non the wall  [kN]", True, xlabel="time  [s]", ylim=(-1.3 * top, 1.3 * top) if top > 0 else None)
    over.legend(frameon=False, ncols=2, loc="lower right")
    for axes, mask, title in ((slow, story.flow, "flow"), (fast, story.hammer, "hammer")):
        frames = even_run(story, mask)
        if len(frames) < 16:
            axes.text(0.5, 0.5, f"{title}: too few even frames", ha="center", color=MUTED, transform=axes.transAxes)
            axes.set_axis_off()
            continue
        for a, colour in enumerate((BLUE, ORANGE)):
            frequency, density = spectrum(story.time[frames], force[frames, a], 7 if len(frames) >= 128 else 1)
            axes.loglog(frequency[1:], density[1:], color=colour, lw=1.2)
        step = np.diff(story.time[frames]).mean()
        axes.set(xlabel="frequency  [Hz]", ylabel="spectral density  [kN²/Hz]")
        axes.set_title(f"{title}: {len(frames)} frames, {step:.3g} s apart", loc="left", fontsize=11)
        soft_grid(axes)


# ------------------------------------------------------------------ hammer and crystals

def draw_hammer(figure, story):
    axes = figure.subplots(1, 2, sharey=True)
    for (name, time, pressure, static, before), colour in zip(hammer_curves(story), (INK, ORANGE, RED, BLUE)):
        axes[0].plot(time, pressure / static, color=colour, lw=1.8, label=name)
        axes[1].plot(time, pressure / before, color=colour, lw=1.8)
    for one, text in zip(axes, ("over the static pressure", "over its mean in the 20 s before")):
        one.axhline(1, color=INK, lw=0.8)
        one.set(xlabel="time after closing  [s]", ylabel=f"pressure {text}", ylim=(0, None))
        one.yaxis.set_tick_params(labelleft=True)
        soft_grid(one)
    axes[0].legend(frameon=False, fontsize=9, loc="lower right")


def draw_crystals(figure, story):
    axes = figure.subplots()
    shown = np.where(story.left > 0.02, 1.0, np.nan)
    axes.plot(story.time, 100 * shown * story["crystalline_share"], color=PURPLE, lw=1.8, label="balls in crystals")
    axes.plot(story.time, 100 * shown * story["global_q6"], color=GREEN, lw=1.4, label="bond order of the whole heap, global q6 × 100")
    top = np.nanmax(100 * shown * np.maximum(story["crystalline_share"], story["global_q6"]))
    over_time(axes, story, "share of the content  [%]", True, xlabel="time  [s]", ylim=(0, max(5.0, 1.3 * top)))
    axes.legend(frameon=False)


# ------------------------------------------------------------------ all charts

CHARTS = {chart.name: chart for chart in (
    Chart("story", "", draw_story, fixed(12, 5.6)),
    Chart("density", "", draw_density, fixed(12, 7.6)),
    Chart("layers", "", draw_layers, fixed(7.5, 5.6)),
    Chart("surface", "", draw_surface, fixed(13.5, 5.4)),
    Chart("lattice", "", draw_lattice, fixed(10.5, 10)),
    Chart("forces", "", draw_forces, fixed(13, 5)),
    views_chart("filling", filling_views),
    views_chart("unsymmetrical", unsymmetrical_views),
    views_chart("stoppage", stoppage_views),
    views_chart("meandering", meandering_views),
    views_chart("closing", hammer_views),
    Chart("motion", "", draw_motion, fixed(12, 6.6)),
    Chart("meander", "", draw_meander, fixed(13, 5)),
    Chart("beats", "", draw_beats, fixed(12, 5.6)),
    Chart("bridges", "", draw_bridges, fixed(15, 8.6)),
    Chart("arches", "", draw_arches, fixed(12, 6.8)),
    Chart("wall", "", draw_wall, fixed(15, 8.4)),
    Chart("pressure", "", draw_pressure, fixed(13, 7)),
    Chart("history", "", draw_history, fixed(13, 7)),
    Chart("modes", "", draw_modes, fixed(13.5, 5.4)),
    Chart("lateral", "", draw_lateral, fixed(13, 7)),
    Chart("hammer", "", draw_hammer, fixed(13, 5.4)),
    Chart("crystals", "", draw_crystals, fixed(12, 3.8)),
)}
