"""Charts and sentences of an ensemble of silo runs, from ensemble_data.read_ensemble().

As a module: CHARTS, by name; every draw(figure, ensemble, name) fills an empty figure with the variant `name` beside the base (the base alone
where it is the base itself), and raises NothingToDraw where there is nothing to show. ensemble.ipynb puts them together.
"""

import numpy as np
from matplotlib.ticker import MaxNLocator

from ensemble_data import (CONFIDENCE, PRESSURE, QUANTITIES, at_rest, charts, flow_over_static, hammer_over_static, highest_over_static, in_flow, of_flow,
                           of_rest, pressure_above_transition, rate_over_time, relief, rest_of, series, steady, time_grid, uneven_around, whole)
from charts import INK, MUTED, NothingToDraw, soft_grid

BASE, OTHER, RED = "#0072b2", "#d55e00", "#b2182b"
SHUT = "#f7d7cf"     # the hammer
REACH = 60.0         # %, of the chart of numbers
THEORIES = (("janssen_by_layer", "Janssen", "#009e73"), ("frictionless_by_layer", "frictionless", "#8c5aa8"), ("water_by_layer", "water", "#56b4e9"))


# ------------------------------------------------------------------ bands

def draw_band(axes, place, found, colour, label, along_x=True):
    """Mean, its interval (band), the lowest and the highest run (thin lines: of few runs the interval is the wider one)."""
    fill = axes.fill_between if along_x else axes.fill_betweenx
    fill(place, found.low, found.high, color=colour, alpha=0.25, lw=0)
    for values, width, text in ((found.min, 0.6, None), (found.max, 0.6, None), (found.mean, 1.8, label)):
        axes.plot(*((place, values) if along_x else (values, place)), color=colour, lw=width, label=text)


def legend_above(figure, axes, side="left"):
    """Over all panels, where it hides nothing."""
    figure.get_layout_engine().set(rect=(0, 0, 1, 1 - 0.28 / figure.get_figheight()))
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, fontsize=9.5, ncols=len(labels), loc=f"upper {side}")


def label_of(variant):
    return f"{variant.text} ({len(variant.stories)})"


def shown(ensemble, name):
    """The variants of a chart with their colours: the base, and the other one."""
    base = ensemble.base
    return [(base, BASE)] + ([(ensemble[name], OTHER)] if name != base.name else [])


def height_axes(axes, ensemble, xlabel):
    story = next(iter(ensemble.base.stories.values()))
    axes.axhline(story.joint, color=MUTED, lw=1, ls=(0, (4, 3)))
    axes.set(xlabel=xlabel, ylim=(0, story.edges[-1]))
    soft_grid(axes)
    return story.middles


# ------------------------------------------------------------------ charts

def draw_pressure(figure, ensemble, name):
    """Layer pressures of one variant beside theory, at rest and in the discharge, and ratios to the static ones."""
    variant = ensemble[name]
    panels = figure.subplots(1, 3, sharey=True, width_ratios=[1, 1, 1])
    for axes, of, title in ((panels[0], at_rest, "at rest"), (panels[1], in_flow, "in the discharge")):
        z = height_axes(axes, ensemble, f"pressure of the layer {title}  [kPa]")
        draw_band(axes, z, scaled(variant.envelope(of(PRESSURE)), 1e-3), BASE, label_of(variant), along_x=False)
        for theory, text, colour in THEORIES:
            axes.plot(1e-3 * variant.envelope(of(theory)).mean, z, color=colour, lw=1.4, ls=(0, (5, 3)), label=text)
    widest = max(axes.get_xlim()[1] for axes in panels[:2])
    for axes in panels[:2]:
        axes.set_xlim(0, widest)
    z = height_axes(panels[2], ensemble, "dynamic over static pressure")
    panels[2].axvline(1, color=INK, lw=0.8)
    for of, text, colour in ((flow_over_static, "discharge, mean", BASE), (highest_over_static, "discharge, highest", OTHER), (hammer_over_static, "hammer, highest", RED)):
        draw_band(panels[2], z, variant.envelope(of), colour, text, along_x=False)
    panels[2].set_xlim(0, None)
    panels[0].set_ylabel("height z  [m]")
    panels[0].legend(frameon=False, fontsize=9.5)
    legend_above(figure, panels[2], "right")


def scaled(found, factor):
    return type(found)(found.n, *(factor * values for values in (found.mean, found.low, found.high, found.min, found.max)))


