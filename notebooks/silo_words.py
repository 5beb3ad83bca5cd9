"""What a silo's run shows, in sentences with figures: one function per section of the notebooks. Each raises NothingToDraw where the
run has nothing to tell."""

import numpy as np

from charts import NothingToDraw, amount, short
from silo_data import (BUSY, FLOOR, MEAN_OVER, OVER, chance_of_flux, even_run, extremes, hammer_curves, lasting_wave, mean, mean_flux_mode,
                       mean_of_rows, overpressure, percent, rates, spectrum, total_force)


def some(mask, what):
    if not mask.any():
        raise NothingToDraw(f"the run has no {what}")
    return mask


def kilo(pascal):
    return f"{pascal / 1e3:.0f} kPa"


def which(run):
    silo, stepping = run.scene["silo"], run.scene["stepping"]
    steps = f"{stepping['method']} steps" + (f" of {short(stepping['step'])} s" if "step" in stepping else "")
    return (f"The run: {len(run.radius):,} balls in a {silo.get('shape', 'round')} silo, seed {run.seed}, {steps}, dampers of {short(run.scene['contact']['c_ball'])} and "
            f"{short(run.scene['contact']['c_wall'])} N s/m (balls, wall), {len(run.time)} frames measured; grainclock {run.version}.")


def story(run):
    phases = ", ".join(f"{phase.name} to {phase.end:.1f} s" for phase in run.phases)
    rate, apart = rates(run)
    flow = f" In flow {rate.mean():.0f} balls/s leave ({rate.min():.0f} to {rate.max():.0f} between frames)." if rate.size else ""
    return (f"{len(run.radius):,} balls, seed {run.seed}: {phases}. At the end, {run.time[-1] - run.opened:.0f} s after the outlet was first opened, "
            f"{percent(run.left[-1])} of the content is still there.{flow}")


def density(run):
    texts = []
    for mask, name in ((run.filling & run.settled, "filling, once the content is a heap"), (run.discharge, "discharge up to the hammer"),
                       (run.hammer, "hammer")):
        excess, z = run["density_peak_excess"][mask], run["density_peak_z"][mask]
        if np.isfinite(excess).any():
            texts.append(f"{name}: up to {percent(np.nanmax(excess), 1)}, mean {percent(mean(excess), 1)}, "
                         f"at a height of {np.nanmedian(z):.1f} m (median)")
    if not texts:
        raise NothingToDraw("the content never is a heap")
    return ("Highest density over the mean, each place taken with its 12 nearest balls: " + "; ".join(texts) +
            f". The transition is at {run.joint:.1f} m. The mean packing fraction is {mean(run['density'][run.rest]):.3f} at rest and "
            f"{mean(run['density'][run.discharge]):.3f} in the discharge.")


def surface(run):
    flow = some(run.steady_flow(), "flow")
    rise, height = run["surface_rise"][flow], run["surface_height"][flow]
    inner = mean(height[:, -2] - height[:, 0])  # the outermost ring holds balls that the wall keeps from standing there
    text = (f"At rest the surface at the wall is {100 * mean(run['surface_rise'][run.rest]):+.0f} cm above that at the axis; in flow (while at least "
            f"{percent(BUSY)} is there) {100 * mean(rise):+.0f} cm on the mean, {100 * np.nanmax(rise):+.0f} cm at most; it is concave in "
            f"{percent(np.mean(rise > 0))} of the frames. A dish of {100 * mean(rise):.0f} cm is {mean(rise) / run.diameter:.1f} ball diameters deep.")
    return text + (f" From the innermost ring to the last but one the surface rises by {100 * inner:.0f} cm on the mean." if np.isfinite(inner) else "")


def forces(run):
    busy = some(run.discharge, "discharge")
    bins = run.force_edges[:-1] >= 3
    strong = (run["force_distribution"][busy].mean(axis=0) * np.diff(run.force_edges))[bins].sum()
    return (f"In the discharge {percent(run['chain_share'][busy].mean())} of the balls are in compression chains and {percent(run['unloaded_share'][busy].mean(), 1)} "
            f"bear next to nothing (no push above a tenth of the mean). The mean contact pushes with {run['force_mean'][busy].mean() / 1e3:.1f} kN; "
            f"the share of forces above three times the mean is {percent(strong, 1)} (an exponential distribution: {percent(np.exp(-3), 1)}).")


