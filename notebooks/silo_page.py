"""What the notebooks of a silo's run share: the run, and charts and sentences as outputs that GitHub shows too.

GRAINCLOCK_RUN names a run.h5 or its directory, GRAINCLOCK_MEASURES what `grainclock measure` made of it (default: measures.h5 beside
it); relative paths start at the repository. build.sh sets both.
"""

import json
import os
import re
import sys
from pathlib import Path

from IPython.display import Image, Markdown, display

NOTEBOOKS = Path(__file__).resolve().parent
ROOT = NOTEBOOKS.parent
sys.path.insert(0, str(ROOT / "benchmarks"))
import charts
import dense_charts
import silo_charts
import silo_data
import silo_words
from page_outputs import show_table, small_png

if not os.environ.get("GRAINCLOCK_RUN"):
    raise SystemExit("GRAINCLOCK_RUN names no run.h5; notebooks/build.sh RUN measures a run and makes pages of it")
measures = os.environ.get("GRAINCLOCK_MEASURES")
story = silo_data.read_story(ROOT / os.environ["GRAINCLOCK_RUN"], ROOT / measures if measures else None)


def which_run():
    """One line that says of which run all that follows is."""
    display(Markdown(f"*{silo_words.which(story)}*"))


def beside(paper, ours):
    """The paper's statement and this run's figures, side by side; `ours` is a function of silo_words."""
    try:
        told = ours(story)
    except charts.NothingToDraw as reason:
        told = f"Nothing to tell: {reason}."
    show_table(["The paper", "This run"], [[paper, told]], "side")


def show(*names):
    """Charts of silo_charts by name; where there is none, a line that says why."""
    for name in names:
        show_one(name, silo_charts.CHARTS[name], lambda: story)


def show_one(name, chart, data):
    try:
        figure = charts.figure_of(chart, data())
    except charts.NothingToDraw as reason:
        display(Markdown(f"*No {name} chart: {reason}.*"))
    else:
        display(Image(small_png(figure), metadata={"alt": f"{name} chart"}))


def dense():
    return dense_charts.read_dense(story.run, story.measures)


def tell_dense(paper, words):
    """As beside(), of what lies between frames; `words` is a function of dense_charts by name."""
    beside(paper, lambda _: getattr(dense_charts, words)(dense()))


def show_dense(*names):
    """As show(), of charts of dense_charts."""
    for name in names:
        show_one(name, dense_charts.CHARTS[name], dense)


def layers_table():
    """The paper's Table 2 of this run."""
    try:
        show_table(*silo_charts.pressure_rows(story))
    except charts.NothingToDraw as reason:
        display(Markdown(f"*No table: {reason}.*"))


# ------------------------------------------------------------------ the index

def opening(notebook):
    """Title and first sentence of a notebook."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    title, text = "".join(next(cell["source"] for cell in cells if cell["cell_type"] == "markdown")).split("\n", 1)
    first = re.match(r".*?[.?](?=\s|$)", " ".join(text.split()))
    return title.lstrip("# "), first.group() if first else ""


def contents():
    """Links to all notebooks, the figures first; build.sh turns those of pages that it made into links to pages."""
    others = [path for path in NOTEBOOKS.glob("*.ipynb") if path.stem != "index"]
    lines = []
    for path in sorted(others, key=lambda path: (not path.stem.startswith("figure"), path.stem)):
        title, first = opening(path)
        lines.append(f"- [{title}]({path.name}): {first}")
    display(Markdown("\n".join(lines)))


def provenance():
    """What the run file tells of its origin, but for the machine."""
    import h5py
    with h5py.File(story.run, "r") as file:
        told = {key: value for key, value in charts.read_provenance(file).items() if key not in ("host", "scene")}
    show_table(["", "the run"], sorted(told.items()), "side")