def draw_time(figure, ensemble, name):
    """Rate, density, crystals and the pressure above the transition over time."""
    time = time_grid(ensemble)
    story = next(iter(ensemble.base.stories.values()))
    shut = story.hammer_phase
    rows = ((rate_over_time(time), 1, "discharge\n[balls/s]"), (series("density", time), 1, "packing\nfraction"),
            (series("crystalline_share", time), 100, "balls in\ncrystals  [%]"), (pressure_above_transition(time), 1e-3, "pressure above\ntransition  [kPa]"))
    all_axes = figure.subplots(len(rows), 1, sharex=True)
    for axes, (of, factor, text) in zip(all_axes, rows):
        for variant, colour in shown(ensemble, name):
            draw_band(axes, time, scaled(variant.envelope(of), factor), colour, label_of(variant))
        axes.axvline(0, color=MUTED, lw=1)
        if shut:
            axes.axvspan(shut.begin - story.opened, shut.end - story.opened, color=SHUT, lw=0, zorder=0)
        axes.set_ylabel(text)
        soft_grid(axes)
    all_axes[1].margins(y=0.3)
    all_axes[2].set_ylim(0, None)  # intervals of few runs reach below
    all_axes[-1].set(xlabel="time since the opening  [s]", xlim=(time[0], time[-1]))
    legend_above(figure, all_axes[0])


def draw_layers(figure, ensemble, name):
    """Profiles of a variant beside the base's, and below them the differences."""
    if name == ensemble.base.name:
        raise NothingToDraw("the base has nothing to differ from")
    columns = ((at_rest(PRESSURE), 1e-3, "pressure at rest", "kPa"), (in_flow(PRESSURE), 1e-3, "in the discharge", "kPa"),
               (whole(at_rest("packing_by_layer")), 100, "packing fraction at rest", "%"), (whole(in_flow("packing_by_layer")), 100, "in the discharge", "%"))
    top, below = figure.subplots(2, len(columns), sharey=True)
    for axes, difference_axes, (of, factor, text, unit) in zip(top, below, columns):
        z = height_axes(axes, ensemble, f"{text}  [{unit}]")
        for variant, colour in shown(ensemble, name):
            draw_band(axes, z, scaled(variant.envelope(of), factor), colour, label_of(variant), along_x=False)
        height_axes(difference_axes, ensemble, f"difference  [{unit}]")
        for panel in (axes, difference_axes):
            panel.xaxis.set_major_locator(MaxNLocator(4))
        found = ensemble.difference(name, of)
        difference_axes.axvline(0, color=INK, lw=0.8)
        difference_axes.hlines(z, factor * found.low, factor * found.high, color=OTHER, lw=2.5, alpha=0.45)
        difference_axes.plot(factor * found.mean, z, "o", color=OTHER, ms=4)
        difference_axes.plot(factor * found.mean[found.differs], z[found.differs], "o", ms=10, mfc="none", mec=RED, mew=1.4)
    for axes in (top[0], below[0]):
        axes.set_ylabel("height z  [m]")
    legend_above(figure, top[0])


def draw_uneven(figure, ensemble, name):
    """How much the sectors of a layer differ in pressure."""
    for axes, mask_of, text in zip(figure.subplots(1, 2, sharey=True), (rest_of, steady), ("at rest", "in the discharge, mean over it")):
        z = height_axes(axes, ensemble, f"sectors differ {text}  [%]")
        for variant, colour in shown(ensemble, name):
            draw_band(axes, z, scaled(variant.envelope(uneven_around(mask_of)), 100), colour, label_of(variant), along_x=False)
        axes.set_xlim(0, None)
    figure.axes[0].set_ylabel("height z  [m]")
    legend_above(figure, figure.axes[0])


def draw_numbers(figure, ensemble, name):
    """Differences of all numbers over the base's mean, with the base's runs as a measure of what seeds do."""
    if name == ensemble.base.name:
        raise NothingToDraw("the base has nothing to differ from")
    axes = figure.subplots()
    for k, quantity in enumerate(QUANTITIES):
        base, found = ensemble.base.envelope(quantity.of), ensemble.difference(name, quantity.of)
        if not base.mean:
            continue
        percent = 100 / abs(base.mean)
        place = percent * float(found.mean)
        axes.plot(percent * (np.array([base.min, base.max]) - base.mean), [k, k], color=BASE, lw=9, alpha=0.18, solid_capstyle="butt")
        axes.plot(percent * np.array([found.low, found.high]), [k, k], color=OTHER, lw=2.5, alpha=0.6)
        beyond = bool(abs(place) > REACH)
        axes.plot(np.clip(place, -REACH, REACH), k, (">" if place > 0 else "<") if beyond else "o", color=OTHER, ms=7 if beyond else 5,
                  mec=RED if found.differs else OTHER, mew=1.5, clip_on=False)
        told = ["differs"] * bool(found.differs) + [f"{place:+.0f} %".replace("-", "\N{MINUS SIGN}")] * beyond
        axes.annotate(", ".join(told), (1, k), xycoords=("axes fraction", "data"), xytext=(8, 0), textcoords="offset points", fontsize=9, va="center",
                      color=RED if found.differs else MUTED)
    axes.axvline(0, color=INK, lw=0.8)
    axes.set_yticks(range(len(QUANTITIES)), [quantity.text for quantity in QUANTITIES])
    axes.set(ylim=(len(QUANTITIES) - 0.5, -0.5), xlabel="difference over the base's mean  [%]; blue: the base's runs")
    axes.tick_params(axis="y", length=0, pad=9, labelcolor=INK, labelsize=9.5)
    axes.set_xlim(-REACH, REACH)
    axes.grid(True, axis="x", color="#e3e6ea", lw=0.8)


