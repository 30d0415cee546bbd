"""Worlds as pictures, to scale, and the canvas of charts, for print and for colour-blind readers.

The only importer of matplotlib.

Colours are those of Okabe and Ito, and nothing is told apart by colour alone: kinds of sites differ in shape, robots in
the style of their line. Same world, same picture, byte by byte.
"""

from __future__ import annotations

import html
import io
import math
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes as Axes  # charts draw on them
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MultipleLocator

from sva_bench.arrays import FloatArray
from sva_bench.choices import SiteKind
from sva_bench.geometry.cells import TooManyBoxes, bounds_of, boxes_of
from sva_bench.report.labels import place_labels
from sva_bench.world.model import World

Kind = Literal["png", "svg"]

OBSTACLE_RGB = (150, 150, 150)
"""Colour of obstacles and outer walls; what is free stays white."""
UNKNOWN_RGB = (214, 214, 214)
"""Colour of what counts as occupied since nothing is known of it."""
DPI = 200
"""Resolution of pictures in pixels."""

_GREY, _LIGHT_GREY = "#969696", "#d6d6d6"
_MARKERS: dict[SiteKind, tuple[str, str, float]] = {  # shape, colour, size [pt]
    "base": ("s", "#000000", 10.0), "station": ("^", "#0072B2", 9.5), "poi": ("o", "#E69F00", 7.5)}
_KINDS: dict[SiteKind, str] = {"base": "base", "station": "refuelling station", "poi": "point of interest"}
_ROUTES: tuple[tuple[str, Any, float], ...] = (  # colour, style, width [pt]; later ones lie on top, so thinner
    ("#D55E00", "-", 2.6), ("#009E73", (0, (5, 2)), 2.0), ("#CC79A7", (0, (1.2, 1.5)), 2.0),
    ("#56B4E9", (0, (6, 1.5, 1.2, 1.5)), 1.8), ("#000000", (0, (3, 4)), 1.4))
_HALO = withStroke(linewidth=2.2, foreground="white")
_SETTINGS: dict[Any, Any] = {
    "svg.hashsalt": "sva-bench", "svg.fonttype": "path", "font.family": "DejaVu Sans", "font.size": 8.0,
    "axes.linewidth": 0.6, "path.simplify": False,
    "text.parse_math": False}  # a dollar sign in a name is one
_PER_LINE = 4  # incentives on a line of a label
_MOST_MINDED = 300  # paths that labels try to leave free; more leave no room anyway
_LEADER = 9.0  # pixels between a marker and its label from which on a line joins them
_OPAQUE = 4000  # edges of a roadmap that are drawn in full colour; more share their ink, so that the map is seen
_FAINTEST = 0.15  # opacity of an edge of a roadmap at least, else single edges can't be seen
_MANY = 2000  # boxes, or edges, from which on an SVG holds them as an image


