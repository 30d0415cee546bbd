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
from dataclasses import dataclass, field
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes as Axes  # charts draw on them
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MultipleLocator

from sva_bench.arrays import FloatArray
from sva_bench.choices import Judgement, MarkKind, SiteKind, StandKind
from sva_bench.files.printable import counted
from sva_bench.recording.meetings import Floor, floors_of
from sva_bench.report.ground import (
    DPI,
    GREY,
    LIGHT_GREY,
    MANY,
    Frame,
    corners,
    every,
    frame_of,
    has_unknown,
    layers,
    shown_of,
    tick_step,
    within,
)
from sva_bench.report.labels import place_labels
from sva_bench.report.stands import Stand
from sva_bench.world.model import World

Kind = Literal["png", "svg"]

OBSTACLE_RGB = (150, 150, 150)
"""Colour of obstacles and outer walls; what is free stays white."""
UNKNOWN_RGB = (214, 214, 214)
"""Colour of what counts as occupied since nothing is known of it."""
_MARKERS: dict[SiteKind, tuple[str, str, float]] = {  # shape, colour, size [pt]
    "base": ("s", "#000000", 10.0), "station": ("^", "#0072B2", 9.5), "poi": ("o", "#E69F00", 7.5)}
_KINDS: dict[SiteKind, str] = {"base": "base", "station": "refuelling station", "poi": "point of interest"}
_ROUTES: tuple[tuple[str, Any, float], ...] = (  # colour, style, width [pt]; later ones lie on top, so thinner
    ("#D55E00", "-", 2.6), ("#009E73", (0, (5, 2)), 2.0), ("#CC79A7", (0, (1.2, 1.5)), 2.0),
    ("#56B4E9", (0, (6, 1.5, 1.2, 1.5)), 1.8), ("#000000", (0, (3, 4)), 1.4))
_PASSAGE, _PASSAGE_PT = "#0B6E4F", 5.0  # colour; width that names keep off it [pt]
_MARKS: dict[MarkKind, tuple[str, str, str]] = {  # shape, colour, what it is
    "contact": ("X", "#D00000", "contact"), "wait": ("D", "#7B3294", "wait")}
_STANDS: dict[StandKind, tuple[str, str]] = {  # colour, what it is
    "berth": ("#000000", "berth of a robot"), "slot": ("#0072B2", "slot of a station")}
_MARK_PT, _MOST_MARK_PT = 5.0, 14.0
_MARK_WEIGHT = 8  # points of a line that a mark counts as where labels look for room
_JUDGED: dict[Judgement, tuple[str, Any, float]] = {  # colour, style, width [pt]
    "safe": ("#009E73", "-", 1.6), "close": ("#E69F00", (0, (5, 1.5)), 2.2), "edge": ("#D00000", "-", 3.4)}
_JUDGED_TOLD: dict[Judgement, str] = {"safe": "leg with margin to spare", "close": "leg with little margin",
                                      "edge": "leg on a knife's edge"}
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Leg:
    """A leg of a route: where it ends, and the path there [m], shape (k, 2)."""

    destination: str
    path: FloatArray


@dataclass(frozen=True, kw_only=True)
class Mark:
    """What robots met about a place [m]: how many times, and whether one never got away."""

    kind: MarkKind
    x_m: float
    y_m: float
    count: int
    stuck: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class JudgedLeg:
    """A leg of a route by how safe it is: its path [m], shape (k, 2), and the judgement."""

    path: FloatArray
    judged: Judgement


@dataclass(frozen=True, eq=False, kw_only=True)
class Overlays:
    """What is shown beside map and sites.

    Attributes:
        roadmap: Both ends of each edge [m], shape (e, 2, 2).
        paths: Paths between sites [m], each of shape (k, 2).
        routes: Legs of each robot's route.
        marks: What robots met where.
        judged: Legs by how safe they are, the worst to be seen last.
        stands: Berths, and slots of stations.
    """

    roadmap: FloatArray | None = None
    paths: Sequence[FloatArray] = ()
    routes: Mapping[str, Sequence[Leg]] = field(default_factory=dict)
    marks: Sequence[Mark] = ()
    judged: Sequence[JudgedLeg] = ()
    stands: Sequence[Stand] = ()


