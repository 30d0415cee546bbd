"""Lanes as arrays: the ways of all robots of a team one behind the other, for compiled code."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.shared.lanes import Lane
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import patience_steps

GOES_ON, ENDS_HOP, ENDS_LEG = 0, 1, 2
"""How a stretch ends: at a corner, at a stop that is no site of the route, at one that is."""



class Stretch(Protocol):
    """A record of a stretch.

    Attributes:
        first, end: Its first vertex, and that of the next stretch.
        heading: Heading at its end [rad].
        before_m: Way of its leg before it [m].
        patience: Control steps after which it counts as stuck if unfinished.
        ends: How it ends.
    """

    first: int
    end: int
    heading: float
    before_m: float
    patience: int
    ends: int


STRETCH = np.dtype([("first", np.int64), ("end", np.int64), ("heading", np.float64), ("before_m", np.float64),
                    ("patience", np.int64), ("ends", np.int64)], align=True)


class Ways(NamedTuple):
    """The lanes of all robots, one behind the other.

    Attributes:
        path: Vertices of all stretches [m], shape (vertices, 2).
        arc: Arc length at each vertex, from the start of its stretch [m].
        stretches: Records of ``STRETCH``.
        need: Cells that the others must have reached before a cell is entered, shape (cells with gates, robots).
    """

    path: FloatArray
    arc: FloatArray
    stretches: NDArray[Any]
    need: IntArray


class Places(NamedTuple):
    """Where the lanes are in ``Ways``.

    Attributes:
        first_stretch: First stretch of each leg, for each robot.
        cells: Number of cells of each robot that have gates.
        need_row: Row of each robot's first cell in ``Ways.need``.
    """

    first_stretch: tuple[tuple[int, ...], ...]
    cells: tuple[int, ...]
    need_row: tuple[int, ...]


class _Flat(NamedTuple):
    """One lane's part of ``Ways``, counted from its own start; without patience, which is a matter of the model."""

    path: FloatArray
    arc: FloatArray
    stretches: NDArray[Any]
    first_stretch: IntArray


_flat: weakref.WeakKeyDictionary[Lane, dict[tuple[float, float], _Flat]] = weakref.WeakKeyDictionary()
"""By what patience with a robot depends on, its greatest speed and turn rate: trials of an order share their lanes."""


def ways_of(models: Sequence[RobotModel], lanes: Sequence[Lane | None],
            needs: Sequence[Sequence[IntArray] | None]) -> tuple[Ways, Places]:
    """Put the lanes of a team together.

    Args:
        models: The robots.
        lanes: The lane of each, ``None`` = it has none.
        needs: For each robot and each other one, the cell that the other must have reached before each of its cells;
            ``None`` = it has no gates.
    """
    flat = [_flattened(lane, model) if lane is not None and lane.cuts else _NOTHING
            for lane, model in zip(lanes, models, strict=True)]
    vertices = np.cumsum([0, *(len(part.path) for part in flat)]).tolist()
    numbers = np.cumsum([0, *(len(part.stretches) for part in flat)]).tolist()
    stretches = np.concatenate([part.stretches for part in flat])
    for first, end, vertex in zip(numbers[:-1], numbers[1:], vertices[:-1], strict=True):
        stretches["first"][first:end] += vertex
        stretches["end"][first:end] += vertex
    rows, cells = [np.empty((0, len(lanes)), dtype=np.int64)], [0] * len(lanes)
    for i, (lane, need) in enumerate(zip(lanes, needs, strict=True)):
        if lane is not None and need is not None:
            cells[i] = int(lane.first_cell[-1])
            none = np.zeros(cells[i], dtype=np.int64)
            rows.append(np.column_stack([none if j == i else need[j] for j in range(len(lanes))]))
    ways = Ways(path=np.concatenate([part.path for part in flat]), arc=np.concatenate([part.arc for part in flat]),
                stretches=stretches, need=np.ascontiguousarray(np.concatenate(rows)))
    return ways, Places(
        first_stretch=tuple(tuple((part.first_stretch + first).tolist())
                            for part, first in zip(flat, numbers[:-1], strict=True)),
        cells=tuple(cells), need_row=tuple(np.cumsum([0, *cells[:-1]]).tolist()))


def _flattened(lane: Lane, model: RobotModel) -> _Flat:
    known, key = _flat.setdefault(lane, {}), (model.followed_speed_m_s, model.max_turn_rad_s)
    if key in known:
        return known[key]
    paths, arcs, records, firsts, vertex = [], [], [], [0], 0
    for cut in lane.cuts:
        way_m = 0.0
        for number, hop in enumerate(cut.leg, start=1):
            for k, stretch in enumerate(hop, start=1):
                ends = GOES_ON if k < len(hop) else ENDS_HOP if number < len(cut.leg) else ENDS_LEG
                records.append((vertex, vertex + len(stretch.path), stretch.heading_rad, way_m,
                                patience_steps(stretch, model), ends))
                paths.append(stretch.path)
                arcs.append(stretch.arc)
                way_m += float(stretch.arc[-1])
                vertex += len(stretch.path)
        firsts.append(len(records))
    known[key] = _Flat(path=np.ascontiguousarray(np.concatenate(paths)), arc=np.concatenate(arcs),
                       stretches=np.array(records, dtype=STRETCH), first_stretch=np.array(firsts))
    return known[key]


_NOTHING = _Flat(path=np.empty((0, 2)), arc=np.empty(0), stretches=np.empty(0, dtype=STRETCH),
                 first_stretch=np.zeros(1, dtype=np.int64))
