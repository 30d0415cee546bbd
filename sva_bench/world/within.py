"""Passages and floors must have something within the bounds of their world, where robots drive."""

from __future__ import annotations

import math

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.files.complaints import Loc
from sva_bench.files.documents import Document
from sva_bench.geometry.outside import is_outside
from sva_bench.world.noise_schema import FloorEntry
from sva_bench.world.schema import WorldFile


def refuse_outside(document: Document, file: WorldFile, bounds_m: FloatArray) -> None:
    """Refuse passages and floors that no robot can ever meet.

    Args:
        document: The world file.
        file: Its content.
        bounds_m: Bounds of its map [m], shape (4,).

    Raises:
        BadFile: If there is one, with file, line, key and what to change.
    """
    met: list[tuple[Loc, str, FloatArray]] = [
        (("passages", name, "at_m"), f"the passage {name!r}", np.array(entry.at_m))
        for name, entry in file.passages.items()]
    if file.map.shapes is not None:
        met += [(("map", "shapes", "floors", k, "box"), "the floor", _corners(floor))
                for k, floor in enumerate(file.map.shapes.floors)]
    x_min, y_min, x_max, y_max = bounds_m
    for loc, what, corners in met:
        if is_outside(corners, bounds_m):
            raise document.error(loc, f"{what} lies outside the bounds, {x_min:g} to {x_max:g} m and {y_min:g} to "
                                 f"{y_max:g} m, where no robot meets it; move it inside, or remove it")


def _corners(floor: FloorEntry) -> FloatArray:
    angle, (length, width) = math.radians(floor.yaw_deg), floor.size_m
    turned = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    corners: FloatArray = np.array(floor.box) + np.array(
        [(length, width), (-length, width), (-length, -width), (length, -width)]) / 2 @ turned
    return corners