def draw_world(world: World, kind: Kind, overlays: Overlays) -> bytes:
    """A picture of a world, as the content of its file."""
    with mpl.rc_context():
        mpl.rcdefaults()  # whatever a user has set up
        mpl.rcParams.update(_SETTINGS)
        frame = frame_of(world)
        figure = Figure(figsize=(frame.width_in, frame.height_in), dpi=DPI, facecolor="white")
        FigureCanvasAgg(figure)
        axes = _map(figure, frame, world)
        _stands(axes, overlays)
        _planned(axes, overlays)
        _routes(axes, overlays)
        _judged(axes, overlays)
        _marks(axes, overlays)
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
    step = tick_step(max(frame.x1_m - frame.x0_m, frame.y1_m - frame.y0_m))
    axes.xaxis.set_major_locator(MultipleLocator(step))
    axes.yaxis.set_major_locator(MultipleLocator(step))
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    figure.text(frame.left_in / frame.width_in, 1 - 0.15 / frame.height_in, world.name, fontsize=12, weight="bold",
                va="top")
    x0, y0, x1, y1 = world.obstacles.bounds_m.tolist()
    axes.add_patch(Rectangle((frame.x0_m, frame.y0_m), frame.x1_m - frame.x0_m, frame.y1_m - frame.y0_m,
                             facecolor=GREY, edgecolor="none", zorder=0))
    axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, facecolor="white", edgecolor="none", zorder=0))
    for boxes, colour, order in layers(world):
        # The hairline keeps boxes that touch from showing a seam.
        axes.add_collection(PolyCollection(
            list(corners(boxes)), facecolors=colour, edgecolors=colour, linewidths=0.2, zorder=order,
            rasterized=len(boxes) > MANY), autolim=False)
    for x, y, radius in world.obstacles.cylinders.tolist():
        axes.add_patch(Circle((x, y), radius, facecolor=GREY, edgecolor="none", zorder=1))
    for corners_of_floor, floor in zip(corners(world.obstacles.floors), floors_of(world.obstacles.floors), strict=True):
        axes.add_patch(Polygon(corners_of_floor, zorder=0.4, **_floor_style(floor)))
    for passage in world.passages:
        ax, ay, bx, by = passage.ends_m
        axes.plot([ax, bx], [ay, by], color=_PASSAGE, linestyle=(0, (2.2, 1.2)), linewidth=2.4, zorder=3.5,
                  dash_capstyle="butt")
    return axes


def _floor_style(floor: Floor) -> dict[str, Any]:
    return {"facecolor": tuple(channel / 255 for channel in floor.color), "edgecolor": "#7fb6d3", "hatch": "////",
            "linewidth": 0.6}


def _stands(axes: Axes, overlays: Overlays) -> None:
    """Berths with the names of their robots, and slots, as wide as who stands there."""
    for stand in overlays.stands:
        colour, _ = _STANDS[stand.kind]
        axes.add_patch(Circle((stand.x_m, stand.y_m), stand.radius_m, facecolor="none", edgecolor=colour,
                              linestyle=(0, (2, 1.2)), linewidth=0.9, zorder=3.6))
        if stand.kind == "berth":
            axes.annotate(stand.name, (stand.x_m, stand.y_m), fontsize=6, color=colour, ha="center", va="center",
                          zorder=6, path_effects=[_HALO])