@dataclass(frozen=True, eq=False, kw_only=True)
class Leg:
    """A leg of a route: where it ends, and the path there [m], shape (k, 2)."""

    destination: str
    path: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Overlays:
    """What is shown beside map and sites.

    Attributes:
        roadmap: Both ends of each edge [m], shape (e, 2, 2).
        paths: Paths between sites [m], each of shape (k, 2).
        routes: Legs of each robot's route.
    """

    roadmap: FloatArray | None = None
    paths: Sequence[FloatArray] = ()
    routes: Mapping[str, Sequence[Leg]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Where the map lies in the picture, all in inches but for metres.

    Attributes:
        width_in, height_in: Size of the picture.
        left_in, bottom_in: Lower left corner of the map.
        in_per_m: Scale.
        x0_m, y0_m, x1_m, y1_m: What the map shows: the bounds and the wall about them, or of an occupancy grid as
            much about what is free.
    """

    width_in: float
    height_in: float
    left_in: float
    bottom_in: float
    in_per_m: float
    x0_m: float
    y0_m: float
    x1_m: float
    y1_m: float

    def pixel(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Row and column of a place in a PNG."""
        column = (self.left_in + (x_m - self.x0_m) * self.in_per_m) * DPI
        row = (self.height_in - self.bottom_in - (y_m - self.y0_m) * self.in_per_m) * DPI
        return math.floor(row), math.floor(column)


def frame_of(world: World) -> Frame:
    """The frame of a world's picture: larger where there are many sites."""
    x0, y0, x1, y1 = _shown(world).tolist()
    longest = max(x1 - x0, y1 - y0)
    wall = 0.012 * longest
    in_per_m = min(max(1.55 * math.sqrt(len(world.sites)), 6.0), 16.0) / longest
    width, height = ((high - low + 2 * wall) * in_per_m for low, high in ((x0, x1), (y0, y1)))
    return Frame(width_in=round(width + 3.0, 2), height_in=round(max(height + 1.05, 4.0), 2), left_in=0.6,
                 bottom_in=round(max(height + 1.05, 4.0), 2) - 0.45 - height, in_per_m=in_per_m, x0_m=x0 - wall,
                 y0_m=y0 - wall, x1_m=x1 + wall, y1_m=y1 + wall)


def _shown(world: World) -> FloatArray:
    """x_min, y_min, x_max, y_max [m] of what there is to see: maps of ROS often have wide margins of nothing."""
    cells = world.obstacles.cells
    if cells is None or cells.occupied.all():
        return world.obstacles.bounds_m
    rows, columns = (np.flatnonzero(~cells.occupied.all(axis=axis)) for axis in (1, 0))
    free = replace(cells, occupied=np.zeros((np.ptp(rows) + 1, np.ptp(columns) + 1), dtype=np.bool_), unknown=None)
    corner = cells.to_world(np.array([[columns[0], rows[0]]]) * cells.cell_m)[0]
    return bounds_of(replace(free, origin=np.array([*corner, cells.origin[2]])))


def draw_world(world: World, kind: Kind, overlays: Overlays) -> bytes:
    """A picture of a world, as the content of its file."""
    with mpl.rc_context():
        mpl.rcdefaults()  # whatever a user has set up
        mpl.rcParams.update(_SETTINGS)
        frame = frame_of(world)
        figure = Figure(figsize=(frame.width_in, frame.height_in), dpi=DPI, facecolor="white")
        FigureCanvasAgg(figure)
        axes = _map(figure, frame, world)
        _planned(axes, overlays)
        _routes(axes, overlays)
        _sites(figure, axes, world, overlays)
        _legend(figure, frame, world, overlays)
        stream = io.BytesIO()
        # A date or a version in the file would make equal pictures differ.
        figure.savefig(stream, format=kind, dpi=DPI, metadata={
            "Date": None, "Creator": None} if kind == "svg" else {"Software": None})
    return stream.getvalue()


def _map(figure: Figure, frame: Frame, world: World) -> Axes:
    """Bounds, obstacles and scales in metres."""
    axes = figure.add_axes((
        frame.left_in / frame.width_in, frame.bottom_in / frame.height_in,
        (frame.x1_m - frame.x0_m) * frame.in_per_m / frame.width_in,
        (frame.y1_m - frame.y0_m) * frame.in_per_m / frame.height_in))
    axes.set_xlim(frame.x0_m, frame.x1_m)
    axes.set_ylim(frame.y0_m, frame.y1_m)
    axes.spines[:].set_visible(False)
    step = _tick_step(max(frame.x1_m - frame.x0_m, frame.y1_m - frame.y0_m))
    axes.xaxis.set_major_locator(MultipleLocator(step))
    axes.yaxis.set_major_locator(MultipleLocator(step))
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    figure.text(frame.left_in / frame.width_in, 1 - 0.15 / frame.height_in, world.name, fontsize=12, weight="bold",
                va="top")
    x0, y0, x1, y1 = world.obstacles.bounds_m.tolist()
    axes.add_patch(Rectangle((frame.x0_m, frame.y0_m), frame.x1_m - frame.x0_m, frame.y1_m - frame.y0_m,
                             facecolor=_GREY, edgecolor="none", zorder=0))
    axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, facecolor="white", edgecolor="none", zorder=0))
    for boxes, colour, order in _layers(world):
        # The hairline keeps boxes that touch from showing a seam.
        axes.add_collection(PolyCollection(
            list(_corners(boxes)), facecolors=colour, edgecolors=colour, linewidths=0.2, zorder=order,
            rasterized=len(boxes) > _MANY), autolim=False)
    for x, y, radius in world.obstacles.cylinders.tolist():
        axes.add_patch(Circle((x, y), radius, facecolor=_GREY, edgecolor="none", zorder=1))
    return axes


