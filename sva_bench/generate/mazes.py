"""Walls of a maze without closed cells."""

from __future__ import annotations

import numpy as np

Line = tuple[tuple[float, float], tuple[float, float]]


def maze_walls(size_m: float, cell_m: float, density: float, rng: np.random.Generator) -> list[Line]:
    """Inner walls of a square maze, as lines.

    A depth-first search with random choices opens a path from each cell to each other and no loop; of the walls that
    it leaves, a share stands.

    Args:
        size_m: Side of the square.
        cell_m: Side of a cell, about.
        density: Share of the walls that stand; 1 leaves no loops.
        rng: Random numbers.

    Source:
        The recursive backtracker, a randomised depth-first search.
    """
    n = max(round(size_m / cell_m), 2)
    passages: set[tuple[tuple[int, int], tuple[int, int]]] = set()
    here = (int(rng.integers(n)), int(rng.integers(n)))
    seen, stack = {here}, [here]
    while stack:
        x, y = here = stack[-1]
        unvisited = [(i, j) for i, j in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1))
                 if 0 <= i < n and 0 <= j < n and (i, j) not in seen]
        if not unvisited:
            stack.pop()
            continue
        there = unvisited[int(rng.integers(len(unvisited)))]
        passages |= {(here, there), (there, here)}
        seen.add(there)
        stack.append(there)
    # A wall by the line it is on (0 = x, 1 = y fixed; its number) and the cell that it runs along.
    walls = [(0, x + 1, y) for x in range(n - 1) for y in range(n) if ((x, y), (x + 1, y)) not in passages]
    walls += [(1, y + 1, x) for y in range(n - 1) for x in range(n) if ((x, y), (x, y + 1)) not in passages]
    order = rng.permutation(len(walls))[:round(density * len(walls))]
    return _merged(sorted(walls[int(k)] for k in order), size_m / n)


def _merged(walls: list[tuple[int, int, int]], cell_m: float) -> list[Line]:
    """Walls as lines, with collinear adjacent ones merged."""
    runs: list[list[int]] = []
    for axis, line, cell in walls:
        if runs and runs[-1][:2] == [axis, line] and runs[-1][3] == cell:
            runs[-1][3] = cell + 1
        else:
            runs.append([axis, line, cell, cell + 1])
    lines: list[Line] = []
    for axis, line, first, last in runs:
        at, start, end = (round(k * cell_m, 2) for k in (line, first, last))
        lines.append(((at, start), (at, end)) if axis == 0 else ((start, at), (end, at)))
    return lines