def _planned(axes: Axes, overlays: Overlays) -> None:
    if overlays.roadmap is not None:
        edges = len(overlays.roadmap)
        axes.add_collection(LineCollection(
            list(overlays.roadmap), colors="#56B4E9", linewidths=0.1, zorder=2, rasterized=edges > MANY,
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


def _judged(axes: Axes, overlays: Overlays) -> None:
    """Legs in the colour of their judgement, each with its direction."""
    for number, leg in enumerate(overlays.judged):
        colour, style, width = _JUDGED[leg.judged]
        axes.plot(*leg.path.T, color=colour, linestyle=style, linewidth=width, zorder=4 + 0.01 * number,
                  dash_capstyle="butt", solid_capstyle="round")
        _arrow(axes, leg.path, colour)


def _marks(axes: Axes, overlays: Overlays) -> None:
    """What was met, the larger the more often; a ring about a place that a robot never got away from."""
    for mark in overlays.marks:
        shape, colour, _ = _MARKS[mark.kind]
        size = min(_MARK_PT * math.sqrt(1 + math.log2(mark.count)), _MOST_MARK_PT)
        axes.plot(mark.x_m, mark.y_m, marker=shape, markersize=size, color=colour, markeredgecolor="white",
                  markeredgewidth=0.7, zorder=7.5)
        if mark.stuck:
            axes.plot(mark.x_m, mark.y_m, marker="o", markersize=size + 6, color="none", markeredgecolor=colour,
                      markeredgewidth=1.6, zorder=7.5)
        if mark.count > 1:
            axes.annotate(str(mark.count), (mark.x_m, mark.y_m), xytext=(0.5 * size + 3, 0.3 * size), fontsize=7,
                          textcoords="offset points", color=colour, weight="bold", zorder=8, path_effects=[_HALO])


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
    """Markers of all sites, and labels of these and of passages."""
    labels: list[tuple[Text, ...]] = []
    for site in world.sites:
        marker, colour, size = _MARKERS[site.kind]
        axes.plot(site.x_m, site.y_m, marker=marker, markersize=size, color=colour, markeredgecolor="black",
                  markeredgewidth=0.8, zorder=7)
        earned = _earned(world, site.name) if site.kind == "poi" else []
        earned += [f"{site.slots} slots"] if site.slots > 1 else []
        labels.append((Text(text=site.name, fontsize=8, weight="bold"),
                       *(Text(text=line, fontsize=7) for line in earned)))
    labels += [(Text(text=passage.name, fontsize=7, color=_PASSAGE),) for passage in world.passages]
    for label in labels:
        for line in label:
            line.set(zorder=8, path_effects=[_HALO], ha="center", va="center")
            axes.add_artist(line)
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    boxes = [[line.get_window_extent(renderer) for line in lines] for lines in labels]
    to_pixels = axes.transData.transform
    middles = [np.reshape(passage.ends_m, (2, 2)).mean(axis=0) for passage in world.passages]
    at = to_pixels(np.array([*((site.x_m, site.y_m) for site in world.sites), *middles]))
    drawn = [every(to_pixels(leg.path)) for legs in overlays.routes.values() for leg in legs]
    drawn += [every(to_pixels(leg.path)) for leg in overlays.judged]
    drawn += [every(to_pixels(np.reshape(passage.ends_m, (2, 2))), 4.0) for passage in world.passages]
    drawn += [to_pixels(np.array([[mark.x_m, mark.y_m]] * _MARK_WEIGHT)) for mark in overlays.marks]
    drawn += [to_pixels(stand.outline(4 * _MARK_WEIGHT)) for stand in overlays.stands]
    if len(overlays.paths) <= _MOST_MINDED:
        drawn += [every(to_pixels(path), 16.0) for path in overlays.paths]
    x0, y0, x1, y1 = shown_of(world).tolist()
    sizes = np.array([[max(box.width for box in group), sum(box.height for box in group)] for group in boxes])
    across_pt = [*(_MARKERS[site.kind][2] for site in world.sites), *(_PASSAGE_PT for _ in middles)]
    radii = np.array(across_pt) * DPI / 72 / 2
    centres = place_labels(
        at, sizes, radii=radii,
        frame=np.concatenate([to_pixels((x0, y0)), to_pixels((x1, y1))]),
        lines=np.concatenate(drawn) if drawn else np.empty((0, 2)), solid=to_pixels(within(world)))
    back = axes.transData.inverted().transform
    for (x, y), lines, group in zip(centres, labels, boxes, strict=True):
        top = y + sum(box.height for box in group) / 2
        for line, box in zip(lines, group, strict=True):
            line.set_position(tuple(back((x, top - box.height / 2)).tolist()))
            top -= box.height
    nearest = np.clip(at, centres - sizes / 2, centres + sizes / 2)
    apart_px = np.hypot(*(nearest - at).T) - radii
    names = [*(site.name for site in world.sites), *(passage.name for passage in world.passages)]
    for name, place, here, apart in zip(names, at, nearest, apart_px, strict=True):
        if apart > _LEADER:
            ends = back(np.stack([place, here]))
            axes.plot(ends[:, 0], ends[:, 1], color="black", linewidth=0.6, zorder=6, path_effects=[_HALO],
                      gid=f"leader-{name}")


def _earned(world: World, poi: str) -> list[str]:
    """What each robot earns at a POI, in a few lines."""
    values = [f"{value:g}" if (value := robot.incentives.get(poi, 0.0)) else "–" for robot in world.robots]
    return [" | ".join(values[k:k + _PER_LINE]) for k in range(0, len(values), _PER_LINE)]


def _legend(figure: Figure, frame: Frame, world: World, overlays: Overlays) -> None:
    """What is what, to the right of the map."""
    handles: list[Any] = []
    kinds = {site.kind for site in world.sites}
    for kind, (marker, colour, size) in _MARKERS.items():
        if kind in kinds:
            handles.append(Line2D([], [], linestyle="none", marker=marker, color=colour, markersize=size,
                                  markeredgecolor="black", markeredgewidth=0.8, label=_KINDS[kind]))
    handles.append(Patch(facecolor=GREY, label="obstacle"))
    if has_unknown(world):
        handles.append(Patch(facecolor=LIGHT_GREY, label="unknown, counts as an obstacle"))
    if overlays.roadmap is not None:
        handles.append(Line2D([], [], color="#56B4E9", linewidth=0.8, label="roadmap"))
    if overlays.paths:
        handles.append(Line2D([], [], color="#0072B2", linewidth=0.8, label="path between two sites"))
    for number, (robot, legs) in enumerate(overlays.routes.items()):
        colour, style, width = _ROUTES[number % len(_ROUTES)]
        stops = ", ".join(leg.destination for leg in legs) or "stays home"
        handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=width,
                              label=textwrap.fill(f"{robot}: {stops}", 30)))
    handles += _legend_of_meetings(world, overlays)
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


