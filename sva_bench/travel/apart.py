"""A proof that no path joins two places, by a lattice that is fine where passages are narrow."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from sva_bench.arrays import FloatArray
from sva_bench.geometry.buckets import clearance_checker, keeps_clear, keeps_clearance
from sva_bench.geometry.obstacles import Obstacles

_CELL_M, _CELLS = 0.02, 200_000  # finest cell, and most cells
_FINER = 32  # parts of a cell's side, in narrow passages
_NEAR = 2  # cells from one that is open for sure, up to which another counts as open
_ROUNDING_M = 1e-6
_SHUT, _SPLIT, _OPEN = 0, 1, 2


def proved_apart(obstacles: Obstacles, start: FloatArray, end: FloatArray, clearance_m: float) -> bool:
    """Whether it is proved that no path between two places keeps a clearance; of gaps that lack a millimetre too.

    Any point of such a path lies in a cell, and the middle of that is nearer to an obstacle by half its diagonal at
    most. So the cells of a path are open, and each touches the next. Small cells prove more; they are needed only where
    all that is open is narrow.

    Args:
        obstacles: The obstacles.
        start, end: The places [m], shape (2,).
        clearance_m: Distance that paths keep from obstacles [m].
    """
    low, high = obstacles.bounds_m[:2], obstacles.bounds_m[2:]
    cell = max(_CELL_M, math.sqrt(float(np.prod(high - low)) / _CELLS))
    counts = np.maximum(np.ceil((high - low) / cell).astype(np.int64), 1)
    x, y = (low[axis] + (np.arange(counts[axis]) + 0.5) * cell for axis in (0, 1))
    centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    half = cell * math.sqrt(0.5)
    touched, sure = (keeps_clearance(obstacles, centres, clearance_m + more).reshape(tuple(counts))
                     for more in (-half - _ROUNDING_M, half))
    wide = binary_dilation(sure, np.ones((3, 3), dtype=np.bool_), iterations=_NEAR)
    kind = np.where(touched, np.where(wide, _OPEN, _SPLIT), _SHUT)
    fine = clearance_checker(obstacles, clearance_m - half / _FINER, _ROUNDING_M)
    return not _floods(kind.astype(np.uint8), fine, low, cell, start, end)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _floods(
    kind: NDArray[np.uint8], fine: FloatArray, low: FloatArray, cell: float, start: FloatArray, end: FloatArray
) -> bool:
    """Whether open cells that touch each other lead from one place to another.

    Args:
        kind: Whether a cell is shut, open as a whole, or split into parts of which those are open whose middles pass
            ``fine``, shape (columns, rows).
        fine: From ``clearance_checker``.
        low: Corner of the lattice [m].
        cell: Side of a cell [m].
        start, end: The places [m].
    """
    columns, rows = kind.shape
    seen = np.zeros((columns, rows), dtype=np.bool_)  # cells that are open as a whole
    rank = np.full((columns, rows), -1, dtype=np.int64)  # of split cells among those looked at
    parts, split = np.zeros((64, _FINER, _FINER), dtype=np.bool_), 0  # those looked at
    goal = (min(max(int((end[0] - low[0]) / cell), 0), columns - 1),
            min(max(int((end[1] - low[1]) / cell), 0), rows - 1))
    stack, count = np.empty((4096, 2), dtype=np.int64), 1  # where to go on, in parts of cells
    stack[0, 0] = min(max(int((start[0] - low[0]) / cell * _FINER), 0), columns * _FINER - 1)
    stack[0, 1] = min(max(int((start[1] - low[1]) / cell * _FINER), 0), rows * _FINER - 1)
    while count > 0:
        count -= 1
        u, v, wide = stack[count, 0], stack[count, 1], 1
        x, y = u // _FINER, v // _FINER
        if kind[x, y] == _SHUT or seen[x, y]:
            continue
        if kind[x, y] == _OPEN:
            seen[x, y] = True
            u, v, wide = x * _FINER, y * _FINER, _FINER
        else:
            if rank[x, y] < 0:
                if split == len(parts):
                    parts = np.concatenate((parts, np.zeros_like(parts)))
                rank[x, y] = split
                split += 1
            known = parts[rank[x, y], u % _FINER, v % _FINER]
            parts[rank[x, y], u % _FINER, v % _FINER] = True
            middle_x, middle_y = low[0] + (u + 0.5) * cell / _FINER, low[1] + (v + 0.5) * cell / _FINER
            if known or not keeps_clear(fine, middle_x, middle_y, middle_x, middle_y):
                continue
        if (x, y) == goal:
            return True
        if count + 4 * _FINER + 4 > len(stack):
            stack = np.concatenate((stack, np.empty_like(stack)))
        for side_x in range(-1, 2):
            for side_y in range(-1, 2):
                # All parts that touch it on this side; one is enough of a cell that is open.
                a, b = (u - 1, u, u + wide)[side_x + 1], (v - 1, v, v + wide)[side_y + 1]
                if (side_x == 0 and side_y == 0) or not (0 <= a < columns * _FINER and 0 <= b < rows * _FINER):
                    continue
                other = kind[a // _FINER, b // _FINER]
                if other == _SHUT or seen[a // _FINER, b // _FINER]:
                    continue
                for k in range(wide if other == _SPLIT and (side_x == 0 or side_y == 0) else 1):
                    stack[count, 0], stack[count, 1] = a + k * (side_x == 0), b + k * (side_y == 0)
                    count += 1
    return False
