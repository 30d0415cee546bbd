"""Where a world lies in its picture, and what of it is drawn: geometry for ``drawing``."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.geometry.cells import TooManyBoxes, bounds_of, boxes_of
from sva_bench.world.model import World

DPI = 200
"""Resolution of pictures in pixels."""

MANY = 2000
"""Boxes, or edges, from which on an SVG holds them as an image."""
GREY, LIGHT_GREY = "#969696", "#d6d6d6"


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
    x0, y0, x1, y1 = shown_of(world).tolist()
    longest = max(x1 - x0, y1 - y0)
    wall = 0.012 * longest
    in_per_m = min(max(1.55 * math.sqrt(len(world.sites)), 6.0), 16.0) / longest
    width, height = ((high - low + 2 * wall) * in_per_m for low, high in ((x0, x1), (y0, y1)))
    return Frame(width_in=round(width + 3.0, 2), height_in=round(max(height + 1.05, 4.0), 2), left_in=0.6,
                 bottom_in=round(max(height + 1.05, 4.0), 2) - 0.45 - height, in_per_m=in_per_m, x0_m=x0 - wall,
                 y0_m=y0 - wall, x1_m=x1 + wall, y1_m=y1 + wall)


def shown_of(world: World) -> FloatArray:
    """x_min, y_min, x_max, y_max [m] of what there is to see: maps of ROS often have wide margins of nothing."""
    cells = world.obstacles.cells
    if cells is None or cells.occupied.all():
        return world.obstacles.bounds_m
    rows, columns = (np.flatnonzero(~cells.occupied.all(axis=axis)) for axis in (1, 0))
    free = replace(cells, occupied=np.zeros((np.ptp(rows) + 1, np.ptp(columns) + 1), dtype=np.bool_), unknown=None)
    corner = cells.to_world(np.array([[columns[0], rows[0]]]) * cells.cell_m)[0]
    return bounds_of(replace(free, origin=np.array([*corner, cells.origin[2]])))


def layers(world: World) -> list[tuple[FloatArray, str, float]]:
    """Boxes with their colours, from below: what is known to be occupied lies over what only counts as such."""
    boxes, cells = world.obstacles.boxes, world.obstacles.cells
    if not has_unknown(world) or cells is None or cells.unknown is None:
        return [(boxes, GREY, 1.0)] if len(boxes) else []
    try:
        known = boxes_of(replace(cells, occupied=cells.occupied & ~cells.unknown, unknown=None))
    except TooManyBoxes:
        return [(boxes, LIGHT_GREY, 0.5)]
    # Where a grid stands askew, the first four fill what is outside it.
    return [(boxes, LIGHT_GREY, 0.5), (known[4 if cells.origin[2] else 0:], GREY, 1.0)]


def has_unknown(world: World) -> bool:
    cells = world.obstacles.cells
    return cells is not None and cells.unknown is not None and bool(cells.unknown.any())


def tick_step(length_m: float) -> float:
    """The least of 1, 2, 5, 10, ... m that makes twelve ticks at most."""
    steps = (step * 10.0**power for power in range(-3, 6) for step in (1, 2, 5))
    return next(step for step in steps if length_m <= 12 * step)


def corners(boxes: FloatArray) -> FloatArray:
    """Corners of boxes, shape (k, 4, 2)."""
    cosine, sine = np.cos(boxes[:, 4])[:, None], np.sin(boxes[:, 4])[:, None]
    along, across = boxes[:, 2, None] * np.array([1, -1, -1, 1]), boxes[:, 3, None] * np.array([1, 1, -1, -1])
    return np.stack([boxes[:, 0, None] + cosine * along - sine * across,
                     boxes[:, 1, None] + sine * along + cosine * across], axis=-1)


def within(world: World) -> FloatArray:
    """Points in obstacles, about a hundred across the picture: where a label is harder to read."""
    points = []
    x0, y0, x1, y1 = shown_of(world).tolist()
    step = max(x1 - x0, y1 - y0) / 100
    for x, y, hx, hy, yaw in world.obstacles.boxes[:MANY].tolist():
        a, b = (np.linspace(-h, h, min(int(2 * h / step) + 2, 100)) for h in (hx, hy))
        grid = np.stack(np.meshgrid(a, b), axis=-1).reshape(-1, 2)
        points.append(grid @ np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]]) + (x, y))
    for x, y, radius in world.obstacles.cylinders.tolist():
        angles = np.linspace(0, 2 * math.pi, 12)
        points.append(np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=-1))
    return np.concatenate(points) if points else np.empty((0, 2))


def every(path: FloatArray, step: float = 8.0) -> FloatArray:
    """Points along a path, so many pixels apart."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.arange(0, arc[-1] + step, step)
    return np.column_stack([np.interp(at, arc, path[:, 0]), np.interp(at, arc, path[:, 1])])
