"""Small charts of rows: a label above each, and below it what was found, on one axis; SVG made by hand.

Labels stand above their rows, not beside them, so that a chart is as legible on a phone as in a wide window. What is
found lies on lanes, and the lines of the grid in these alone: none strikes through a label.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sva_bench.report.page import text, typeset

_WIDTH, _SIDE = 356.0, 14.0  # as wide as a phone's page, so that letters are as large there as they are meant
_LABEL, _ROW, _STEPS, _GROUP, _AXIS, _GAP = 16.0, 17.0, 34.0, 22.0, 32.0, 5.0  # heights
_MIDDLE, _SECOND = 8.0, 9.0  # where marks lie in their row, and how far below them those behind
_MOST_TICKS = 6
_LETTER = 6.6

_Scale = Callable[[float], float]


@dataclass(frozen=True, kw_only=True)
class Dot:
    """A point: where, how large, in which colour (of the style sheet), of which shape, and what it says."""

    at: float
    said: str
    radius: float = 4.5
    colour: str = "var(--ink)"
    shape: str = "round"  # or hollow, tick, down
    below: str = ""


@dataclass(frozen=True, kw_only=True)
class Span:
    """An interval."""

    low: float
    high: float
    said: str
    colour: str = "var(--ink)"
    thin: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Steps:
    """An empirical distribution: how many of the trials have at most each value."""

    values: Sequence[float]
    shares: Sequence[float]
    said: str
    colour: str = "var(--ink)"


@dataclass(frozen=True, eq=False, kw_only=True)
class Row:
    """A row: what it is of, what it shows, what it comes to, and the group that it belongs to."""

    label: str
    marks: Sequence[Dot | Span | Steps]
    told: str = ""
    group: str = ""


def rows_chart(title: str, unit: str, rows: Sequence[Row], *, zero: bool = False) -> str:
    """A chart.

    Args:
        title: What it shows, for those who can't see it.
        unit: Of its axis.
        rows: From above.
        zero: Whether the axis holds zero, with a line.
    """
    ends = [end for row in rows for mark in row.marks for end in _ends(mark)] or [0.0]
    low, high = min([*ends, 0.0] if zero else ends), max([*ends, 0.0] if zero else ends)
    room = 0.04 * (high - low) or max(1.0, 0.05 * abs(high))
    low, high = low - room, high + room

    def x(at: float) -> float:
        return _SIDE + (at - low) / (high - low) * (_WIDTH - 2 * _SIDE)

    ticks, parts, y = round_ticks(low, high), [], 2.0
    for number, row in enumerate(rows):
        if row.group and (not number or rows[number - 1].group != row.group):
            y += _GROUP if number else 16.0
            parts.append(f'<text class=group x="0" y="{y - 5:.0f}">{text(row.group)}</text>')
        parts.append(_labels(row, y + _LABEL - 4))
        y += _LABEL * (1 if _beside(row) else 2)
        tall = _tall(row)
        parts.append(f'<rect class=lane x="0" y="{y:.0f}" width="{_WIDTH:.0f}" height="{tall:.0f}" rx="2"/>')
        parts += [f'<path class="{"zero" if at == 0 else "grid"}" d="M{x(at):.1f} {y:.0f}v{tall:.0f}"/>'
                  for at in ticks]
        parts += [_drawn(mark, x, y, tall) for mark in row.marks]
        y += tall + _GAP
    parts += [f'<text class=tick x="{x(at):.1f}" y="{y + 10:.0f}">{typeset(f"{at:g}")}</text>' for at in ticks]
    parts.append(f'<text class=tick x="{_WIDTH / 2:.0f}" y="{y + _AXIS - 6:.0f}">{text(unit)}</text>')
    return (f'<svg class=rows role=img aria-label="{text(title)}" viewBox="0 0 {_WIDTH:.0f} {y + _AXIS:.0f}">'
            f"{''.join(parts)}</svg>")


def _tall(row: Row) -> float:
    """Height of a row's lane."""
    if any(isinstance(mark, Steps) for mark in row.marks):
        return _STEPS
    return _ROW + (11 if any(isinstance(mark, Dot) and (mark.below or mark.shape == "hollow") for mark in row.marks)
                   else 0)


