"""Lanes as arrays: the ways of all robots of a team one behind the other, for compiled code."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.shared.lanes import Lane
from sva_bench.robot.model import RobotModel
from sva_bench.robot.twin import patience_steps

GOES_ON, ENDS_HOP, ENDS_LEG = 0, 1, 2
"""How a stretch ends: at a corner, at a stop that is no site of the route, at one that is."""


class Ways(NamedTuple):
    """The lanes of all robots, one behind the other.

    Attributes:
        path: Vertices of all stretches [m], shape (vertices, 2).
        arc: Arc length at each vertex, from the start of its stretch [m].
        vertex: First vertex of each stretch, and of all, shape (stretches + 1,).
        heading: Heading at the end of each stretch [rad].
        before_m: Way of its leg before each stretch [m].
        patience: Control steps after which an unfinished stretch counts as stuck.
        ends: How each stretch ends.
        leg_stretch: First stretch of each leg, shape (robots, legs + 1).
        leg_cell: First cell of each leg, and of all, shape (robots, legs + 1); numbered for each robot.
        cells: Number of cells of each robot that have gates.
        need: Cells that the others must have reached before a cell is entered, shape (cells of all, robots).
        need_row: Row of each robot's first cell in ``need``.
    """

    path: FloatArray
    arc: FloatArray
    vertex: IntArray
    heading: FloatArray
    before_m: FloatArray
    patience: IntArray
    ends: IntArray
    leg_stretch: IntArray
    leg_cell: IntArray
    cells: IntArray
    need: IntArray
    need_row: IntArray


class _Flat(NamedTuple):
    """One lane's part of ``Ways``, counted from its own start."""

    path: FloatArray
    arc: FloatArray
    vertex: IntArray
    heading: FloatArray
    before_m: FloatArray
    ends: IntArray
    leg_stretch: IntArray


_flat: weakref.WeakKeyDictionary[Lane, _Flat] = weakref.WeakKeyDictionary()  # trials of a pattern share their lanes
_patience: weakref.WeakKeyDictionary[Lane, dict[str, IntArray]] = weakref.WeakKeyDictionary()


def ways_of(models: Sequence[RobotModel], lanes: Sequence[Lane | None],
            needs: Sequence[Sequence[IntArray] | None]) -> Ways:
    """Put the lanes of a team together.

    Args:
        models: The robots.
        lanes: The lane of each, ``None`` = it has none.
        needs: For each robot and each other one, the cell that the other must have reached before each of its cells;
            ``None`` = it has no gates.
    """
    flat = [_NOTHING if lane is None else _flattened(lane) for lane in lanes]
    legs = max(len(part.leg_stretch) for part in flat)
    vertices = np.cumsum([0, *(len(part.path) for part in flat)])
    stretches = np.cumsum([0, *(len(part.heading) for part in flat)])
    count = len(lanes)
    leg_stretch, leg_cell = np.zeros((count, legs), dtype=np.int64), np.zeros((count, legs), dtype=np.int64)
    cells, rows = np.zeros(count, dtype=np.int64), [np.empty((0, count), dtype=np.int64)]
    for i, (part, lane, need) in enumerate(zip(flat, lanes, needs, strict=True)):
        leg_stretch[i, :len(part.leg_stretch)] = part.leg_stretch + stretches[i]
        if lane is not None:
            leg_cell[i, :len(lane.first_cell)] = lane.first_cell
            if need is not None:
                cells[i] = lane.first_cell[-1]
                rows.append(np.column_stack([
                    np.zeros(cells[i], dtype=np.int64) if j == i else need[j] for j in range(count)]))
    return Ways(
        path=np.concatenate([part.path for part in flat]), arc=np.concatenate([part.arc for part in flat]),
        vertex=np.concatenate([*(part.vertex[:-1] + start for part, start in zip(flat, vertices[:-1], strict=True)),
                               vertices[-1:]]),
        heading=np.concatenate([part.heading for part in flat]),
        before_m=np.concatenate([part.before_m for part in flat]),
        patience=np.concatenate([np.empty(0, dtype=np.int64), *(
            _patience_of(lane, model) for lane, model in zip(lanes, models, strict=True) if lane is not None)]),
        ends=np.concatenate([part.ends for part in flat]), leg_stretch=leg_stretch, leg_cell=leg_cell, cells=cells,
        need=np.ascontiguousarray(np.concatenate(rows)), need_row=np.cumsum([0, *cells[:-1]]))


def _flattened(lane: Lane) -> _Flat:
    if (known := _flat.get(lane)) is not None:
        return known
    paths, arcs, headings, before, ends, firsts = [], [], [], [], [], [0]
    for cut in lane.cuts:
        way_m = 0.0
        for hop in cut.leg:
            for stretch in hop:
                paths.append(stretch.path)
                arcs.append(stretch.arc)
                headings.append(stretch.heading_rad)
                before.append(way_m)
                ends.append(GOES_ON)
                way_m += float(stretch.arc[-1])
            ends[-1] = ENDS_HOP
        ends[-1] = ENDS_LEG
        firsts.append(len(paths))
    _flat[lane] = _Flat(
        path=np.ascontiguousarray(np.concatenate(paths)), arc=np.concatenate(arcs),
        vertex=np.cumsum([0, *map(len, paths)]), heading=np.array(headings), before_m=np.array(before),
        ends=np.array(ends, dtype=np.int64), leg_stretch=np.array(firsts, dtype=np.int64))
    return _flat[lane]


def _patience_of(lane: Lane, model: RobotModel) -> IntArray:
    known = _patience.setdefault(lane, {})
    if model.name not in known:
        known[model.name] = np.array([patience_steps(stretch, model) for cut in lane.cuts for hop in cut.leg
                                      for stretch in hop], dtype=np.int64)
    return known[model.name]


_NOTHING = _Flat(path=np.empty((0, 2)), arc=np.empty(0), vertex=np.zeros(1, dtype=np.int64), heading=np.empty(0),
                 before_m=np.empty(0), ends=np.empty(0, dtype=np.int64), leg_stretch=np.zeros(1, dtype=np.int64))
