"""Paths of the legs that plans drive, as a table: written with a run, and read where a run has them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from sva_bench.arrays import FloatArray
from sva_bench.errors import BadFile
from sva_bench.mission.plan import Route
from sva_bench.storage.run_folder import Legs
from sva_bench.storage.tables import PATHS, pieces_of, write_table
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

Ends = tuple[str, str, str]
"""Robot model, or robot where robots meet; origin; destination."""
LegPaths = Mapping[Ends, FloatArray]
"""Path of each leg [m], shape (k, 2)."""

MOST_POINTS = 2_000_000
"""Points that are read, for they are held in memory."""
_FARTHEST_M = 1e6
_OFF_M = 0.01  # how far a corner that is left out may lie off the path
_NAME = "paths.parquet"


def paths_of(world: World, costs: Mapping[str, FuelCosts], plans: Iterable[Mapping[str, Route]], legs: Legs
             ) -> LegPaths:
    """The paths of all legs that some plan has, or that were driven; a repaired leg is the chain that it stands for.

    Args:
        world: The world.
        costs: Travel times and fuel costs, by robot model, or robot where robots meet.
        plans: Routes of each robot.
        legs: What was driven.
    """
    kinds = {robot.name: world.kind_of(robot) for robot in world.robots}
    wanted = {(kinds[robot], *ends) for plan in plans for robot, route in plan.items()
              for ends in itertools.pairwise(route)}
    wanted |= {(kinds[robot], origin, destination) for robot, origin, destination in set(
        zip(legs.robot, legs.origin, legs.destination, strict=True))}
    return {(kind, origin, destination): _rounded(np.concatenate([
        costs[kind].times.path(a, b) for a, b in itertools.pairwise(costs[kind].chain(origin, destination))]))
        for kind, origin, destination in sorted(wanted) if origin != destination}


def _rounded(path: FloatArray) -> FloatArray:
    """A path in millimetres, without the corners that make no difference to the eye."""
    kept: FloatArray = np.round(path[_corners(path)], 3) + 0.0
    return kept


def _corners(path: FloatArray) -> list[int]:
    """Points of a path that it cannot do without.

    Source:
        Douglas & Peucker (1973), Algorithms for the reduction of the number of points.
    """
    kept, todo = {0, len(path) - 1}, [(0, len(path) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        along, between = path[last] - path[first], path[first + 1:last] - path[first]
        length = float(np.hypot(*along))
        off = np.abs(between @ np.array([-along[1], along[0]])) / length if length > 0 else np.hypot(*between.T)
        farthest = int(np.argmax(off))
        if off[farthest] > _OFF_M:
            middle = first + 1 + farthest
            kept.add(middle)
            todo += [(first, middle), (middle, last)]
    return sorted(kept)


def write_paths(folder: Path, paths: LegPaths) -> None:
    """Write ``paths.parquet``, if there is any path."""
    columns: dict[str, list[Any]] = {name: [] for name in PATHS.names}
    for (kind, origin, destination), path in paths.items():
        columns["model"] += [kind] * len(path)
        columns["origin"] += [origin] * len(path)
        columns["destination"] += [destination] * len(path)
        columns["point"] += range(len(path))
        columns["x_m"] += path[:, 0].tolist()
        columns["y_m"] += path[:, 1].tolist()
    if paths:
        write_table(folder / _NAME, PATHS, [pa.table(columns, schema=PATHS)])


def read_paths(folder: Path, world: World) -> LegPaths:
    """Paths of the legs of a run folder; none of one that lacks them, as older ones do.

    Raises:
        BadFile: If the table is none of ours, or not of this world.
    """
    path = folder / _NAME
    if not path.is_file():
        return {}
    sites = frozenset(site.name for site in world.sites)
    words = {"model": frozenset(world.kind_of(robot) for robot in world.robots), "origin": sites, "destination": sites}
    found: dict[Ends, list[tuple[float, float]]] = {}
    for piece in pieces_of(path, PATHS, most=MOST_POINTS, words=words):
        for kind, origin, destination, number, x, y in zip(*(_plain(piece, name) for name in PATHS.names), strict=True):
            points = found.setdefault((kind, origin, destination), [])
            if number != len(points) or not (abs(x) <= _FARTHEST_M and abs(y) <= _FARTHEST_M):  # nor NaN
                raise BadFile(path, None, "point", f"expected the points of the path from {origin!r} to "
                              f"{destination!r} in order; run the command in manifest.json again")
            points.append((x, y))
    return {ends: np.array(points) for ends, points in found.items() if len(points) > 1}


def _plain(piece: pa.Table, name: str) -> Sequence[Any]:
    values: Sequence[Any] = piece.column(name).to_pylist()
    return values
