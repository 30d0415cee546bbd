"""Colours of recordings."""

from __future__ import annotations

from sva_bench.choices import SiteKind

Color = tuple[int, int, int]

# Colours that colour-blind readers tell apart too. Source: Okabe and Ito (2002), Color Universal Design.
BLACK: Color = (0, 0, 0)
BLUE: Color = (0, 114, 178)
VERMILLION: Color = (213, 94, 0)
PURPLE: Color = (204, 121, 167)
SKY_BLUE: Color = (86, 180, 233)
ORANGE: Color = (230, 159, 0)
YELLOW: Color = (240, 228, 66)
GREEN: Color = (0, 158, 115)

ROBOT_COLORS = (BLUE, VERMILLION, PURPLE, SKY_BLUE, ORANGE)  # the sixth robot has the first one's again
SITE_COLORS: dict[SiteKind, Color] = {"base": BLACK, "station": GREEN, "poi": YELLOW}
DISABLED: Color = (45, 45, 45)  # a robot that has stopped for good
ALARM: Color = (230, 0, 0)  # where it did


def pale(color: Color) -> Color:
    """A lighter colour."""
    r, g, b = (round(c + (255 - c) * 0.45) for c in color)
    return r, g, b