def asymmetry(run):
    steady = some(run.steady_flow(), "flow")
    moment, lasting = run["flux_asymmetry"][steady, 0], np.abs(mean_flux_mode(run))[steady]
    return (f"Mode 1 of the flux through the transition is {percent(mean(moment), 1)} of the flux between frames, and at most "
            f"{percent(np.nanmax(lasting), 1)} as a mean over {MEAN_OVER:.0f} s; balls at random azimuths would show {percent(chance_of_flux(run), 1)}. "
            f"{percent(mean(run['intensive_share'][steady]))} of the content moves faster than the mean sinking speed of {100 * run['flux_speed'][steady].mean():.1f} cm/s, "
            f"{percent(mean(run['resting_share'][steady]), 1)} slower than a tenth of it.")


def stoppages(run):
    steady = some(run.steady_flow(), "flow")
    speed = run["flux_speed"][steady]
    rate, apart = rates(run)
    told = (f" Between frames {np.median(apart):.2g} s apart never fewer than {rate.min():.0f} balls/s left (mean {rate.mean():.0f})."
            if rate.size and rate.min() > 0 else f" In {np.sum(rate == 0)} of {len(rate)} intervals between frames nothing left." if rate.size else "")
    return (f"The content sinks with {percent(speed.min() / speed.mean())} to {percent(speed.max() / speed.mean())} of its mean speed "
            f"(standard deviation {percent(speed.std() / speed.mean())}).{told} Stops shorter than the frames are apart do not show.")


def meandering(run):
    steady = some(run.steady_flow(), "flow")
    centroid = run["flux_centroid"][steady]
    step = np.linalg.norm(np.diff(centroid, axis=0), axis=1)
    lasting = np.array([mean(centroid[:, 0]), mean(centroid[:, 1])])
    half_width = run.scene["silo"].get("radius", 0.5 * run.scene["silo"].get("width", 10.0))
    return (f"The centroid of the flux through the transition wanders by {np.nanstd(centroid[:, 0]):.2f} m in x and {np.nanstd(centroid[:, 1]):.2f} m in y "
            f"(standard deviation), about ({lasting[0]:.2f}, {lasting[1]:.2f}) m, in a section of {half_width:.1f} m radius; by up to {np.nanmax(step):.2f} m "
            f"from one frame to the next.")


def arches(run):
    busy = some(run.discharge, "discharge")
    count = run["bridges"][busy]
    many = run["bridges_by_size"][busy].mean(axis=0)
    above, below = run["speed_above_bridges"][busy], run["speed_below_bridges"][busy]
    return (f"In the discharge {percent(mean(run['bridge_share'][busy]))} of the balls are in {count.mean():,.0f} bridges at a time, {percent(many[2] / max(count.mean(), 1))} of "
            f"them of two balls; {many[7:].sum():.0f} have seven and more, and the widest spans {np.nanmax(run['bridge_widest'][busy]):.1f} m. "
            f"{percent(mean(run['bridges_on_wall'][busy] / np.maximum(count, 1)))} stand on the wall. Balls above bridges move at {percent(mean(above) / mean(below))} of the speed of those "
            f"below; part of that is only that lower balls are faster anyway.")


def pressure(run):
    found = extremes(run)
    k = run.transition
    ratio = found.ratio(found.highest)
    lowest = np.where(run.covered(run.discharge), found.ratio(found.lowest), np.nan)
    top = int(np.nanargmax(found.highest))
    text = (f"At rest the layer above the transition has {kilo(found.static[k])}, in the discharge {kilo(found.mean[k])} on the mean, "
            f"{kilo(found.lowest[k])} to {kilo(found.highest[k])}. The highest layer mean in the discharge is {kilo(found.highest[top])} at {run.middles[top]:.1f} m. ")
    if np.isfinite(ratio).any():
        worst = int(np.nanargmax(ratio))
        text += f"Dynamic over static pressure by layer is {ratio[worst]:.2f} at most (at {run.middles[worst]:.1f} m)"
        text += f" and {np.nanmin(lowest):.2f} at least in layers that stay covered" if np.isfinite(lowest).any() else ""
        text += f" (layers with a static pressure above {percent(FLOOR)} of the largest)."
    for name, what in (("janssen_by_layer", "Janssen's formula, with the friction and the lateral ratio of the state at rest,"), ("water_by_layer", "Water"),
                       ("frictionless_by_layer", "Frictionless material")):
        value = mean_of_rows(run[name][run.rest]) if name in run.series else np.array([np.nan])
        if np.isfinite(value).any() and np.nanmax(value) > 0:
            heavy = np.where(value > FLOOR * np.nanmax(value), value, np.nan)
            text += (f" {what} would give {kilo(value[k])} there; layer by layer the pressure is {np.nanmin(found.static / heavy):.2f} to {np.nanmax(found.static / heavy):.2f} times "
                     f"that at rest, and {np.nanmax(found.highest / heavy):.2f} times at most in the discharge.")
    return text