def _layers(world: World) -> list[tuple[FloatArray, str, float]]:
    """Boxes with their colours, from below: what is known to be occupied lies over what only counts as such."""
    boxes, cells = world.obstacles.boxes, world.obstacles.cells
    if not _has_unknown(world) or cells is None or cells.unknown is None:
        return [(boxes, _GREY, 1.0)] if len(boxes) else []
    try:
        known = boxes_of(replace(cells, occupied=cells.occupied & ~cells.unknown, unknown=None))
    except TooManyBoxes:
        return [(boxes, _LIGHT_GREY, 0.5)]
    # Where a grid stands askew, the first four fill what is outside it.
    return [(boxes, _LIGHT_GREY, 0.5), (known[4 if cells.origin[2] else 0:], _GREY, 1.0)]


def _has_unknown(world: World) -> bool:
    cells = world.obstacles.cells
    return cells is not None and cells.unknown is not None and bool(cells.unknown.any())


def _tick_step(length_m: float) -> float:
    """The least of 1, 2, 5, 10, ... m that makes twelve ticks at most."""
    steps = (step * 10.0**power for power in range(-3, 6) for step in (1, 2, 5))
    return next(step for step in steps if length_m <= 12 * step)


def _corners(boxes: FloatArray) -> FloatArray:
    """Corners of boxes, shape (k, 4, 2)."""
    cosine, sine = np.cos(boxes[:, 4])[:, None], np.sin(boxes[:, 4])[:, None]
    along, across = boxes[:, 2, None] * np.array([1, -1, -1, 1]), boxes[:, 3, None] * np.array([1, 1, -1, -1])
    return np.stack([boxes[:, 0, None] + cosine * along - sine * across,
                     boxes[:, 1, None] + sine * along + cosine * across], axis=-1)


def _planned(axes: Axes, overlays: Overlays) -> None:
    if overlays.roadmap is not None:
        edges = len(overlays.roadmap)
        axes.add_collection(LineCollection(
            list(overlays.roadmap), colors="#56B4E9", linewidths=0.1, zorder=2, rasterized=edges > _MANY,
            alpha=min(1.0, max(_OPAQUE / max(edges, 1), _FAINTEST))), autolim=False)
    axes.add_collection(LineCollection(list(overlays.paths), colors="#0072B2", linewidths=0.6, zorder=3),
                        autolim=False)


def _routes(axes: Axes, overlays: Overlays) -> None:
    for number, legs in enumerate(overlays.routes.values()):
        colour, style, width = _ROUTES[number % len(_ROUTES)]
        for leg in legs:
            axes.plot(*leg.path.T, color=colour, linestyle=style, linewidth=width, zorder=4 + 0.01 * number,
                      dash_capstyle="butt", solid_capstyle="round")
            _arrow(axes, leg.path, colour)