CHARTS = {
    "pressure": (draw_pressure, (13, 6)),
    "time": (draw_time, (9, 8.4)),
    "layers": (draw_layers, (13, 9)),
    "uneven": (draw_uneven, (9, 5.4)),
    "numbers": (draw_numbers, (9.5, 8.6)),
}


def figure_of(chart, ensemble, name):
    """A chart of CHARTS for a variant, as a figure. Raises NothingToDraw."""
    draw, size = CHARTS[chart]
    figure = charts.Figure(figsize=size, layout="constrained")
    draw(figure, ensemble, name)
    return figure


# ------------------------------------------------------------------ tables and sentences

def with_interval(found, digits):
    """Mean ± half its interval (lowest to highest run)."""
    if not np.isfinite(found.mean):
        return "–"
    half = f" ± {found.mean - found.low:.{digits}f}" if np.isfinite(found.low) else ""
    return f"{found.mean:.{digits}f}{half} ({found.min:.{digits}f} to {found.max:.{digits}f})"


def number_rows(ensemble):
    """Titles and rows of the table of all numbers, a column per variant."""
    variants = list(ensemble.variants.values())
    return (["", *(label_of(variant) for variant in variants)],
            [[quantity.text, *(with_interval(variant.envelope(quantity.of), quantity.digits) for variant in variants)] for quantity in QUANTITIES])


def difference_rows(ensemble):
    """Titles and rows of the differences to the base."""
    others = [variant for variant in ensemble.variants.values() if variant is not ensemble.base]

    def cell(quantity, variant):
        found = ensemble.difference(variant.name, quantity.of)
        if not np.isfinite(found.low):
            return "–"
        return f"{found.mean:+.{quantity.digits}f} [{found.low:+.{quantity.digits}f}, {found.high:+.{quantity.digits}f}]" + (" differs" if found.differs else "")

    return (["difference to the base, 95 % interval", *(label_of(variant) + (", paired" if ensemble.is_paired(variant.name) else "") for variant in others)],
            [[quantity.text, *(cell(quantity, variant) for variant in others)] for quantity in QUANTITIES])


def relief_rows(ensemble):
    """How rough the walls are, and what friction they have."""
    rows = []
    for variant in ensemble.variants.values():
        story = next(iter(variant.stories.values()))
        if story.scene["silo"].get("shape", "round") != "round":
            continue
        wall = relief(story)
        rows.append([variant.text, f"{int(np.sum(story.fixed.kind == 1)):,}", f"{1e3 * wall.rms:.0f}", f"{1e3 * wall.range:.0f}", f"{wall.slope:.2f}",
                     f"{wall.slope_up:.2f}", *(with_interval(variant.envelope(of("wall_friction")), 3) for of in (of_rest, of_flow))])
    return ["wall", "balls", "relief, rms  [mm]", "farthest to nearest  [mm]", "slope, rms", "... along the axis", "friction at rest", "in the discharge"], rows


def verdict(ensemble, name):
    """How many of the layers and numbers differ from the base."""
    texts = []
    for of, text in ((at_rest(PRESSURE), "pressures at rest"), (in_flow(PRESSURE), "pressures in the discharge")):
        found = ensemble.difference(name, of)
        known = np.isfinite(found.low)
        if known.any():
            scale = np.nanmax(ensemble.base.envelope(of).mean)
            texts.append(f"{text}: {int(found.differs.sum())} of {int(known.sum())} layers differ; differences are {100 * np.nanmax(np.abs(found.mean)) / scale:.1f} % of the largest "
                         f"pressure at most, their intervals ± {100 * np.nanmedian(found.high - found.mean) / scale:.2g} % (median)")
    told = [(quantity, ensemble.difference(name, quantity.of)) for quantity in QUANTITIES]
    known = [(quantity, found) for quantity, found in told if np.isfinite(found.low)]
    if not known:
        raise NothingToDraw(f"the variant {name} has too few runs for an interval")
    texts.append(f"{sum(bool(found.differs) for _, found in known)} of {len(known)} numbers differ")
    how = "pairs of runs that share the filling" if ensemble.is_paired(name) else "independent runs (Welch)"
    sentence = lambda text: text[:1].upper() + text[1:]
    return (sentence(f"{ensemble[name].text} against {ensemble.base.text}, {how}. ") + sentence("; ".join(texts)) +
            f". Where nothing differs in truth, {100 * (1 - CONFIDENCE):.0f} % of the intervals miss 0 by chance.")
