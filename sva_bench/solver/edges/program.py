"""The linear relaxation of the edge model over some of its columns and cuts, and what its duals prove.

A cut ``x(edges out of S) >= 2 s_i`` is written over the edges within S, out of S, or outside of S, whichever are the
fewest: by ``x(edges at j) = 2 s_j`` the three are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import csr_array, vstack

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.solver.edges.box import Box
from sva_bench.solver.edges.cut_duals import ACROSS, WITHIN, subtract_cuts
from sva_bench.solver.flow.undirected import UndirectedModel
from sva_bench.solver.highs import AT_LOWER, BASIC, Basis, EndOfSimplex, Simplex
from sva_bench.solver.knowledge import Cut
from sva_bench.solver.program import LinearModel, RowBuilder, Rows

_PROOF = 1e-9  # by how much multipliers of at most 1 must contradict themselves to prove a program infeasible
_CUTOFF = 1e-6  # relative; the dual simplex method goes on for so much beyond the cutoff


@dataclass(frozen=True, eq=False, kw_only=True)
class Solved:
    """The end of a solve.

    Attributes:
        status: ``empty`` where no point of the box is worth more than the cutoff, which was checked; ``unclear`` where
            HiGHS finds no point, but can't prove that there is none.
        bound: Upper bound on all points of the box, by the duals; ``inf`` where there is none.
        values: The optimum, shape (columns,).
        reduced: Reduced cost of each column of the model, shape (columns,).
    """

    status: Literal["optimal", "empty", "unclear", "time_limit"]
    bound: float
    values: FloatArray
    reduced: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class WarmStart:
    """A basis, and of what program.

    Attributes:
        columns: Columns of the model that the program had, shape (columns of the program,).
        cuts: Its cuts; there may be more by now.
        basis: The basis.
    """

    columns: IntArray
    cuts: list[Cut]
    basis: Basis


class EdgeProgram:
    """The relaxation over some columns of the edge model, open for more columns and cuts."""

    def __init__(self, flow: UndirectedModel, objective: FloatArray, columns: IntArray, cuts: Sequence[Cut]) -> None:
        self.flow, self.objective = flow, objective
        self.columns: IntArray = columns
        self.cuts: list[Cut] = []
        self.solves = 0
        rows, count = flow.model.rows, len(objective)
        self._matrix = csr_array((rows.value, rows.column, rows.start), shape=(len(rows.lower), count))
        self._transposed = self._matrix.T.tocsr()
        self._place = np.full(count, -1)
        self._place[columns] = np.arange(len(columns))
        # Of the cuts; grown ahead of their number.
        self._inside: BoolArray = np.zeros((64, flow.edge.shape[1]), dtype=np.bool_)
        self._of, self._poi, self._over = (np.zeros(64, dtype=np.int64) for _ in range(3))
        self._simplex = Simplex(LinearModel(
            objective=objective[columns], upper=flow.model.upper[columns], integer=np.zeros(len(columns), np.bool_),
            rows=_part(rows, self._place)))
        self._box = Box(lower=np.zeros(count, np.int8), upper=flow.model.upper.astype(np.int8))
        self.add_cuts(cuts)

    def set_box(self, box: Box) -> None:
        """Change the bounds of all columns."""
        changed = (box.lower != self._box.lower) | (box.upper != self._box.upper)
        which = np.flatnonzero(changed[self.columns])
        of = self.columns[which]
        self._box = box
        if len(which):
            self._simplex.set_bounds(which, box.lower[of].astype(np.float64), box.upper[of].astype(np.float64))

    def add_cuts(self, cuts: Sequence[Cut]) -> None:
        """Add cuts."""
        build = RowBuilder()
        ends, vehicle = self.flow.ends[self.columns], self.flow.vehicle[self.columns]
        is_edge = ends[:, 0] >= 0
        for cut in cuts:
            inside = np.zeros(self.flow.edge.shape[1], dtype=np.bool_)
            inside[list(cut.inside)] = True
            mine = np.flatnonzero(is_edge & (vehicle == cut.vehicle))
            count = inside[ends[mine, 0]].astype(np.int64) + inside[ends[mine, 1]]
            visits = self.flow.visit[cut.vehicle]
            there = visits >= 0
            others = there & inside
            others[cut.poi] = False
            sizes = ((count == 2).sum() + others.sum(), (count == 1).sum() + 1,
                     (count == 0).sum() + (there & ~inside).sum() + 2)
            over = int(np.argmin(sizes))
            visit = int(self._place[visits[cut.poi]])
            used = mine[count == 2 - over]
            if over == ACROSS:
                build.add([*used, visit], [1.0] * len(used) + [-2.0], 0.0, np.inf)
            elif over == WITHIN:
                minus = self._place[visits[others]]
                build.add([*used, *minus], [1.0] * len(used) + [-1.0] * len(minus), -np.inf, 0.0)
            else:
                minus = self._place[[*visits[there & ~inside], self.flow.leaves[cut.vehicle]]]
                build.add([*used, *minus, visit], [1.0] * len(used) + [-1.0] * len(minus) + [1.0], -np.inf, 0.0)
            self._note(cut, inside, over)
        if len(cuts):
            self._simplex.add_rows(build.rows())

    def _note(self, cut: Cut, inside: BoolArray, over: int) -> None:
        """Keep a cut as arrays."""
        if len(self.cuts) == len(self._of):
            self._inside = np.concatenate([self._inside, np.zeros_like(self._inside)])
            self._of, self._poi, self._over = (np.concatenate([a, np.zeros_like(a)])
                                               for a in (self._of, self._poi, self._over))
        k = len(self.cuts)
        self._inside[k], self._of[k], self._poi[k], self._over[k] = inside, cut.vehicle, cut.poi, over
        self.cuts.append(cut)

    def add_columns(self, columns: IntArray) -> None:
        """Add columns of the model that are edges."""
        count = len(self.cuts)
        inside = self._inside[:count].astype(np.int64)
        within = inside[:, self.flow.ends[columns, 0]] + inside[:, self.flow.ends[columns, 1]]
        in_cut = (self._of[:count, None] == self.flow.vehicle[columns]) & (within == 2 - self._over[:count, None])
        entries = vstack([self._matrix[:, columns], csr_array(in_cut.astype(np.float64))]).tocsc()
        self._simplex.add_columns(self.objective[columns], self.flow.model.upper[columns],
                                  entries.indptr.astype(np.int64), entries.indices.astype(np.int64), entries.data)
        self._place[columns] = len(self.columns) + np.arange(len(columns))
        self.columns = np.concatenate([self.columns, columns])
        at = self._place[columns]
        self._simplex.set_bounds(at, self._box.lower[columns].astype(np.float64),
                                 self._box.upper[columns].astype(np.float64))

    def solve(self, left_s: float, cutoff: float = -np.inf) -> Solved:
        """Solve over the box.

        What HiGHS says isn't taken on trust: a bound is computed from the duals, and so is infeasibility.

        Args:
            left_s: Time left [s].
            cutoff: Value up to which points are of no interest.
        """
        self.solves += 1
        nothing = np.zeros(0)
        for number, limit in enumerate((cutoff - _CUTOFF * max(abs(cutoff), 1.0), -np.inf)):
            end = self._simplex.solve(left_s, cutoff=limit)
            if end == "time_limit":
                return Solved(status="time_limit", bound=np.inf, values=nothing, reduced=nothing)
            if end == "infeasible":
                if self._is_infeasible():
                    return Solved(status="empty", bound=-np.inf, values=nothing, reduced=nothing)
                if number == 0:
                    self._simplex.forget()
                continue
            bound, reduced = self._bound(self._simplex.duals(), self.objective)
            if bound <= cutoff:
                return Solved(status="empty", bound=bound, values=nothing, reduced=reduced)
            if end == "optimal":
                values = np.zeros(len(self.objective))
                values[self.columns] = self._simplex.values()
                return Solved(status="optimal", bound=bound, values=values, reduced=reduced)
        return Solved(status="unclear", bound=np.inf, values=nothing, reduced=nothing)

    def probe(self, column: int, lower: int, upper: int, cutoff: float, iterations: int, left_s: float,
              ) -> tuple[EndOfSimplex, float, float]:
        """Change the bounds of a column and solve a few iterations: how it ended, the objective by then, and a bound.

        Ends as ``cutoff`` and ``infeasible`` are checked; else they become ``iterations``, which proves nothing: its
        bound is ``inf``. The column's bounds are restored, the basis isn't.
        """
        at = self._place[[column]]
        before, self._box = self._box, Box(lower=self._box.lower.copy(), upper=self._box.upper.copy())
        self._box.lower[column], self._box.upper[column] = lower, upper
        self._simplex.set_bounds(at, np.array([float(lower)]), np.array([float(upper)]))
        try:
            end = self._simplex.solve(left_s, cutoff=cutoff - _CUTOFF * max(abs(cutoff), 1.0), iterations=iterations)
            value = self._simplex.objective()
            if end == "infeasible" and not self._is_infeasible():
                end = "iterations"
            if end not in ("cutoff", "optimal"):
                return end, value, np.inf
            bound, _ = self._bound(self._simplex.duals(), self.objective)
            if bound <= cutoff:
                return "cutoff", value, bound
            return ("optimal", value, bound) if end == "optimal" else ("iterations", value, np.inf)
        finally:
            self._box = before
            self._simplex.set_bounds(at, before.lower[[column]].astype(np.float64),
                                     before.upper[[column]].astype(np.float64))

    def _is_infeasible(self) -> bool:
        """Whether the multipliers that HiGHS gives prove that the box holds no point."""
        ray = self._simplex.ray()
        largest = 0.0 if ray is None else float(np.abs(ray).max(initial=0.0))
        if ray is None or largest == 0.0:
            return False
        nothing = np.zeros(len(self.objective))
        return any(self._bound(sign * ray / largest, nothing)[0] < -_PROOF for sign in (1.0, -1.0))

    def _bound(self, duals: FloatArray, objective: FloatArray) -> tuple[float, FloatArray]:
        """The bound on all points of the box that multipliers of the rows prove, whatever they are; reduced costs."""
        rows, count = self.flow.model.rows, len(self.flow.model.rows.lower)
        y, of_cuts = duals[:count], duals[count:]
        y = np.where(((y > 0) & np.isinf(rows.upper)) | ((y < 0) & np.isinf(rows.lower)), 0.0, y)
        over = self._over[:len(self.cuts)]
        of_cuts = np.where(over == ACROSS, np.minimum(of_cuts, 0.0), np.maximum(of_cuts, 0.0))
        reduced: FloatArray = objective - self._transposed @ y
        edges = np.flatnonzero((self._box.upper > 0) & (self.flow.ends[:, 0] >= 0))
        with deferring_ctrl_c():
            subtract_cuts(edges, self.flow.ends, self.flow.vehicle, self.flow.visit, self.flow.leaves, self._of,
                          self._inside, self._poi, over, of_cuts, reduced)
        at = np.where(y > 0, rows.upper, np.where(y < 0, rows.lower, 0.0))
        bound = float((y * at).sum()) + float((np.where(reduced > 0, self._box.upper, self._box.lower) * reduced).sum())
        return bound, reduced

    def warm_start(self) -> WarmStart:
        """The basis of the last solve."""
        return WarmStart(columns=self.columns, cuts=self.cuts, basis=self._simplex.basis())

    def start_from(self, warm: WarmStart) -> None:
        """Start the next solve from a basis; of another program what they share: columns and cuts."""
        count = len(self.flow.model.rows.lower)
        if warm.cuts is self.cuts and len(warm.columns) == len(self.columns):
            raw = warm.basis
            if raw.row_count() < count + len(self.cuts):
                rows = warm.basis.rows()
                raw = Basis.of(warm.basis.columns(), np.concatenate(
                    [rows, np.full(count + len(self.cuts) - len(rows), BASIC)]))
            self._simplex.set_basis(raw)
            return
        columns = np.full(len(self.objective), AT_LOWER)
        columns[warm.columns] = warm.basis.columns()
        rows = warm.basis.rows()
        status = dict(zip(warm.cuts, rows[count:].tolist(), strict=False))
        self._simplex.set_basis(Basis.of(columns[self.columns], np.array(
            [*rows[:count], *(status.get(cut, BASIC) for cut in self.cuts)])))

    def tight_cuts(self) -> list[Cut]:
        """The cuts whose rows are not basic: the optimum is the same without the others."""
        rows = self._simplex.basis().rows()[len(self.flow.model.rows.lower):]
        return [cut for cut, status in zip(self.cuts, rows, strict=True) if status != BASIC]

    def over(self, columns: IntArray, cuts: Sequence[Cut]) -> EdgeProgram:
        """The same program over other columns and cuts; its first solve starts from this one's basis."""
        made = EdgeProgram(self.flow, self.objective, columns, cuts)
        made.solves = self.solves
        made.set_box(self._box)
        made.start_from(self.warm_start())
        return made


def _part(rows: Rows, place: IntArray) -> Rows:
    """The rows over some columns, by their places among these; -1 for the others."""
    used = place[rows.column] >= 0
    return Rows(lower=rows.lower, upper=rows.upper, start=np.concatenate([[0], np.cumsum(used)])[rows.start],
                column=place[rows.column[used]], value=rows.value[used])