def _ends(mark: Dot | Span | Steps) -> list[float]:
    if isinstance(mark, Dot):
        return [mark.at]
    return [mark.low, mark.high] if isinstance(mark, Span) else [min(mark.values), max(mark.values)]


def _beside(row: Row) -> bool:
    """Whether there is room for what a row comes to beside its label, or only below it."""
    return not row.told or _LETTER * (len(row.label) + len(row.told) + 2) <= _WIDTH


def _labels(row: Row, y: float) -> str:
    room = int(_WIDTH / _LETTER)
    label = row.label if len(row.label) <= room else f"{row.label[:room - 1]}…"
    below = y if _beside(row) else y + _LABEL - 1
    return (f'<text x="0" y="{y:.0f}"><title>{text(row.label)}</title>{text(label)}</text>'
            + (f'<text class=told x="{_WIDTH:.0f}" y="{below:.0f}">{text(typeset(row.told))}</text>' if row.told
               else ""))


def _drawn(mark: Dot | Span | Steps, x: _Scale, top: float, tall: float) -> str:
    said = f"<title>{text(typeset(mark.said))}</title>"
    middle = top + _MIDDLE
    if isinstance(mark, Span):
        width = max(x(mark.high) - x(mark.low), 1.5)
        height = 3.0 if mark.thin else 6.0
        down = _SECOND if mark.thin else 0.0
        return (f'<rect x="{x(mark.low):.1f}" y="{middle - height / 2 + down:.1f}" width="{width:.1f}" '
                f'height="{height:.0f}" style="fill:{mark.colour}" class=span>{said}</rect>')
    if isinstance(mark, Steps):
        return _steps(mark, x, top + 3, tall - 6)
    at = x(mark.at)
    below = f'<text class="tick below" x="{at:.1f}" y="{middle + 17:.0f}">{text(mark.below)}</text>' \
        if mark.below else ""
    if mark.shape == "tick":
        shape = f'<path d="M{at:.1f} {middle - 9:.1f}v18" style="stroke:{mark.colour};stroke-width:2">{said}</path>'
    elif mark.shape == "down":
        shape = f'<path d="M{at:.1f} {middle - 2:.1f}l-4.5 -7h9z" style="fill:{mark.colour}">{said}</path>'
    else:
        hollow = f"fill:var(--paper);stroke:{mark.colour};stroke-width:2" if mark.shape == "hollow" else \
            f"fill:{mark.colour}"
        down = _SECOND if mark.shape == "hollow" else 0.0
        shape = f'<circle cx="{at:.1f}" cy="{middle + down:.1f}" r="{mark.radius:.1f}" style="{hollow}">{said}</circle>'
    return shape + below


def _steps(mark: Steps, x: _Scale, top: float, tall: float) -> str:
    at, share = x(mark.values[0]), 0.0
    said = [f"M{at:.1f} {top + tall:.1f}"]
    for value, reached in zip(mark.values, mark.shares, strict=True):
        if x(value) - at >= 0.5:
            at = x(value)
            said.append(f"H{at:.1f}")
        share = reached
        said.append(f"V{top + tall * (1 - share):.1f}")
    return (f'<path class=steps style="stroke:{mark.colour}" d="{"".join(said)}"><title>{text(mark.said)}</title>'
            "</path>")


def round_ticks(low: float, high: float, most: int = _MOST_TICKS) -> list[float]:
    """Round numbers between two ends, so many at most."""
    steps = (step * 10.0**power for power in range(-9, 17) for step in (1, 2, 5))
    step = next((step for step in steps if math.floor(high / step) - math.ceil(low / step) < most), high - low)
    return [round(k * step, 9) + 0.0 for k in range(math.ceil(low / step), math.floor(high / step) + 1)]
