"""Colours of recordings."""

from __future__ import annotations

from sva_bench.palette import ALARM as ALARM
from sva_bench.palette import BLUE as BLUE
from sva_bench.palette import GREEN as GREEN
from sva_bench.palette import ORANGE as ORANGE
from sva_bench.palette import PURPLE as PURPLE
from sva_bench.palette import ROBOTS, SITES
from sva_bench.palette import VERMILLION as VERMILLION
from sva_bench.palette import YELLOW as YELLOW
from sva_bench.palette import Color as Color

ROBOT_COLORS, SITE_COLORS = ROBOTS, SITES
DISABLED: Color = (45, 45, 45)  # a robot that has stopped for good


def pale(color: Color) -> Color:
    """A lighter colour."""
    r, g, b = (round(c + (255 - c) * 0.45) for c in color)
    return r, g, b
