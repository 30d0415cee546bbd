"""Maps of worlds on a page: SVG made by hand, small, coloured by the page's style sheet in light and dark.

Lengths in the picture are in its own units, of which the longer side of a map has ``_LONGEST``.
"""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.choices import SiteKind
from sva_bench.recording.meetings import floors_of
from sva_bench.report.ground import corners, shown_of, tick_step, within
from sva_bench.report.labels import place_labels
from sva_bench.report.mark_labels import Box
from sva_bench.report.page import text
from sva_bench.report.stands import stands_of
from sva_bench.report.styles import SITE_KINDS
from sva_bench.world.model import Site, World

GROUND = "ground"
"""Id of what all maps of a page share."""
_LONGEST = 420.0
_MARGIN = 5.0  # the wall about the map
_SCALE = 13.0  # height of the scale below it
_LETTER, _SMALL, _LINE = 6.8, 5.8, 12.0  # widths of letters of labels, a little more than on average; height of a line
_RADII: dict[SiteKind, float] = {"base": 6.0, "station": 6.0, "poi": 4.5}
_MOST_CELLS = 700  # of a grid along a side; finer ones are shown coarser
_MOST_LABELS = 120  # sites from which on only the tooltip names them


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Where the world lies in the picture.

    Attributes:
        x0_m, y1_m: Its upper left corner.
        per_m: Scale.
        width, height: Of the picture.
    """

    x0_m: float
    y1_m: float
    per_m: float
    width: float
    height: float

    def at(self, places_m: FloatArray) -> FloatArray:
        """Places [m] in the picture, shape (n, 2)."""
        moved: FloatArray = (np.asarray(places_m, dtype=np.float64) - (self.x0_m, self.y1_m)) * (
            self.per_m, -self.per_m) + _MARGIN
        return moved


def frame_of(world: World) -> Frame:
    """The frame of a world's maps."""
    x0, y0, x1, y1 = shown_of(world).tolist()
    per_m = (_LONGEST - 2 * _MARGIN) / max(x1 - x0, y1 - y0)
    return Frame(x0_m=x0, y1_m=y1, per_m=per_m, width=(x1 - x0) * per_m + 2 * _MARGIN,
                 height=(y1 - y0) * per_m + 2 * _MARGIN)


class PlanView:
    """The maps of one world: the first holds the ground, the others refer to it.

    Args:
        world: The world.
        lines_m: Lines that labels had better leave free [m], each of shape (k, 2).
        busy: Places of the picture that labels had better leave free, shape (k, 2).
        incentives: Whether what robots earn stands below each POI.
        drawn: Whether the page has the ground already.
    """

    def __init__(self, world: World, lines_m: Iterable[FloatArray] = (), busy: FloatArray | None = None, *,
                 incentives: bool = False, drawn: bool = False) -> None:
        self.frame = frame_of(world)
        self._world, self._drawn = world, drawn
        self._sites, self.taken = _sites(world, self.frame, list(lines_m), np.empty((0, 2)) if busy is None else busy,
                                         incentives=incentives)

    def picture(self, title: str, inner: str = "", above: str = "") -> str:
        """A map as SVG.

        Args:
            title: What it shows, for those who can't see it.
            inner: What lies between ground and sites.
            above: What lies above the sites.
        """
        ground = f'<use href="#{GROUND}"/>' if self._drawn else \
            f'<g id="{GROUND}">{_ground(self._world, self.frame)}</g>'
        self._drawn = True
        frame = self.frame
        return (f'<svg class=plan role=img aria-label="{text(title)}" viewBox="0 0 {_n(frame.width)} '
                f'{_n(frame.height + _SCALE)}" style="max-width:{frame.width * 1.4:.0f}px">{ground}{inner}'
                f"{self._sites}{above}{_scale(frame)}</svg>")


def line(points: FloatArray) -> str:
    """A line through points of the picture, as the data of a path."""
    (x, y), *others = np.round(points, 1).tolist()
    said = [f"M{_n(x)} {_n(y)}"]
    for nx, ny in others:
        said.append(f"l{_n(nx - x)} {_n(ny - y)}")
        x, y = nx, ny
    return "".join(said)


def _n(figure: float) -> str:
    """A number in as few letters as it takes."""
    return f"{round(figure, 1) + 0.0:g}"


