"""Worlds as pictures, to scale, for print and for colour-blind readers. Same world, same picture, byte by byte."""

from __future__ import annotations

import io
import math

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MultipleLocator

from sva_bench.arrays import FloatArray
from sva_bench.recording.meetings import floors_of
from sva_bench.report.canvas import SETTINGS
from sva_bench.report.ground import (
    DPI,
    GREY,
    MANY,
    Frame,
    corners,
    every,
    frame_of,
    layers,
    shown_of,
    tick_step,
    within,
)
from sva_bench.report.labels import place_labels
from sva_bench.report.legend import add_legend
from sva_bench.report.overlays import Kind, Overlays
from sva_bench.report.styles import (
    JUDGED,
    MARKS,
    PASSAGE,
    PASSAGE_PT,
    PATH,
    ROADMAP,
    ROBOTS,
    SITE_MARKERS,
    STANDS,
    floor_style,
)
from sva_bench.world.model import World

_MARK_PT, _MOST_MARK_PT = 5.0, 14.0
_MARK_WEIGHT = 8  # points of a line that a mark counts as where labels look for room
_HALO = withStroke(linewidth=2.2, foreground="white")
_PER_LINE = 4  # incentives on a line of a label
_MOST_MINDED = 300  # paths that labels try to leave free; more leave no room anyway
_LEADER = 9.0  # pixels between a marker and its label from which on a line joins them
_OPAQUE = 4000  # edges of a roadmap that are drawn in full colour; more share their ink, so that the map is seen
_FAINTEST = 0.15  # opacity of an edge of a roadmap at least, else single edges can't be seen


def draw_world(world: World, kind: Kind, overlays: Overlays) -> bytes:
    """A picture of a world, as the content of its file."""
    with mpl.rc_context():
        mpl.rcdefaults()  # whatever a user has set up
        mpl.rcParams.update(SETTINGS)
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
        add_legend(figure, frame, world, overlays)
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
        axes.add_patch(Polygon(corners_of_floor, zorder=0.4, **floor_style(floor)))
    for passage in world.passages:
        ax, ay, bx, by = passage.ends_m
        axes.plot([ax, bx], [ay, by], color=PASSAGE, linestyle=(0, (2.2, 1.2)), linewidth=2.4, zorder=3.5,
                  dash_capstyle="butt")
    return axes


def _stands(axes: Axes, overlays: Overlays) -> None:
    """Berths with the names of their robots, and slots, as wide as who stands there."""
    for stand in overlays.stands:
        colour, _ = STANDS[stand.kind]
        axes.add_patch(Circle((stand.x_m, stand.y_m), stand.radius_m, facecolor="none", edgecolor=colour,
                              linestyle=(0, (2, 1.2)), linewidth=0.9, zorder=3.6))
        if stand.kind == "berth":
            axes.annotate(stand.name, (stand.x_m, stand.y_m), fontsize=6, color=colour, ha="center", va="center",
                          zorder=6, path_effects=[_HALO])


def _planned(axes: Axes, overlays: Overlays) -> None:
    if overlays.roadmap is not None:
        edges = len(overlays.roadmap)
        axes.add_collection(LineCollection(
            list(overlays.roadmap), colors=ROADMAP, linewidths=0.1, zorder=2, rasterized=edges > MANY,
            alpha=min(1.0, max(_OPAQUE / max(edges, 1), _FAINTEST))), autolim=False)
    axes.add_collection(LineCollection(list(overlays.paths), colors=PATH, linewidths=0.6, zorder=3),
                        autolim=False)


def _routes(axes: Axes, overlays: Overlays) -> None:
    for number, legs in enumerate(overlays.routes.values()):
        colour, style, width = ROBOTS[number % len(ROBOTS)]
        for leg in legs:
            axes.plot(*leg.path.T, color=colour, linestyle=style, linewidth=width, zorder=4 + 0.01 * number,
                      dash_capstyle="butt", solid_capstyle="round")
            _arrow(axes, leg.path, colour)


def _judged(axes: Axes, overlays: Overlays) -> None:
    """Legs in the colour of their judgement, each with its direction."""
    for number, leg in enumerate(overlays.judged):
        colour, style, width = JUDGED[leg.judged]
        axes.plot(*leg.path.T, color=colour, linestyle=style, linewidth=width, zorder=4 + 0.01 * number,
                  dash_capstyle="butt", solid_capstyle="round")
        _arrow(axes, leg.path, colour)


def _marks(axes: Axes, overlays: Overlays) -> None:
    """What was met, the larger the more often; a ring about a place that a robot never got away from."""
    for mark in overlays.marks:
        shape, colour, _ = MARKS[mark.kind]
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
        marker, colour, size = SITE_MARKERS[site.kind]
        axes.plot(site.x_m, site.y_m, marker=marker, markersize=size, color=colour, markeredgecolor="black",
                  markeredgewidth=0.8, zorder=7)
        earned = _earned(world, site.name) if site.kind == "poi" else []
        earned += [f"{site.slots} slots"] if site.slots > 1 else []
        labels.append((Text(text=site.name, fontsize=8, weight="bold"),
                       *(Text(text=line, fontsize=7) for line in earned)))
    labels += [(Text(text=passage.name, fontsize=7, color=PASSAGE),) for passage in world.passages]
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
    across_pt = [*(SITE_MARKERS[site.kind][2] for site in world.sites), *(PASSAGE_PT for _ in middles)]
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
