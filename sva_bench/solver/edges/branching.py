"""Where to branch: reliability branching on visits, and on edges where all visits are integer.

Source:
    Achterberg, Koch, Martin (2005), "Branching rules revisited".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.solver.edges.box import Box
from sva_bench.solver.edges.program import EdgeProgram
from sva_bench.solver.knowledge import Clock

_FRACTION = 1e-6  # distance from an integer that counts as rounding
_RELIABLE = 4  # looks from which pseudo-costs are trusted
_ITERATIONS = 100  # of a probe
_CANDIDATES = 12  # probed at most
_LOOKAHEAD = 6  # candidates in a row that are no better, after which probing ends
_LEAST = 1e-6  # gain that counts as one


@dataclass(frozen=True, eq=False, kw_only=True)
class Branch:
    """Two parts of a node.

    Attributes:
        column: The column that divides it.
        least: Its least value in the upper part; it is below in the lower part.
        losses: What the relaxation loses in the lower and in the upper part, estimated.
        bounds: Upper bounds on the parts; ``inf`` = unknown.
    """

    column: int
    least: int
    losses: tuple[float, float]
    bounds: tuple[float, float]


class PseudoCosts:
    """Mean losses of the relaxation for each unit by which a column is moved, down and up."""

    def __init__(self, columns: int) -> None:
        self._sum = np.zeros((2, columns))
        self._looks = np.zeros((2, columns), dtype=np.int64)

    def learn(self, side: int, column: int, loss: float, moved: float) -> None:
        """Take account of a loss."""
        self._sum[side, column] += max(loss, 0.0) / moved
        self._looks[side, column] += 1

    def is_reliable(self, column: int) -> bool:
        """Whether there were enough looks on both sides."""
        return bool(self._looks[:, column].min() >= _RELIABLE)

    def estimate(self, columns: IntArray, fraction: FloatArray) -> FloatArray:
        """Losses of columns if moved to the integers around, shape (2, columns)."""
        looks, total = self._looks[:, columns], self._sum[:, columns]
        all_looks = self._looks.sum(axis=1)
        mean = np.where(all_looks > 0, self._sum.sum(axis=1) / np.maximum(all_looks, 1), 1.0)
        rates = np.where(looks > 0, total / np.maximum(looks, 1), mean[:, None])
        estimate: FloatArray = rates * np.array([fraction, 1 - fraction])
        return estimate


def candidates(program: EdgeProgram, values: FloatArray, box: Box) -> IntArray:
    """Fractional visits, or fractional edges if there are none."""
    fractional = (np.abs(values - np.rint(values)) > _FRACTION) & box.free
    visits = np.flatnonzero(fractional & (program.flow.ends[:, 0] < 0))
    return visits if len(visits) else np.flatnonzero(fractional)


def choose(
    program: EdgeProgram, costs: PseudoCosts, values: FloatArray, box: Box, bound: float, cutoff: float, clock: Clock,
) -> Branch | list[tuple[int, int, bool]]:
    """The branch of greatest product of losses; or parts of the node that hold no better plan.

    Args:
        program: The program, solved to the optimum of the node.
        costs: What earlier branches lost.
        values: The optimum, not integer.
        box: Bounds of the node.
        bound: Objective of the optimum.
        cutoff: Value up to which points are of no interest.
        clock: Time left.

    Returns:
        The branch; or a list of a column, the least value of its upper part, and whether it is the upper part that
        holds no better plan.
    """
    columns = candidates(program, values, box)
    fraction = values[columns] - np.floor(values[columns])
    estimate = costs.estimate(columns, fraction)
    gap = max(bound - cutoff, _LEAST)
    order = np.argsort(-_score(estimate, gap), kind="stable")
    best, best_score, probed, in_vain = None, -1.0, 0, 0
    warm = None
    empty: list[tuple[int, int, bool]] = []
    for k in order:
        column, least = int(columns[k]), math.floor(values[columns[k]]) + 1
        losses, bounds = estimate[:, k].copy(), [math.inf, math.inf]
        if not costs.is_reliable(column) and probed < _CANDIDATES and in_vain < _LOOKAHEAD and not clock.is_over():
            warm = warm or program.warm_start()
            probed += 1
            for side in range(2):
                program.start_from(warm)
                lower, upper = int(box.lower[column]), int(box.upper[column])
                lower, upper = (lower, least - 1) if side == 0 else (least, upper)
                end, objective, bounds[side] = program.probe(column, lower, upper, cutoff, _ITERATIONS, clock.left_s())
                if end in ("infeasible", "cutoff"):  # both are proved; at its limit of iterations it proves nothing
                    empty.append((column, least, side == 1))
                    losses[side] = gap
                else:
                    losses[side] = bound - objective
                if end != "infeasible" and math.isfinite(objective):
                    costs.learn(side, column, bound - objective, fraction[k] if side == 0 else 1 - fraction[k])
        score = float(_score(losses[:, None], gap)[0])
        if score > best_score:
            best, best_score, in_vain = Branch(column=column, least=least, losses=(losses[0], losses[1]),
                                               bounds=(bounds[0], bounds[1])), score, 0
        else:
            in_vain += 1
    if warm is not None:
        program.start_from(warm)
    assert best is not None
    return empty or best


def _score(losses: FloatArray, gap: float) -> FloatArray:
    """Product of the losses of both sides, none worth more than the gap, shape (columns,)."""
    capped = np.clip(losses, _LEAST * gap, gap)
    score: FloatArray = capped[0] * capped[1]
    return score
