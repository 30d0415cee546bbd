"""The earliest way of one robot through the cells that those planned before it leave free, compiled.

A forward dynamic programme over cells and their safe intervals: to be somewhere earlier within an interval is never
worse, since the robot may wait there until the interval ends.

Source:
    Phillips & Likhachev (2011), "SIPP: Safe Interval Path Planning for Dynamic Environments", along given paths.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray, IntArray

SPARE_S = 0.3
"""Time that a cell is kept free before and after another robot's stay in it [s]."""


@njit(cache=True)  # type: ignore[untyped-decorator]
def _safe_intervals(
    cell: int, earliest: float, start: IntArray, way: NDArray[np.int32], low: NDArray[np.int32],
    high: NDArray[np.int32], chosen: BoolArray, enter: FloatArray, leave: FloatArray, begins: FloatArray,
    ends: FloatArray,
) -> int:
    """Fill in the safe intervals of a cell that end at ``earliest`` or later [s]; their number.

    Args:
        cell: The cell.
        earliest: When anybody can be there at the earliest.
        start, way, low, high: ``Runs``.
        chosen: Which ways are planned, shape (ways,).
        enter, leave: When the robots that are planned enter and leave each cell of theirs [s], shape (cells,).
        begins, ends: Filled in; room for one more than the runs of any cell. The first begins at ``-inf``.
    """
    # The blocks between them first, by insertion in order of their beginning: begins[k], ends[k].
    count = 0
    for run in range(start[cell], start[cell + 1]):
        if not chosen[way[run]]:
            continue
        since, until = enter[low[run]] - SPARE_S, leave[high[run]] + SPARE_S
        if until < earliest:
            continue
        k = count
        while k > 0 and begins[k - 1] > since:
            begins[k], ends[k] = begins[k - 1], ends[k - 1]
            k -= 1
        begins[k], ends[k] = since, until
        count += 1
    # Then the gaps in their place: gap number ``safe`` ends where a block begins, and the next begins where it ends.
    safe, since, k = 0, -math.inf, 0
    while k < count:
        block, until = begins[k], ends[k]
        k += 1
        while k < count and begins[k] <= until:
            until = max(until, ends[k])
            k += 1
        if block > since:
            begins[safe], ends[safe] = since, block
            safe += 1
        since = until
    if since < math.inf:
        begins[safe], ends[safe] = since, math.inf
        safe += 1
    return safe


@njit(cache=True)  # type: ignore[untyped-decorator]
def plan_earliest(
    ways: IntArray, first: IntArray, lasts: FloatArray, ready: float, start: IntArray, way: NDArray[np.int32],
    low: NDArray[np.int32], high: NDArray[np.int32], chosen: BoolArray, enter: FloatArray, leave: FloatArray,
) -> float:
    """Plan a robot among those planned; its earliest end [s], ``inf`` if there is none.

    One loop, because compiled code called for each cell would pass a dozen arrays each time.

    Args:
        ways: Number of the first way of each of its legs, then the end, shape (legs + 1,).
        first: Number of the first cell of each way of all robots, and of all.
        lasts: Shortest stay in each cell [s].
        ready: When it may set off [s].
        start, way, low, high, chosen, enter, leave: As for ``_safe_intervals``. If there is an end, ``chosen``,
            ``enter`` and ``leave`` are filled in for its ways; it enters its first cell at ``-inf``.
    """
    base, stop = first[ways[0]], first[ways[-1]]
    at = np.zeros(stop - base + 1, dtype=np.int64)  # where the states of each cell begin
    most = 1
    for cell in range(base, stop):
        most = max(most, start[cell + 1] - start[cell] + 1)
    begins, ends, best, back = np.empty(most), np.empty(most), np.empty(most), np.empty(most, dtype=np.int64)
    arrive, until = np.empty(4096), np.empty(4096)  # of each state: earliest arrival, and end of its safe interval
    before = np.empty(4096, dtype=np.int64)  # the state that it is entered from
    cell_of = np.empty(4096, dtype=np.int64)
    count = 0
    for leg in range(len(ways) - 1):
        for mine in range(ways[leg], ways[leg + 1]):
            for cell in range(first[mine], first[mine + 1]):
                at[cell - base] = count
                sources = (mine, mine + 1)  # the ways that it is entered from
                if cell == first[mine] and leg > 0:
                    sources = (ways[leg - 1], ways[leg])
                begin = cell == first[mine] and leg == 0
                earliest = -math.inf if begin else math.inf
                if not begin:
                    for source in range(sources[0], sources[1]):
                        last = cell - 1 if source == mine else first[source + 1] - 1
                        if at[last - base] < at[last - base + 1]:
                            earliest = min(earliest, arrive[at[last - base]] + lasts[last])
                    if earliest == math.inf:
                        at[cell - base + 1] = count
                        continue
                safe = _safe_intervals(cell, earliest, start, way, low, high, chosen, enter, leave, begins, ends)
                best[:safe] = math.inf
                if begin:
                    # It holds the cell from the beginning, before it is ready too.
                    if safe > 0 and begins[0] == -math.inf and ends[0] >= ready:
                        best[0], back[0] = ready, -1
                else:
                    for source in range(sources[0], sources[1]):
                        last = cell - 1 if source == mine else first[source + 1] - 1
                        k = 0
                        for state in range(at[last - base], at[last - base + 1]):
                            soonest = arrive[state] + lasts[last]
                            while k < safe and ends[k] < soonest:
                                k += 1
                            onward = k
                            while onward < safe and begins[onward] <= until[state]:
                                time = max(soonest, begins[onward])
                                if time <= until[state] and time < best[onward]:
                                    best[onward], back[onward] = time, state
                                onward += 1
                for k in range(safe):
                    if best[k] == math.inf:
                        continue
                    if count == len(arrive):
                        arrive, until = np.append(arrive, arrive), np.append(until, until)
                        before, cell_of = np.append(before, before), np.append(cell_of, cell_of)
                    arrive[count], until[count], before[count], cell_of[count] = best[k], ends[k], back[k], cell
                    count += 1
                at[cell - base + 1] = count
    end, state = math.inf, -1
    for mine in range(ways[-2], ways[-1]):
        last = first[mine + 1] - 1
        # It stays there for good: only the state whose interval has no end will do.
        newest = at[last - base + 1] - 1
        if newest >= at[last - base] and until[newest] == math.inf and arrive[newest] + lasts[last] < end:
            end, state = arrive[newest] + lasts[last], newest
    if state < 0:
        return end
    chosen[ways[0]:ways[-1]] = False
    mine, leaves = ways[-1], math.inf
    while state >= 0:
        cell = cell_of[state]
        while first[mine] > cell:
            mine -= 1
        chosen[mine] = True
        leave[cell], enter[cell] = leaves, arrive[state]
        leaves, state = arrive[state], before[state]
    enter[cell] = -math.inf
    return end