def _arrow(axes: Axes, path: FloatArray, colour: str) -> None:
    """A head in the middle of a path."""
    steps = np.hypot(*np.diff(path, axis=0).T)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    middle = int(np.clip(np.searchsorted(arc, arc[-1] / 2), 1, len(path) - 1))
    (ax, ay), (bx, by) = path[middle - 1], path[middle]
    share = (arc[-1] / 2 - arc[middle - 1]) / max(steps[middle - 1], 1e-9)
    angle = math.degrees(math.atan2(by - ay, bx - ax))
    axes.plot(ax + share * (bx - ax), ay + share * (by - ay), marker=(3, 0, angle - 90), markersize=9, color=colour,
              markeredgecolor="white", markeredgewidth=0.7, zorder=5)


def _sites(figure: Figure, axes: Axes, world: World, overlays: Overlays) -> None:
    """Markers and labels of all sites."""
    labels: list[tuple[Text, ...]] = []
    for site in world.sites:
        marker, colour, size = _MARKERS[site.kind]
        axes.plot(site.x_m, site.y_m, marker=marker, markersize=size, color=colour, markeredgecolor="black",
                  markeredgewidth=0.8, zorder=7)
        earned = _earned(world, site.name) if site.kind == "poi" else []
        labels.append((Text(text=site.name, fontsize=8, weight="bold"),
                       *(Text(text=line, fontsize=7) for line in earned)))
    for label in labels:
        for line in label:
            line.set(zorder=8, path_effects=[_HALO], ha="center", va="center")
            axes.add_artist(line)
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    boxes = [[line.get_window_extent(renderer) for line in lines] for lines in labels]
    to_pixels = axes.transData.transform
    at = to_pixels(np.array([(site.x_m, site.y_m) for site in world.sites]))
    drawn = [_every(to_pixels(leg.path)) for legs in overlays.routes.values() for leg in legs]
    if len(overlays.paths) <= _MOST_MINDED:
        drawn += [_every(to_pixels(path), 16.0) for path in overlays.paths]
    x0, y0, x1, y1 = _shown(world).tolist()
    sizes = np.array([[max(box.width for box in group), sum(box.height for box in group)] for group in boxes])
    radii = np.array([_MARKERS[site.kind][2] for site in world.sites]) * DPI / 72 / 2
    centres = place_labels(
        at, sizes, radii=radii,
        frame=np.concatenate([to_pixels((x0, y0)), to_pixels((x1, y1))]),
        lines=np.concatenate(drawn) if drawn else np.empty((0, 2)), solid=to_pixels(_within(world)))
    back = axes.transData.inverted().transform
    for (x, y), lines, group in zip(centres, labels, boxes, strict=True):
        top = y + sum(box.height for box in group) / 2
        for line, box in zip(lines, group, strict=True):
            line.set_position(tuple(back((x, top - box.height / 2)).tolist()))
            top -= box.height
    nearest = np.clip(at, centres - sizes / 2, centres + sizes / 2)
    apart_px = np.hypot(*(nearest - at).T) - radii
    for site, place, here, apart in zip(world.sites, at, nearest, apart_px, strict=True):
        if apart > _LEADER:
            ends = back(np.stack([place, here]))
            axes.plot(ends[:, 0], ends[:, 1], color="black", linewidth=0.6, zorder=6, path_effects=[_HALO],
                      gid=f"leader-{site.name}")


def _earned(world: World, poi: str) -> list[str]:
    """What each robot earns at a POI, in a few lines."""
    values = [f"{value:g}" if (value := robot.incentives.get(poi, 0.0)) else "–" for robot in world.robots]
    return [" | ".join(values[k:k + _PER_LINE]) for k in range(0, len(values), _PER_LINE)]


def _within(world: World) -> FloatArray:
    """Points in obstacles, about a hundred across the picture: where a label is harder to read."""
    points = []
    x0, y0, x1, y1 = _shown(world).tolist()
    step = max(x1 - x0, y1 - y0) / 100
    for x, y, hx, hy, yaw in world.obstacles.boxes[:_MANY].tolist():
        a, b = (np.linspace(-h, h, min(int(2 * h / step) + 2, 100)) for h in (hx, hy))
        grid = np.stack(np.meshgrid(a, b), axis=-1).reshape(-1, 2)
        points.append(grid @ np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]]) + (x, y))
    for x, y, radius in world.obstacles.cylinders.tolist():
        angles = np.linspace(0, 2 * math.pi, 12)
        points.append(np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=-1))
    return np.concatenate(points) if points else np.empty((0, 2))