def _legend_of_meetings(world: World, overlays: Overlays) -> list[Any]:
    """What is what of floors, passages, judged legs and marks."""
    floors = {f"{floor.friction:g}": floor for floor in floors_of(world.obstacles.floors)}
    handles: list[Any] = [Patch(label=f"floor, friction {friction}", **_floor_style(floor))
                          for friction, floor in sorted(floors.items())[:_MOST_FLOORS]]
    if world.passages:
        handles.append(Line2D([], [], color=_PASSAGE, linestyle=(0, (2.2, 1.2)), linewidth=2.4,
                              label="passage that may be shut"))
    handles += [Line2D([], [], linestyle="none", marker="o", color="none", markersize=9, markeredgecolor=colour,
                       label=what) for kind, (colour, what) in _STANDS.items()
                if any(stand.kind == kind for stand in overlays.stands)]
    for judged in _JUDGED:
        if any(leg.judged == judged for leg in overlays.judged):
            colour, style, width = _JUDGED[judged]
            handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=width, label=_JUDGED_TOLD[judged]))
    for kind, (shape, colour, what) in _MARKS.items():
        if count := sum(mark.count for mark in overlays.marks if mark.kind == kind):
            handles.append(Line2D([], [], linestyle="none", marker=shape, color=colour, markersize=7,
                                  markeredgecolor="white", label=counted(count, what)))
    if any(mark.stuck for mark in overlays.marks):
        handles.append(Line2D([], [], linestyle="none", marker="o", color="none", markersize=11, markeredgewidth=1.6,
                              markeredgecolor=_MARKS["contact"][1], label="a robot got stuck here"))
    return handles


_MOST_FLOORS = 4  # frictions in a legend


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