def _ground(world: World, frame: Frame) -> str:
    """What is free and what isn't, patches of floor, passages, berths and slots."""
    x0, y0, x1, y1 = world.obstacles.bounds_m.tolist()
    (left, top), (right, bottom) = frame.at(np.array([[x0, y1], [x1, y0]])).tolist()
    left, top, right, bottom = max(left, _MARGIN), max(top, _MARGIN), min(right, frame.width - _MARGIN), \
        min(bottom, frame.height - _MARGIN)
    parts = [f'<rect class=solid width="{_n(frame.width)}" height="{_n(frame.height)}" rx="3"/>',
             f'<rect class=free x="{_n(left)}" y="{_n(top)}" width="{_n(right - left)}" height="{_n(bottom - top)}"/>']
    cells = world.obstacles.cells
    if cells is None:
        outlines = "".join(f"{line(frame.at(box))}z" for box in corners(world.obstacles.boxes))
        parts += [f'<path class=solid d="{outlines}"/>'] if outlines else []
    else:
        parts.append(_grid(world, frame))
    for x, y, radius in world.obstacles.cylinders.tolist():
        (px, py), = frame.at(np.array([[x, y]])).tolist()
        parts.append(f'<circle class=solid cx="{_n(px)}" cy="{_n(py)}" r="{_n(radius * frame.per_m)}"/>')
    for box, floor in zip(corners(world.obstacles.floors), floors_of(world.obstacles.floors), strict=True):
        parts.append(f'<path class=slippery d="{line(frame.at(box))}z"><title>floor, friction {floor.friction:g}'
                     "</title></path>")
    for passage in world.passages:
        ends = line(frame.at(np.reshape(passage.ends_m, (2, 2))))
        parts.append(f'<path class=passage d="{ends}"><title>{text(passage.name)}: shut with {passage.blocked:g}, then '
                     f"a wait of {passage.wait_s:g} s</title></path>")
    for stand in stands_of(world):
        (px, py), = frame.at(np.array([[stand.x_m, stand.y_m]])).tolist()
        parts.append(f'<circle class=stand cx="{_n(px)}" cy="{_n(py)}" r="{_n(stand.radius_m * frame.per_m)}">'
                     f"<title>{stand.kind} of {text(stand.name)}</title></circle>")
    return "".join(parts)


def _grid(world: World, frame: Frame) -> str:
    """An occupancy grid, as an image of its cells."""
    cells = world.obstacles.cells
    assert cells is not None
    step = -(-max(cells.occupied.shape) // _MOST_CELLS)
    occupied = _coarser(cells.occupied, step)
    # Its own frame: right along x, down against y; the image's rows begin with the uppermost.
    rows, columns = occupied.shape
    cell_m = cells.cell_m * step
    place = frame.at(cells.to_world(cell_m * np.array([[0.0, rows], [1.0, rows], [0.0, rows - 1]])))
    (ox, oy), (ax, ay), (bx, by) = place.tolist()
    moved = f"matrix({ax - ox:.5g} {ay - oy:.5g} {bx - ox:.5g} {by - oy:.5g} {ox:.5g} {oy:.5g})"
    return (f'<svg x="0" y="0" width="{_n(frame.width)}" height="{_n(frame.height)}"><image class=cells '
            f'width="{columns}" height="{rows}" preserveAspectRatio="none" transform="{moved}" '
            f'href="data:image/png;base64,{base64.b64encode(_png(occupied[::-1])).decode()}"/></svg>')


def _coarser(occupied: BoolArray, step: int) -> BoolArray:
    """A grid of cells that are so many times larger, occupied if most of it is."""
    if step == 1:
        return occupied
    rows, columns = (-(-side // step) * step for side in occupied.shape)
    whole = np.ones((rows, columns), dtype=np.bool_)
    whole[:occupied.shape[0], :occupied.shape[1]] = occupied
    coarse: BoolArray = whole.reshape(rows // step, step, columns // step, step).mean(axis=(1, 3)) >= 0.5
    return coarse


def _png(occupied: BoolArray) -> bytes:
    """A picture with one bit a cell: grey, or nothing."""
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows, columns = occupied.shape
    lines = np.packbits(occupied, axis=1)
    raw = np.concatenate([np.zeros((rows, 1), dtype=np.uint8), lines], axis=1).tobytes()
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 1, 3, 0, 0, 0))
            + chunk(b"PLTE", bytes([255, 255, 255, 140, 140, 140])) + chunk(b"tRNS", bytes([0, 255]))
            + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b""))


