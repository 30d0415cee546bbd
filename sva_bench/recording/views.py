"""What a recording is shown in: views, and how they share the window. Independent of Rerun."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias


@dataclass(frozen=True, kw_only=True)
class View:
    """A view of what stands below a path.

    Attributes:
        origin: The path.
        name: Its heading.
    """

    origin: str
    name: str


@dataclass(frozen=True, kw_only=True)
class TextView(View):
    """A view of a text."""


@dataclass(frozen=True, kw_only=True)
class LogView(View):
    """A view of a log."""


@dataclass(frozen=True, kw_only=True)
class StatesView(View):
    """A view of lanes of states, from 0 to ``end_s``."""

    end_s: float


@dataclass(frozen=True, kw_only=True)
class ChartView(View):
    """A view of numbers over time, from 0 to ``end_s``.

    Attributes:
        values: The least and the greatest number on its axis.
        legend: The corner of its legend.
    """

    end_s: float
    values: tuple[float, float]
    legend: Literal["left_top", "left_bottom", "right_top"]


@dataclass(frozen=True, kw_only=True)
class MapView(View):
    """A view of solids, lines and points.

    Attributes:
        eye_m, target_m: Where the camera is, and where it looks: x, y, z [m].
        kept: Paths of entities of which all is seen that came so far; of others what came last.
    """

    eye_m: Sequence[float]
    target_m: Sequence[float]
    kept: Sequence[str] = ()


@dataclass(frozen=True)
class Row:
    """Panels side by side, in widths of these shares; none = in equal ones."""

    panels: Sequence[Panel]
    shares: Sequence[float] = ()


@dataclass(frozen=True)
class Column:
    """Panels below each other, in heights of these shares; none = in equal ones."""

    panels: Sequence[Panel]
    shares: Sequence[float] = ()


@dataclass(frozen=True)
class Tabs:
    """Panels in one place, the first in front."""

    panels: Sequence[Panel]


Panel: TypeAlias = TextView | LogView | StatesView | ChartView | MapView | Row | Column | Tabs


@dataclass(frozen=True, kw_only=True)
class Layout:
    """What is shown, and how time goes on.

    Attributes:
        panel: All that is shown.
        speed: How many seconds of the mission a second shows; ``None`` = it follows what is recorded just now.
    """

    panel: Panel
    speed: float | None
