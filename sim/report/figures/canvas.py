"""Look of a study's figures: size, legend, curves, and the bytes of their files."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sim.drawing.plots import rgb
from sim.report.figures.panels import Style

WIDTH = 11.0  # inches of a figure as wide as the report
_LOOK: Any = {"font.family": "DejaVu Sans", "font.size": 10, "svg.fonttype": "path", "svg.hashsalt": "understory"}


@contextmanager
def drawing(height: float, width: float = WIDTH) -> Iterator[Figure]:
    """A figure of so many inches, to be drawn in one look."""
    with matplotlib.rc_context(_LOOK):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.draw_without_rendering()  # which lays it out, once for all the files that it is saved to
        figure.set_layout_engine("none")


def legend(figure: Figure, styles: dict[str, Style], marker: str = "") -> None:
    """Draw a legend below the panels, in which data may be anywhere."""
    handles = [
        Line2D([], [], label=name, **(line(style) | ({"marker": marker, "ls": ""} if marker else {})))
        for name, style in styles.items()
    ]
    columns = 4 if all(len(name) < 22 for name in styles) else 2 if all(len(name) < 44 for name in styles) else 1
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False)


def line(style: Style) -> dict[str, Any]:
    """Matplotlib's options for a curve."""
    return {"color": rgb(style.colour), "ls": style.dash, "lw": 1.7}


def content(figure: Figure, kind: str) -> bytes:
    """The figure as a file, "png" or "svg", the same bytes for the same figure."""
    drawn = io.BytesIO()
    with matplotlib.rc_context(_LOOK):
        figure.savefig(drawn, format=kind, dpi=130, metadata={"Date": None} if kind == "svg" else {"Software": None})
    return drawn.getvalue()
