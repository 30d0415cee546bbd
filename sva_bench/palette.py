"""Colours of robots, plans and sites: the same on pages, in recordings and in drawings.

Nothing is told apart by colour alone: robots differ in the style of their lines too, kinds of sites in shape, and plans
in hatching or the shape of their points. Robots and plans share no colour, so that a blue line is always the first
robot. All are seen on white and on the dark of a page.

Source: Okabe & Ito (2002), Color Universal Design, for robots and sites.
"""

from __future__ import annotations

from collections.abc import Mapping

from sva_bench.choices import SiteKind

Color = tuple[int, int, int]
"""Red, green and blue from 0 to 255."""

BLACK: Color = (0, 0, 0)
BLUE: Color = (0, 114, 178)
VERMILLION: Color = (213, 94, 0)
PURPLE: Color = (204, 121, 167)
SKY_BLUE: Color = (86, 180, 233)
ORANGE: Color = (230, 159, 0)
YELLOW: Color = (240, 228, 66)
GREEN: Color = (0, 158, 115)

ROBOTS: tuple[Color, ...] = (BLUE, VERMILLION, PURPLE, SKY_BLUE, ORANGE)
"""Of robots in the order of their world; the sixth has the first one's again."""
SITES: Mapping[SiteKind, Color] = {"base": BLACK, "station": GREEN, "poi": YELLOW}
ALARM: Color = (208, 0, 0)
"""Where a robot touched something, or ended for good."""
PLANS: Mapping[str, Color] = {
    "stochastic": (0, 150, 136), "deterministic": (168, 124, 12), "calibrated": (101, 108, 216),
    "anticipative": (196, 40, 100), "informed": (104, 104, 104)}
"""Of our own plans."""


def robot_color(number: int) -> Color:
    """Colour of a robot, by its position in its world."""
    return ROBOTS[number % len(ROBOTS)]


def plan_color(name: str, number: int) -> Color:
    """Colour of a plan: its own, if it is one of ours, and by its position among those compared otherwise."""
    return PLANS.get(name, tuple(PLANS.values())[number % len(PLANS)])


def hex_of(color: Color) -> str:
    """As style sheets have it: ``#0072b2``."""
    return "#{:02x}{:02x}{:02x}".format(*color)
