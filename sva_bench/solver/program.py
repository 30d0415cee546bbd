"""Linear programs as arrays, rows, columns and objective, and their results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray

SolveStatus = Literal["optimal", "infeasible", "time_limit", "interrupted"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Rows:
    """Linear constraints ``lower <= A x <= upper``, A by rows.

    Attributes:
        lower: Shape (rows,); ``-inf`` = none.
        upper: Shape (rows,); ``inf`` = none.
        start: Where a row's entries begin, shape (rows + 1,).
        column: Column of each entry.
        value: Value of each entry.
    """

    lower: FloatArray
    upper: FloatArray
    start: IntArray
    column: IntArray
    value: FloatArray

    @classmethod
    def none(cls) -> Rows:
        """No rows."""
        return cls(lower=np.zeros(0), upper=np.zeros(0), start=np.zeros(1, dtype=np.int64),
                   column=np.zeros(0, dtype=np.int64), value=np.zeros(0))


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearModel:
    """Maximise ``objective @ x`` subject to rows and bounds.

    Attributes:
        objective: Shape (columns,).
        upper: Upper bounds, shape (columns,); lower bounds are 0.
        integer: Which columns are integer, shape (columns,).
        rows: The constraints.
        aggregates: Whether presolve may substitute columns. Where flows of fuel and time are coupled, by charging,
            HiGHS's substitutions may go on for ever.
    """

    objective: FloatArray
    upper: FloatArray
    integer: BoolArray
    rows: Rows
    aggregates: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class MipResult:
    """The result of a mixed-integer program.

    Attributes:
        status: How it ended.
        values: The best point found, shape (columns,); ``None`` if none was.
        objective: Its objective; ``-inf`` if none was found.
        bound: Upper bound on the objective; ``inf`` if none is known.
        nodes: Branch-and-bound nodes.
    """

    status: SolveStatus
    values: FloatArray | None
    objective: float
    bound: float
    nodes: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Relaxed:
    """The optimum of a linear program.

    Attributes:
        status: How it ended.
        values: The optimum, shape (columns,); ``None`` if there is none, or it was not reached.
        objective: Its objective; ``-inf`` if there is none, ``inf`` if it was not reached.
        reduced: Reduced cost of each column, positive where raising it would improve the objective, shape (columns,).
        activity: Value of each row, shape (rows,).
        duals: Dual value of each row: gain in the objective per unit of its bound, shape (rows,).
    """

    status: SolveStatus
    values: FloatArray | None
    objective: float
    reduced: FloatArray
    activity: FloatArray
    duals: FloatArray


class RowBuilder:
    """Rows under construction."""

    def __init__(self) -> None:
        self.lower: list[float] = []
        self.upper: list[float] = []
        self.start: list[int] = [0]
        self.column: list[IntArray] = []
        self.value: list[FloatArray] = []

    def add(self, columns: Sequence[int] | IntArray, values: Sequence[float] | FloatArray, lower: float,
            upper: float) -> None:
        """Add one row: its columns and their values, and its bounds."""
        self.column.append(np.asarray(columns, dtype=np.int64))
        self.value.append(np.asarray(values, dtype=np.float64))
        self.start.append(self.start[-1] + len(columns))
        self.lower.append(lower)
        self.upper.append(upper)

    def rows(self) -> Rows:
        """The rows added so far."""
        return Rows(
            lower=np.array(self.lower, dtype=np.float64), upper=np.array(self.upper, dtype=np.float64),
            start=np.array(self.start, dtype=np.int64),
            column=np.concatenate([np.zeros(0, dtype=np.int64), *self.column]),
            value=np.concatenate([np.zeros(0), *self.value]),
        )