def _sites(world: World, frame: Frame, lines_m: Sequence[FloatArray], busy: FloatArray, *, incentives: bool
           ) -> tuple[str, list[Box]]:
    """Markers of all sites with their tooltips, and their names; and the room that all of them take."""
    at = frame.at(np.array([[site.x_m, site.y_m] for site in world.sites]))
    parts, taken = [], list[Box]()
    for site, (x, y) in zip(world.sites, at.tolist(), strict=True):
        size = _RADII[site.kind]
        taken.append((x - size, y - size, x + size, y + size))
        parts.append(f"<g class={site.kind}><title>{text(_told(world, site))}</title>{_marker(site.kind, x, y)}</g>")
    if len(world.sites) > _MOST_LABELS:
        return "".join(parts), taken
    labels = [[site.name, *(_earned(world, site) if incentives and site.kind == "poi" else [])] for site in world.sites]
    sizes = np.array([[max([_LETTER * len(name), *(_SMALL * len(words) for words in small)]), _LINE * (1 + len(small))]
                      for name, *small in labels])
    drawn = [_dense(frame.at(path)) for path in lines_m]
    # Placed as in pixels of a picture of twice the size, which the gaps about labels are meant for.
    centres = place_labels(
        2 * at, 2 * sizes, radii=2 * np.array([_RADII[site.kind] for site in world.sites]),
        frame=2 * np.array([_MARGIN, _MARGIN, frame.width - _MARGIN, frame.height - _MARGIN]),
        lines=2 * np.concatenate([*drawn, busy, np.repeat(at, 3, axis=0)]), solid=2 * frame.at(within(world))) / 2
    for lines, (x, y) in zip(labels, centres.tolist(), strict=True):
        top = y - _LINE * len(lines) / 2 + 0.78 * _LINE
        parts += [f'<text x="{_n(x)}" y="{_n(top + k * _LINE)}"{" class=small" if k else ""}>{text(words)}</text>'
                  for k, words in enumerate(lines)]
    taken += [(x - w / 2, y - h / 2, x + w / 2, y + h / 2)
              for (x, y), (w, h) in zip(centres.tolist(), sizes.tolist(), strict=True)]
    return "".join(parts), taken


def _dense(points: FloatArray, step: float = 6.0) -> FloatArray:
    """Points along a line of the picture."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    places = np.arange(0, arc[-1] + step, step)
    return np.column_stack([np.interp(places, arc, points[:, k]) for k in (0, 1)])


def _told(world: World, site: Site) -> str:
    said = f"{site.name}: {SITE_KINDS[site.kind]}"
    if site.kind == "poi":
        said += ", worth " + ", ".join(f"{robot.incentives.get(site.name, 0.0):g} to {robot.name}"
                                       for robot in world.robots)
    return said + (f"; a stop takes {site.stop_s:g} s" if site.stop_s else "")


def _earned(world: World, site: Site) -> list[str]:
    """What each robot earns at a POI, in a few lines."""
    values = [f"{value:g}" if (value := robot.incentives.get(site.name, 0.0)) else "–" for robot in world.robots]
    return ["|".join(values[k:k + 4]) for k in range(0, len(values), 4)]


def _marker(kind: SiteKind, x: float, y: float) -> str:
    size = _RADII[kind]
    if kind == "base":
        return f'<rect x="{_n(x - size)}" y="{_n(y - size)}" width="{_n(2 * size)}" height="{_n(2 * size)}"/>'
    if kind == "station":
        return f'<path d="M{_n(x)} {_n(y - size)}l{_n(size)} {_n(1.8 * size)}h{_n(-2 * size)}z"/>'
    return f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(size)}"/>'


def _scale(frame: Frame) -> str:
    """A bar below the map, about a fifth of it long."""
    length_m = tick_step(2.4 * (frame.width - 2 * _MARGIN) / frame.per_m)
    length = length_m * frame.per_m
    x, y = frame.width - length - 1, frame.height + 9
    return (f'<g class=scale><path d="M{_n(x)} {_n(y - 4)}v4h{_n(length)}v-4"/><text x="{_n(x - 4)}" '
            f'y="{_n(y + 1)}">{length_m:g} m</text></g>')
