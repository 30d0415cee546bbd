"""Colours, shapes and line styles of what pictures and charts show, and what each is called in a legend.

Colours are those of the palette, and nothing is told apart by colour alone: kinds of sites differ in shape, robots in
the style of their line, in charts in hatching and shape. A robot has the same colour in all of them.
"""

from __future__ import annotations

from typing import Any

from sva_bench.choices import Judgement, MarkKind, SiteKind, StandKind
from sva_bench.palette import ALARM, GREEN, SITES, hex_of, robot_color
from sva_bench.palette import ROBOTS as COLORS
from sva_bench.recording.meetings import Floor

OBSTACLE_RGB = (150, 150, 150)
"""Colour of obstacles and outer walls; what is free stays white."""
UNKNOWN_RGB = (214, 214, 214)
"""Colour of what counts as occupied since nothing is known of it."""
SITE_MARKERS: dict[SiteKind, tuple[str, str, float]] = {  # shape, colour, size [pt]
    "base": ("s", hex_of(SITES["base"]), 10.0), "station": ("^", hex_of(SITES["station"]), 9.5),
    "poi": ("o", hex_of(SITES["poi"]), 7.5)}
SITE_KINDS: dict[SiteKind, str] = {"base": "base", "station": "refuelling station", "poi": "point of interest"}
ROBOTS: tuple[tuple[str, Any, float], ...] = tuple(  # colour, style, width [pt]; later ones lie on top, so thinner
    (hex_of(colour), style, width) for colour, (style, width) in zip(COLORS, (
        ("-", 2.6), ((0, (5, 2)), 2.0), ((0, (1.2, 1.5)), 2.0), ((0, (6, 1.5, 1.2, 1.5)), 1.8), ((0, (3, 4)), 1.4)),
        strict=True))
"""How the robots of a world are drawn, in their order there."""
ROADMAP, PATH = "#56B4E9", "#0072B2"
PASSAGE, PASSAGE_PT = "#0B6E4F", 5.0  # colour; width that names keep off it [pt]
MARKS: dict[MarkKind, tuple[str, str, str]] = {  # shape, colour, what it is
    "contact": ("X", hex_of(ALARM), "contact with an obstacle"),
    "collision": ("P", hex_of(ALARM), "collision of two robots"),
    "wait": ("D", "#7B3294", "wait")}
MARKS_OF_MANY: dict[MarkKind, str] = {
    "contact": "contacts with obstacles", "collision": "collisions of two robots", "wait": "waits"}
STANDS: dict[StandKind, tuple[str, str]] = {  # colour, what it is
    "berth": ("#000000", "berth of a robot"), "slot": (hex_of(GREEN), "slot of a station")}
JUDGED: dict[Judgement, tuple[str, Any, float]] = {  # colour, style, width [pt]
    "safe": ("#009E73", "-", 1.6), "close": ("#E69F00", (0, (5, 1.5)), 2.2), "edge": (hex_of(ALARM), "-", 3.4)}
JUDGED_TOLD: dict[Judgement, str] = {"safe": "leg with margin to spare", "close": "leg with little margin",
                                     "edge": "leg on a knife's edge"}


def robot_colour(number: int) -> str:
    """Colour of a robot, by its position in its world."""
    return hex_of(robot_color(number))


def floor_style(floor: Floor) -> dict[str, Any]:
    """How a patch of floor is filled."""
    return {"facecolor": tuple(channel / 255 for channel in floor.color), "edgecolor": "#7fb6d3", "hatch": "////",
            "linewidth": 0.6}
