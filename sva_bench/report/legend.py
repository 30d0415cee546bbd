"""The legend of a picture of a world."""

from __future__ import annotations

import math
import textwrap
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sva_bench.files.printable import counted
from sva_bench.recording.meetings import floors_of
from sva_bench.report.ground import DPI, GREY, LIGHT_GREY, Frame, has_unknown
from sva_bench.report.overlays import Overlays
from sva_bench.report.styles import (
    JUDGED,
    JUDGED_TOLD,
    MARKS,
    MARKS_OF_MANY,
    PASSAGE,
    PATH,
    ROADMAP,
    ROBOTS,
    SITE_KINDS,
    SITE_MARKERS,
    STANDS,
    floor_style,
)
from sva_bench.world.model import World


def add_legend(figure: Figure, frame: Frame, world: World, overlays: Overlays) -> None:
    """What is what, to the right of the map."""
    handles: list[Any] = []
    kinds = {site.kind for site in world.sites}
    for kind, (marker, colour, size) in SITE_MARKERS.items():
        if kind in kinds:
            handles.append(Line2D([], [], linestyle="none", marker=marker, color=colour, markersize=size,
                                  markeredgecolor="black", markeredgewidth=0.8, label=SITE_KINDS[kind]))
    handles.append(Patch(facecolor=GREY, label="obstacle"))
    if has_unknown(world):
        handles.append(Patch(facecolor=LIGHT_GREY, label="unknown, counts as an obstacle"))
    if overlays.roadmap is not None:
        handles.append(Line2D([], [], color=ROADMAP, linewidth=0.8, label=_of("roadmap", overlays.roadmap_of)))
    if overlays.paths:
        handles.append(Line2D([], [], color=PATH, linewidth=0.8,
                              label=_of("path between two sites", overlays.paths_of)))
    for number, (robot, legs) in enumerate(overlays.routes.items()):
        colour, style, width = ROBOTS[number % len(ROBOTS)]
        stops = ", ".join(leg.destination for leg in legs) or "stays home"
        handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=width,
                              label=textwrap.fill(f"{robot}: {stops}", _WIDTH)))
    handles += _of_meetings(world, overlays)
    left = frame.left_in + (frame.x1_m - frame.x0_m) * frame.in_per_m + 0.15
    top = frame.bottom_in + (frame.y1_m - frame.y0_m) * frame.in_per_m
    legend = figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(
        left / frame.width_in, top / frame.height_in), frameon=False, borderpad=0, borderaxespad=0, handlelength=2.6,
        labelspacing=0.9, alignment="left")
    box = legend.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
    names = " | ".join(robot.name for robot in world.robots)
    robots = [f"{robot.name}: {_limits(robot.fuel_capacity_s, robot.mission_limit_s)}" for robot in world.robots]
    lines = ["Incentives below the name of a POI:", *textwrap.wrap(names, 36), "", *robots]
    figure.text(left / frame.width_in, box.y0 / DPI / frame.height_in - 0.18 / frame.height_in, "\n".join(lines),
                va="top", fontsize=8, linespacing=1.45)


def _of_meetings(world: World, overlays: Overlays) -> list[Any]:
    """What is what of floors, passages, judged legs and marks."""
    floors = {f"{floor.friction:g}": floor for floor in floors_of(world.obstacles.floors)}
    handles: list[Any] = [Patch(label=f"floor, friction {friction}", **floor_style(floor))
                          for friction, floor in sorted(floors.items())[:_MOST_FLOORS]]
    if world.passages:
        handles.append(Line2D([], [], color=PASSAGE, linestyle=(0, (2.2, 1.2)), linewidth=2.4,
                              label="passage that may be shut"))
    handles += [Line2D([], [], linestyle="none", marker="o", color="none", markersize=9, markeredgecolor=colour,
                       label=what) for kind, (colour, what) in STANDS.items()
                if any(stand.kind == kind for stand in overlays.stands)]
    for judged in JUDGED:
        if any(leg.judged == judged for leg in overlays.judged):
            colour, style, width = JUDGED[judged]
            handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=width, label=JUDGED_TOLD[judged]))
    for kind, (shape, colour, what) in MARKS.items():
        if count := sum(mark.count for mark in overlays.marks if mark.kind == kind):
            handles.append(Line2D([], [], linestyle="none", marker=shape, color=colour, markersize=7,
                                  markeredgecolor="white", label=counted(count, what, MARKS_OF_MANY[kind])))
    if any(mark.stuck for mark in overlays.marks):
        handles.append(Line2D([], [], linestyle="none", marker="o", color="none", markersize=11, markeredgewidth=1.6,
                              markeredgecolor=MARKS["contact"][1], label="a robot got stuck here"))
    return handles


def _of(what: str, whose: str) -> str:
    """``roadmap of uv1``; nobody is named where all have the same."""
    return textwrap.fill(f"{what}, of {whose}", _WIDTH) if whose else what


_WIDTH = 30  # letters of a line of the legend
_MOST_FLOORS = 4  # frictions in a legend


def _limits(fuel_s: float, mission_s: float) -> str:
    fuel = f"{fuel_s:g} s of fuel" if math.isfinite(fuel_s) else "fuel without end"
    return f"{fuel}, home in {mission_s:g} s" if math.isfinite(mission_s) else f"{fuel}, no time limit"
