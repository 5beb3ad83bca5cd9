"""What the notebook of an ensemble shows: the runs, charts and tables.

GRAINCLOCK_ENSEMBLE names a directory of benchmarks/ensemble/ensemble.py; relative paths start at the repository.
"""

import os
import sys
from pathlib import Path

from IPython.display import Image, Markdown, display

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "benchmarks"))
import charts
import ensemble_charts
import ensemble_data
from page_outputs import show_table, small_png

if not os.environ.get("GRAINCLOCK_ENSEMBLE"):
    raise SystemExit("GRAINCLOCK_ENSEMBLE names no directory of runs; benchmarks/ensemble/run.sh makes them and their page")
ensemble = ensemble_data.read_ensemble(ROOT / os.environ["GRAINCLOCK_ENSEMBLE"])


def which_runs():
    """One line that says of which runs all that follows is."""
    story = next(iter(ensemble.base.stories.values()))
    variants = "; ".join(f"{variant.text}, seeds {', '.join(map(str, variant.stories))}" for variant in ensemble.variants.values())
    missing = f" {ensemble.missing} members of the ensemble are not finished, and not here." if ensemble.missing else ""
    display(Markdown(f"*The runs: {len(story.radius):,} balls; {variants}. Phases: {', '.join(f'{phase.name} to {phase.end:.4g} s' for phase in story.phases)}.{missing}*"))


def show(name, *shown):
    """What a variant has to say against the base, and charts of ensemble_charts; one line where the ensemble has none of it."""
    if name not in ensemble.variants:
        display(Markdown(f"*No finished run of {name}.*"))
        return
    if name != ensemble.base.name:
        try:
            display(Markdown(ensemble_charts.verdict(ensemble, name)))
        except charts.NothingToDraw as reason:
            display(Markdown(f"*No intervals: {reason}.*"))
    for chart in shown:
        try:
            figure = ensemble_charts.figure_of(chart, ensemble, name)
        except charts.NothingToDraw as reason:
            display(Markdown(f"*No {chart} chart: {reason}.*"))
        else:
            display(Image(small_png(figure), metadata={"alt": f"{chart} chart of {name}"}))


def walls_table():
    show_table(*ensemble_charts.relief_rows(ensemble))


def numbers_tables():
    show_table(*ensemble_charts.number_rows(ensemble))
    show_table(*ensemble_charts.difference_rows(ensemble))
