"""The canvas of charts, and pictures that can stand in a page."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes as Axes  # charts draw on them
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

SETTINGS: dict[Any, Any] = {
    "svg.hashsalt": "sva-bench", "svg.fonttype": "path", "font.family": "DejaVu Sans", "font.size": 8.0,
    "axes.linewidth": 0.6, "path.simplify": False,
    "text.parse_math": False}  # a dollar sign in a name is one
"""Of matplotlib, for each picture; whatever a user has set up there is left aside."""


_OF_PAGE = {"#000000": "ink", "#444444": "soft", "#dddddd": "line", "#bbbbbb": "line", "#ffffff": "paper"}
"""Colours of charts that are others in the dark, by variables of the page."""


def chart(name: str, title: str, size_in: tuple[float, float], draw: Callable[[Axes], None]) -> str:
    """A chart as SVG that can stand in a page.

    Args:
        name: Unique in the page; its ids begin with it.
        title: What it shows, for those who can't see it.
        size_in: Width and height.
        draw: Draws it.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        # Words stay words: smaller, to be found and read aloud.
        mpl.rcParams.update(SETTINGS | {"svg.fonttype": "none", "font.size": 10.0, "axes.spines.top": False,
                                         "axes.spines.right": False, "axes.axisbelow": True, "axes.facecolor": "none"})
        figure = Figure(figsize=size_in, facecolor="none", layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure.add_subplot())
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return for_page(stream.getvalue(), name, title)


def for_page(svg: str, name: str, title: str) -> str:
    """An SVG file's picture, its ids its own, its title said, its blacks and greys those of the page in its mode."""
    picture = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg"):], flags=re.DOTALL)
    picture = re.sub(r'\bid="', f'id="{name}-', picture)
    picture = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{name}-", picture)
    for colour, variable in _OF_PAGE.items():
        picture = re.sub(rf"(?<=[:;] ){colour}\b", f"var(--{variable})", picture)
    escaped_title = html.escape(title)
    return picture.replace("<svg ", f'<svg role="img" aria-label="{escaped_title}" ', 1).replace(
        ">", f"><title>{escaped_title}</title>", 1).strip()
