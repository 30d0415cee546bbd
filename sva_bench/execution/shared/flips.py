"""Better orders than those of priorities: who passes a group of cells first is changed as long as that saves time."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.execution.shared.crossings import Crossings, foresee, set_needs

TOGETHER = 3
"""Groups of a pair that are changed together: one, two, up to so many, then all that are left."""
_SAVES_S = 1e-3  # what a change must save
_WORK = 100_000_000  # cells, times robots, that are looked at in all,
_THROUGH = 30_000_000  # and how many may be in going through all orders


def flipped(crossings: Crossings, ready_s: FloatArray, spare_s: float) -> tuple[IntArray, FloatArray] | None:
    """Change the order of a plan as long as that saves robot time.

    Only a change of what somebody waits for can save anything. The best of these is made, alone or together with those
    that the same two robots meet at next, and then the best after it; where none is left, two changes at once are
    tried. Of few groups all orders are gone through.

    Args:
        crossings: The groups, with the order of a plan.
        ready_s: When each robot may set off [s], shape (robots,).
        spare_s: As of ``foresee``.

    Returns:
        Which of the pair passes each group second, and when each cell is entered [s]; ``None`` if nothing saves.
    """
    first = crossings.first
    second, needs = crossings.second.copy(), crossings.needs(crossings.second)
    enter_s = np.full(len(crossings.stay_s), -math.inf)
    at, free_s = np.zeros(len(first) - 1, dtype=np.int64), ready_s + crossings.stay_s[first[:-1]]
    groups = (crossings.pair, crossings.start, crossings.waits, crossings.cell, crossings.beyond, crossings.begins)
    saved_s = _flip(first, crossings.stay_s, *groups, second, needs, at, free_s, spare_s, enter_s)
    if 2.0 ** len(second) * needs.size <= _THROUGH:
        saved_s += _go_through(first, crossings.stay_s, *groups, second, needs, at, free_s, spare_s, enter_s)
    return (second, enter_s) if saved_s > 0 else None


@njit(cache=True)  # type: ignore[untyped-decorator]
def _flip(
    first: IntArray, stay_s: FloatArray, pair: IntArray, start: IntArray, waits: IntArray, cell: IntArray,
    beyond: IntArray, begins: IntArray, second: IntArray, needs: IntArray, at: IntArray, free_s: FloatArray,
    spare_s: float, enter_s: FloatArray,
) -> float:
    """Change ``second``, and with it ``needs`` and ``enter_s``, as long as that saves time; what it saved [s].

    Args:
        first, stay_s, pair, start, waits, cell, beyond, begins: ``Crossings``.
        second: Which of the pair passes each group second, shape (groups,).
        needs, at, free_s, spare_s, enter_s: As of ``foresee``.
    """
    gone, groups = np.zeros(len(first) - 1, dtype=np.bool_), len(pair)
    then_s, kept, once = enter_s.copy(), second.copy(), second.copy()
    total = foresee(first, stay_s, needs, at, free_s, gone, spare_s, enter_s)
    begun, left, deep = total, _WORK // (len(stay_s) * len(gone)), False
    while left > 0:
        best, change = total - _SAVES_S, (-1, 0, -1, 0)
        for group in range(groups):
            if not _binds(group, first, pair, start, waits, cell, beyond, second, needs, spare_s, enter_s):
                continue
            kept[:] = second
            for count in range(1, TOGETHER + 2):
                if not turn(group, count, pair, begins, at, second):
                    second[:] = kept
                    break
                set_needs(group, first, pair, start, waits, cell, beyond, second, needs)
                left -= 1
                found = foresee(first, stay_s, needs, at, free_s, gone, spare_s, then_s)
                if found < best:
                    best, change = found, (group, count, -1, 0)
                once[:] = second
                for other in range(groups if deep and found >= total - _SAVES_S else 0):
                    if left <= 0 or not _may_follow(group, other, pair) or (found < math.inf and not _binds(
                            other, first, pair, start, waits, cell, beyond, second, needs, spare_s, then_s)):
                        continue
                    for more in range(1, TOGETHER + 2):
                        if not turn(other, more, pair, begins, at, second):
                            second[:] = once
                            break
                        set_needs(other, first, pair, start, waits, cell, beyond, second, needs)
                        left -= 1
                        both = foresee(first, stay_s, needs, at, free_s, gone, spare_s, then_s)
                        if both < best:
                            best, change = both, (group, count, other, more)
                        second[:] = once
                    set_needs(other, first, pair, start, waits, cell, beyond, second, needs)
                    if found < math.inf:
                        foresee(first, stay_s, needs, at, free_s, gone, spare_s, then_s)
                second[:] = kept
            set_needs(group, first, pair, start, waits, cell, beyond, second, needs)
        if change[0] < 0 and deep:
            break
        deep = change[0] < 0
        for group, count in (change[:2], change[2:]):
            if group >= 0:
                turn(group, count, pair, begins, at, second)
                set_needs(group, first, pair, start, waits, cell, beyond, second, needs)
        total = foresee(first, stay_s, needs, at, free_s, gone, spare_s, enter_s)
    return float(begun - total)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _go_through(
    first: IntArray, stay_s: FloatArray, pair: IntArray, start: IntArray, waits: IntArray, cell: IntArray,
    beyond: IntArray, begins: IntArray, second: IntArray, needs: IntArray, at: IntArray, free_s: FloatArray,
    spare_s: float, enter_s: FloatArray,
) -> float:
    """Go through all orders, one group changed at a time (Gray's code), and keep the best; as of ``_flip``."""
    gone, groups = np.zeros(len(first) - 1, dtype=np.bool_), len(pair)
    begun = best = foresee(first, stay_s, needs, at, free_s, gone, spare_s, enter_s)
    kept, then_s = second.copy(), enter_s.copy()
    for number in range(1, 2 ** groups):
        group = 0
        while number >> group & 1 == 0:
            group += 1
        second[group] = 1 - second[group]
        set_needs(group, first, pair, start, waits, cell, beyond, second, needs)
        possible = True
        for other in range(groups):
            late = second[other]
            possible = possible and begins[other, late] > at[pair[other, late]]
        if possible:
            found = foresee(first, stay_s, needs, at, free_s, gone, spare_s, then_s)
            if found < best - _SAVES_S:
                best = found
                kept[:], enter_s[:] = second, then_s
    second[:] = kept
    return float(begun - best)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _may_follow(group: int, other: int, pair: IntArray) -> bool:
    """Whether a robot meets somebody at both of two groups."""
    two = pair[other, 0], pair[other, 1]
    return bool(other != group and (pair[group, 0] in two or pair[group, 1] in two))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _binds(
    group: int, first: IntArray, pair: IntArray, start: IntArray, waits: IntArray, cell: IntArray, beyond: IntArray,
    second: IntArray, needs: IntArray, spare_s: float, enter_s: FloatArray,
) -> bool:
    """Whether somebody waits for a group to be passed."""
    mine, other = pair[group, second[group]], pair[group, 1 - second[group]]
    for row in range(start[group], start[group + 1]):
        if waits[row] != second[group]:
            continue
        a, b = first[mine] + cell[row], first[other] + beyond[row]
        if needs[a, other] == beyond[row] and enter_s[a] == enter_s[b] + spare_s:
            return True
    return False


@njit(cache=True)  # type: ignore[untyped-decorator]
def turn(group: int, count: int, pair: IntArray, begins: IntArray, at: IntArray, second: IntArray) -> bool:
    """Let the robot that waits at a group pass first there, and at so many of the pair's groups in all along its way.

    Args:
        group: The group.
        count: How many groups; more than ``TOGETHER`` = all that are left.
        pair, begins: ``Crossings``.
        at: The cell that each robot is in: nobody is made second who is in a group already.
        second: Which of the pair passes each group second; changed in place.

    Returns:
        Whether there were as many, and all could be changed.
    """
    late, wanted = second[group], count if count <= TOGETHER else len(pair)
    i, j = pair[group, 0], pair[group, 1]
    begin = end = group
    while begin > 0 and pair[begin - 1, 0] == i and pair[begin - 1, 1] == j:
        begin -= 1
    while end < len(pair) and pair[end, 0] == i and pair[end, 1] == j:
        end += 1
    here, turned = begins[group, late], 0
    while turned < wanted:
        # The next of them along the way of the robot that waits.
        nearest = -1
        for other in range(begin, end):
            if second[other] == late and begins[other, late] >= here and (
                    nearest < 0 or begins[other, late] < begins[nearest, late]):
                nearest = other
        if nearest < 0 and turned == 0:
            return False
        if nearest < 0:
            return wanted == len(pair)
        if turned == 0:
            nearest = group
        if begins[nearest, 1 - late] <= at[pair[group, 1 - late]]:
            return turned > 0 and wanted == len(pair)
        second[nearest] = 1 - late
        here = begins[nearest, late]
        turned += 1
    return True
