"""The bounds of all columns of the edge model, and how reduced costs tighten them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray

_ROUNDING = 1e-6  # of a column's range, for rounding
_LEAST = 1e-9  # reduced cost that counts as none


@dataclass(frozen=True, eq=False, kw_only=True)
class Box:
    """Bounds of all columns, integers.

    Attributes:
        lower: Shape (columns,).
        upper: Shape (columns,).
    """

    lower: NDArray[np.int8]
    upper: NDArray[np.int8]

    @property
    def is_empty(self) -> bool:
        """Whether it holds no point."""
        return bool((self.lower > self.upper).any())

    @property
    def free(self) -> BoolArray:
        """Columns that are not fixed, shape (columns,)."""
        free: BoolArray = self.lower < self.upper
        return free

    def holds(self, point: FloatArray) -> bool:
        """Whether it holds a point of the model."""
        return bool((point > self.lower - 0.5).all() and (point < self.upper + 0.5).all())

    def within(self, other: Box) -> Box:
        """What it has in common with another."""
        return Box(lower=np.maximum(self.lower, other.lower), upper=np.minimum(self.upper, other.upper))

    def split(self, column: int, least: int) -> tuple[Box, Box]:
        """The part where a column is below a number, and the part where it is not."""
        lower, upper = self.lower.copy(), self.upper.copy()
        upper[column], lower[column] = least - 1, least
        return Box(lower=self.lower, upper=upper), Box(lower=lower, upper=self.upper)

    def above(self, cutoff: float, bound: float, reduced: FloatArray) -> Box:
        """The part that holds every point of this box that is worth more than the cutoff.

        Args:
            cutoff: The value.
            bound: Upper bound on the points of this box: the sum of a constant and, for each column, the greater
                product of its reduced cost with one of its bounds.
            reduced: The reduced costs, shape (columns,).
        """
        away = np.full(len(reduced), 127.0)  # how far a column may be from its better bound
        counts = np.abs(reduced) > _LEAST
        away[counts] = np.minimum(np.floor(max(bound - cutoff, 0.0) / np.abs(reduced[counts]) + _ROUNDING), 127.0)
        steps = away.astype(np.int16)
        lower = np.where(reduced > 0, np.maximum(self.lower, self.upper - steps), self.lower)
        upper = np.where(reduced < 0, np.minimum(self.upper, self.lower + steps), self.upper)
        return Box(lower=lower.astype(np.int8), upper=upper.astype(np.int8))


Inspect = Callable[[Box, Box | None], None]
"""Told of every pruning: of a box, and the part of it in which alone there can be a better plan; ``None`` = nowhere."""
