"""Small multiples: a small chart for each scenario, side by side, all with the same axes; SVG made by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sva_bench.report.page import sentence, text, typeset
from sva_bench.report.rows_chart import round_ticks

_WIDTH, _HEIGHT = 260.0, 150.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 38.0, 10.0, 20.0, 32.0  # about the lane
_MOST_Y, _MOST_X = 4, 5  # ticks
_GAP = 5.0  # between the lane and its figures
_LETTER = 6.2
_DIGIT, _MINUS = 7.0, 9.3  # widths in wide system fonts, at the size of ticks
MOST_PANELS = 12
"""Small charts that are shown of one kind."""


@dataclass(frozen=True, kw_only=True)
class Point:
    """A point with its interval, if it has one; ``shape``: round, square, up or hollow."""

    x: float
    y: float
    said: str
    interval: tuple[float, float] | None = None
    colour: str = "var(--ink)"
    shape: str = "round"
    ringed: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Panel:
    """One small chart: its title, its points, and a line to mark a place on its x axis."""

    title: str
    points: Sequence[Point]
    aim: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Axes:
    """What all panels share.

    Attributes:
        x: What the x axis is of; the caption says what the y axis is of.
        places: Places on the x axis that have names, in place of round numbers.
        joined: Whether points of a panel are joined from left to right.
        zero: Whether the y axis holds zero.
        apart: Whether each panel has a y axis of its own, for figures that are not to be compared between them.
        legend: Colour, shape and name of what is told apart by them.
        ends: Of the x axis; ``None`` = as far as points go.
    """

    x: str
    places: Sequence[tuple[float, str]] = ()
    joined: bool = False
    zero: bool = False
    apart: bool = False
    legend: Sequence[tuple[str, str, str]] = ()
    ends: tuple[float, float] | None = None


def panels(told: str, axes: Axes, shown: Sequence[Panel], caption: str) -> str:
    """Small charts with one caption.

    Args:
        told: What they show, for those who can't see it.
        axes: Their common axes.
        shown: The charts; no more than ``MOST_PANELS`` are drawn, and the caption says so.
        caption: Stands below them.
    """
    drawn = [panel for panel in shown if panel.points][:MOST_PANELS]
    if not drawn:
        return ""
    every = [point for panel in drawn for point in panel.points]
    x0, x1 = axes.ends or _with_room([point.x for point in every] + [at for at, _ in axes.places] + [
        panel.aim for panel in drawn if panel.aim is not None])
    reaches = [_Reach(x0, x1, *_upright(panel.points if axes.apart else every, zero=axes.zero)) for panel in drawn]
    left = len(shown) - len(drawn)
    more = f" The first {len(drawn)} of {len(shown)}." if left and len(drawn) == MOST_PANELS else ""
    pictures = "".join(_picture(f"{told}, {panel.title}", axes, panel, reach)
                       for panel, reach in zip(drawn, reaches, strict=True))
    return (f"<figure class=rows>{_legend(axes)}<div class=panels>{pictures}</div>"
            f"<figcaption>{sentence(caption + more)}</figcaption></figure>")


def _wide(figure: str) -> float:
    """Width of a figure at a tick: a digit takes less than the minus sign, of which an exponent may have another."""
    return _DIGIT * len(figure) + (_MINUS - _DIGIT) * figure.count("-")


def _upright(points: Sequence[Point], *, zero: bool) -> tuple[float, float]:
    ends = [end for point in points for end in (point.y, *(point.interval or ()))]
    return _with_room([*ends, 0.0] if zero else ends)


def _with_room(ends: Sequence[float]) -> tuple[float, float]:
    low, high = min(ends), max(ends)
    room = 0.07 * (high - low) or max(1.0, 0.05 * abs(high))
    return low - room, high + room


@dataclass(frozen=True)
class _Reach:
    """Ends of both axes, and where a place on them lies in the picture."""

    x0: float
    x1: float
    y0: float
    y1: float

    @property
    def left(self) -> float:
        """Where the lane begins: right of the longest figure at its ticks."""
        return max([_LEFT, *(_GAP + _wide(f"{at:g}") for at in self.ticks())])

    def ticks(self) -> Sequence[float]:
        """Where the upright axis has its figures."""
        return round_ticks(self.y0, self.y1, _MOST_Y)

    def x(self, at: float) -> float:
        return self.left + (at - self.x0) / (self.x1 - self.x0) * (_WIDTH - self.left - _RIGHT)

    def y(self, at: float) -> float:
        return _HEIGHT - _BOTTOM - (at - self.y0) / (self.y1 - self.y0) * (_HEIGHT - _TOP - _BOTTOM)


def _picture(told: str, axes: Axes, panel: Panel, reach: _Reach) -> str:
    left, right, bottom = reach.left, _WIDTH - _RIGHT, _HEIGHT - _BOTTOM
    parts = [f'<text class=name x="0" y="13"><title>{text(panel.title)}</title>{text(_cut(panel.title))}</text>',
             f'<rect class=lane x="{left:.0f}" y="{_TOP:.0f}" width="{right - left:.0f}" '
             f'height="{bottom - _TOP:.0f}" rx="2"/>']
    for at in reach.ticks():
        kind = "zero" if at == 0 and axes.zero else "grid"
        parts.append(f'<path class={kind} d="M{left:.0f} {reach.y(at):.1f}H{right:.0f}"/>'
                     f'<text class="tick left" x="{left - _GAP:.0f}" y="{reach.y(at) + 4:.1f}">{typeset(f"{at:g}")}'
                     "</text>")
    parts += [f'<text class=tick x="{reach.x(at):.1f}" y="{bottom + 13:.0f}"><title>{text(word)}</title>'
              f"{text(typeset(shown))}</text>" for at, word, shown in _places(axes, reach)]
    parts.append(f'<text class=tick x="{(left + right) / 2:.0f}" y="{_HEIGHT - 4:.0f}">{text(axes.x)}</text>')
    if panel.aim is not None:
        parts.append(f'<path class=aim d="M{reach.x(panel.aim):.1f} {_TOP:.0f}V{bottom:.0f}"/>')
    if axes.joined and len(panel.points) > 1:
        ordered = sorted(panel.points, key=lambda point: point.x)
        parts.append('<path class=joined d="M' + "L".join(
            f"{reach.x(point.x):.1f} {reach.y(point.y):.1f}" for point in ordered) + '"/>')
    parts += [_drawn(point, reach) for point in panel.points]
    return (f'<svg class=panel role=img aria-label="{text(told)}" viewBox="0 0 {_WIDTH:.0f} {_HEIGHT:.0f}">'
            f"{''.join(parts)}</svg>")


def _cut(title: str) -> str:
    room = int(_WIDTH / _LETTER) - 2
    return title if len(title) <= room else f"{title[:room - 1]}…"


def _places(axes: Axes, reach: _Reach) -> list[tuple[float, str, str]]:
    """Where the x axis has which word, whole and as it is shown; as many as have room."""
    if not axes.places:
        return [(at, f"{at:g}", f"{at:g}") for at in round_ticks(reach.x0, reach.x1, _MOST_X)]
    kept: list[tuple[float, str, str]] = []
    free = -math.inf
    room = max(int((_WIDTH - reach.left) / len(axes.places) / _LETTER), 5)
    for at, word in sorted(axes.places):
        shown = word if len(word) <= room else f"{word[:room - 1]}…"
        half = _LETTER * len(shown) / 2
        if reach.x(at) - half >= free:
            kept.append((at, word, shown))
            free = reach.x(at) + half + 3
    return kept


def _shape(shape: str, colour: str, x: float, y: float) -> str:
    if shape == "square":
        return f'<rect x="{x - 3.4:.1f}" y="{y - 3.4:.1f}" width="6.8" height="6.8" style="fill:{colour}"/>'
    if shape == "up":
        return f'<path d="M{x:.1f} {y - 4.6:.1f}l4.4 7.8h-8.8z" style="fill:{colour}"/>'
    fill = f"fill:var(--paper);stroke:{colour};stroke-width:1.6" if shape == "hollow" else f"fill:{colour}"
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.8" style="{fill}"/>'


def _legend(axes: Axes) -> str:
    """What is what, in a line above the charts."""
    items = "".join(f'<span class=whole><svg class=k viewBox="0 0 10 10" aria-hidden=true>{_shape(shape, colour, 5, 5)}'
                    f"</svg>{text(name)}</span> " for colour, shape, name in axes.legend)
    return f"<p class=legend>{items}</p>" if items else ""


def _drawn(point: Point, reach: _Reach) -> str:
    x, y = reach.x(point.x), reach.y(point.y)
    bar = "" if point.interval is None else (
        f'<path class=bar style="stroke:{point.colour}" d="M{x:.1f} {reach.y(point.interval[0]):.1f}'
        f'V{reach.y(point.interval[1]):.1f}"/>')
    shape = _shape(point.shape, point.colour, x, y)
    ring = f'<circle class=ring cx="{x:.1f}" cy="{y:.1f}" r="7"/>' if point.ringed else ""
    return f"<g><title>{text(typeset(point.said))}</title>{bar}{shape}{ring}</g>"
