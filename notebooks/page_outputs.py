"""Charts and tables as outputs of a notebook that are small and that GitHub shows too."""

import html
from io import BytesIO

from IPython.display import HTML, display
from PIL import Image as Picture

DPI, COLOURS = 80, 128  # of stored pictures: they stay readable, and all of them below 2.5 MB


def small_png(figure):
    """A figure as PNG with a palette: a third of the bytes."""
    raw, small = BytesIO(), BytesIO()
    figure.savefig(raw, dpi=DPI, format="png")
    Picture.open(raw).convert("RGB").quantize(COLOURS, kmeans=1, dither=Picture.Dither.NONE).save(small, format="png", optimize=True)
    return small.getvalue()


def show_table(titles, rows, looks="told"):
    cells = lambda tag, row: "".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in row)
    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    display(HTML(f'<table class="{looks}"><tr>{cells("th", titles)}</tr>{body}</table>'))
