"""Display of a mission in a notebook: figures, and a table of facts beside the OSPA over time."""

import base64
import html
import io
import sys
from collections.abc import Mapping

from matplotlib.figure import Figure

from sim.drawing.plots import draw_mean, new_figure
from tracking.numerics.arrays import Array

_CELL = "text-align:left;padding:1px 12px 1px 0;border:0"


def show_figures() -> None:
    """Let a notebook show figures, which it does by itself only once pyplot has been imported there."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    if shell is not None:
        shown = shell.display_formatter.formatters["image/png"]
        if Figure not in shown.type_printers:
            shown.for_type(Figure, _png)


def table_beside_curve(facts: Mapping[str, str], times: Array, ospa: Array) -> str:
    """Facts by name as a table in HTML, beside a picture of the fleet's mean OSPA over time."""
    rows = "".join(
        f'<tr><th style="{_CELL}">{html.escape(name)}</th><td style="{_CELL}">{html.escape(value)}</td></tr>'
        for name, value in facts.items()
    )
    with new_figure(4.6, 2.2, letters=9) as figure:
        draw_mean(figure.add_subplot(), times, ospa, width=1.2)
    curve = base64.b64encode(_png(figure)).decode("ascii")
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:16px;align-items:center">'
        f'<table style="margin:0">{rows}</table>'
        f'<img alt="mean OSPA over time" src="data:image/png;base64,{curve}"></div>'
    )


def _png(figure: Figure) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=figure.dpi)
    return content.getvalue()