def history(run):
    patch = run.patch_pressure()
    peak, rest = int(np.argmax(patch)), run.rest
    texts = [f"The patch ({np.sum(run.patch)} wall balls above the transition at +x) peaks at {kilo(patch[peak])} at {run.time[peak]:.1f} s ({run.phase_at(peak).name})"]
    for mask, name in ((rest, "at rest"), (run.discharge, "in the discharge"), (run.hammer, "in the hammer")):
        if mask.any():
            texts.append(f"{name} {kilo(patch[mask].mean())} (up to {kilo(patch[mask].max())})")
    return "; ".join(texts) + "."


def modes(run):
    busy, k = some(run.discharge, "discharge"), run.transition
    amplitude, chance = run["pressure_modes"][busy][:, k, 0], run["pressure_scatter"][busy][:, k]
    return (f"In the layer above the transition mode 1 of a moment is {percent(mean(amplitude))} of the mean pressure, above twice its chance value in "
            f"{percent(np.mean(amplitude > 2 * chance))} of the frames (chance, if balls were loaded independently: {percent(mean(chance))}). What of it stands at one place over the discharge is "
            f"{percent(np.abs(lasting_wave(run, busy))[k], 1)}.")


def lateral(run):
    busy = some(run.discharge, "discharge")
    force, total = run["lateral_force"][busy] / 1e3, total_force(run)[busy].mean() / 1e3
    size = np.linalg.norm(force, axis=1)
    text = (f"In the discharge the lateral force is {np.sqrt(np.mean(size ** 2)):.0f} kN (rms; at most {size.max():.0f} kN), {percent(np.sqrt(np.mean(size ** 2)) / total, 2)} of the "
            f"{total / 1e3:.1f} MN that press on the wall all around; its mean is ({force[:, 0].mean():.0f}, {force[:, 1].mean():.0f}) kN.")
    frames = even_run(run, run.flow)
    if len(frames) >= 128:
        found = [spectrum(run.time[frames], run["lateral_force"][frames, a], 7) for a in (0, 1)]
        frequency, density = found[0][0], found[0][1] + found[1][1]
        low = (frequency > 0) & (frequency <= 0.5 * frequency[-1])
        text += (f" Its spectrum over {len(frames)} even frames is {np.mean(density[low]) / np.mean(density[frequency > 0.5 * frequency[-1]]):.2f} times as strong in the lower half as in the "
                 f"upper half of the resolved frequencies (up to {frequency[-1]:.2g} Hz); 1 would be white noise.")
    return text


def hammer(run):
    texts = []
    for name, time, values, static, before in hammer_curves(run):
        over_static, over_before = overpressure(time, values, static), overpressure(time, values, before)
        lasts = lambda found: f"{found.lasts:.2f} s above {1 + OVER:.1f}" if found.lasts > 0 else f"never above {1 + OVER:.1f}"
        texts.append(f"{name}: at most {over_static.highest:.2f} times its static pressure ({lasts(over_static)}), and {over_before.highest:.2f} times its mean over the "
                     f"20 s before ({lasts(over_before)})")
    return f"Within {run.hammer_span:.2g} s after closing, " + "; ".join(texts) + "."


def crystals(run):
    share = np.where(run.left >= BUSY, run["crystalline_share"], np.nan)
    peak = int(np.nanargmax(share))
    busy = np.flatnonzero(run.discharge)
    grows = f", {percent(share[busy[-1]])} at the end of the discharge before the hammer" if busy.size else ""
    return (f"At rest {percent(mean(run['crystalline_share'][run.rest]), 1)} of the balls are in crystals{grows}, and {percent(share[peak])} at most (at {run.time[peak]:.0f} s, "
            f"{percent(run.left[peak])} left), although radii differ by up to {percent(run.radius.max() / run.radius.min() - 1, 1)}.")