def _every(path: FloatArray, step: float = 8.0) -> FloatArray:
    """Points along a path, so many pixels apart."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.arange(0, arc[-1] + step, step)
    return np.column_stack([np.interp(at, arc, path[:, 0]), np.interp(at, arc, path[:, 1])])


def _legend(figure: Figure, frame: Frame, world: World, overlays: Overlays) -> None:
    """What is what, to the right of the map."""
    handles: list[Any] = []
    kinds = {site.kind for site in world.sites}
    for kind, (marker, colour, size) in _MARKERS.items():
        if kind in kinds:
            handles.append(Line2D([], [], linestyle="none", marker=marker, color=colour, markersize=size,
                                  markeredgecolor="black", markeredgewidth=0.8, label=_KINDS[kind]))
    handles.append(Patch(facecolor=_GREY, label="obstacle"))
    if _has_unknown(world):
        handles.append(Patch(facecolor=_LIGHT_GREY, label="unknown, counts as an obstacle"))
    if overlays.roadmap is not None:
        handles.append(Line2D([], [], color="#56B4E9", linewidth=0.8, label="roadmap"))
    if overlays.paths:
        handles.append(Line2D([], [], color="#0072B2", linewidth=0.8, label="path between two sites"))
    for number, (robot, legs) in enumerate(overlays.routes.items()):
        colour, style, width = _ROUTES[number % len(_ROUTES)]
        stops = ", ".join(leg.destination for leg in legs) or "stays home"
        handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=width,
                              label=textwrap.fill(f"{robot}: {stops}", 30)))
    left = frame.left_in + (frame.x1_m - frame.x0_m) * frame.in_per_m + 0.15
    top = frame.bottom_in + (frame.y1_m - frame.y0_m) * frame.in_per_m
    legend = figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(
        left / frame.width_in, top / frame.height_in), frameon=False, borderpad=0, borderaxespad=0, handlelength=2.6,
        labelspacing=0.9, alignment="left")
    box = legend.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
    names = " | ".join(robot.name for robot in world.robots)
    robots = [f"{robot.name}: {_limits(robot.fuel_capacity_s, robot.mission_limit_s)}" for robot in world.robots]
    lines = ["Incentives below a point of interest:", *textwrap.wrap(names, 36), "", *robots]
    figure.text(left / frame.width_in, box.y0 / DPI / frame.height_in - 0.18 / frame.height_in, "\n".join(lines),
                va="top", fontsize=8, linespacing=1.45)


def _limits(fuel_s: float, mission_s: float) -> str:
    fuel = f"{fuel_s:g} s of fuel" if math.isfinite(fuel_s) else "fuel without end"
    return f"{fuel}, home in {mission_s:g} s" if math.isfinite(mission_s) else f"{fuel}, no time limit"


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
        mpl.rcParams.update(_SETTINGS | {"svg.fonttype": "none", "font.size": 10.0, "axes.spines.top": False,
                                         "axes.spines.right": False, "axes.axisbelow": True})
        figure = Figure(figsize=size_in, facecolor="white", layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure.add_subplot())
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return for_page(stream.getvalue(), name, title)


def for_page(svg: str, name: str, title: str) -> str:
    """An SVG file's picture, its ids its own and its title said."""
    picture = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg"):], flags=re.DOTALL)
    picture = re.sub(r'\bid="', f'id="{name}-', picture)
    picture = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{name}-", picture)
    escaped_title = html.escape(title)
    return picture.replace("<svg ", f'<svg role="img" aria-label="{escaped_title}" ', 1).replace(
        ">", f"><title>{escaped_title}</title>", 1).strip()
