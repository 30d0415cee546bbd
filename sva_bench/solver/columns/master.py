"""The master program of branch-and-price: routes as columns, visits and vehicles as rows.

A vehicle class holds identical vehicles; a vehicle group is those of a class with the same branching decisions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sva_bench.arrays import FloatArray, IntArray
from sva_bench.solver.highs import Relaxation
from sva_bench.solver.program import LinearModel, MipResult, Relaxed, RowBuilder
from sva_bench.solver.risk import Risk

Stops = tuple[int, ...]
"""Sites of a route, from base to base."""


@dataclass(frozen=True, eq=False, kw_only=True)
class VehicleClass:
    """A class of identical vehicles.

    Attributes:
        vehicles: Their numbers.
        weights: Reward of a visit, shape (n,).
        floors: Weight of a visit in each floor, shape (floors, n).
    """

    vehicles: tuple[int, ...]
    weights: FloatArray
    floors: FloatArray


@dataclass(frozen=True, kw_only=True)
class VehicleGroup:
    """Vehicles of a class with the same branching decisions.

    Attributes:
        vehicle_class: The class.
        count: How many vehicles.
        forbidden: POIs that they may not visit.
    """

    vehicle_class: int
    count: int
    forbidden: frozenset[int] = frozenset()


@dataclass(frozen=True, kw_only=True)
class BranchState:
    """The branching decisions that lead to a node of the search tree.

    Attributes:
        groups: The vehicle groups.
        required: POIs that must be visited.
    """

    groups: tuple[VehicleGroup, ...]
    required: frozenset[int] = frozenset()


@dataclass(frozen=True, eq=False, kw_only=True)
class Column:
    """A route of a class.

    Attributes:
        vehicle_class: The class.
        route: Sites from base to base.
        visits: Visits of each site, shape (n,).
        value: Its rewards less its cost.
        floors: What it adds to each floor, shape (floors,).
    """

    vehicle_class: int
    route: Stops
    visits: FloatArray
    value: float
    floors: FloatArray

    def fits(self, group: VehicleGroup) -> bool:
        """Whether a vehicle group may drive it."""
        return group.vehicle_class == self.vehicle_class and not any(self.visits[j] for j in group.forbidden)


@dataclass(frozen=True, eq=False, kw_only=True)
class Duals:
    """Duals of the master program.

    Attributes:
        visit: Of each site's row, shape (n,).
        group: Of each vehicle group's row, shape (groups,).
        floor: Of each floor, not positive, shape (floors,).
        cut: Of each cut, not negative, shape (cuts,).
    """

    visit: FloatArray
    group: FloatArray
    floor: FloatArray
    cut: FloatArray


@dataclass(eq=False, kw_only=True)
class Master:
    """The master program at a node, open for more columns.

    Attributes:
        state: The branching decisions.
        pois: POIs that have a row.
        floors: Right-hand side of each floor.
        sizes: Size of each floor's row, shape (floors,); all the same under a measure of risk.
        cuts: Number of subset-row cuts, each with right-hand side 1.
        counted: Coefficient of each cut for a column, shape (cuts,).
        penalty: Cost of violating a required visit, or a floor by its size.
        risk: The measure of risk whose outcomes the floors are.
        entries: Vehicle group and column of each program column after those of penalties and risk measure.
    """

    state: BranchState
    pois: tuple[int, ...]
    n: int
    floors: FloatArray
    sizes: FloatArray
    cuts: int
    counted: Callable[[Column], FloatArray]
    penalty: float
    risk: Risk | None = None
    entries: list[tuple[int, Column]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._row = {j: k for k, j in enumerate(self.pois)}
        first = len(self.pois) + len(self.state.groups)
        rows = first + len(self.floors)
        # Requirements may be violated at a penalty; under a risk measure the floors have columns of their own instead.
        missed = [self._row[j] for j in sorted(self.state.required)]
        missed += [] if self.risk else list(range(first, rows))
        costs, entries = self.risk.costs() if self.risk else (np.zeros(0), np.zeros((len(self.floors), 0)))
        costs = costs * self.sizes.max(initial=0.0)  # in units of the rows, so that tolerances are relative
        self.penalties, self.others = len(missed), len(missed) + len(costs)
        own = {row: k for k, row in enumerate(missed)}
        build = RowBuilder()
        for row in range(len(self.pois)):
            build.add([own[row]] if row in own else [], [1.0] * (row in own), 1.0 if row in own else -np.inf, 1.0)
        for group in self.state.groups:
            build.add([], [], -np.inf, float(group.count))
        for k, floor in enumerate(self.floors):
            used = np.flatnonzero(entries[k])
            columns, values = self.penalties + used, entries[k][used]
            if not self.risk:
                columns, values = np.array([own[first + k]]), np.ones(1)
            build.add(columns, values, float(floor / self.sizes[k]), np.inf)
        for _ in range(self.cuts):
            build.add([], [], -np.inf, 1.0)
        self._program = Relaxation(LinearModel(
            objective=np.concatenate([np.full(self.penalties, -self.penalty), costs]),
            upper=np.full(self.others, np.inf), integer=np.zeros(self.others, dtype=np.bool_), rows=build.rows()))
        self._present: set[tuple[int, Stops]] = set()
        self._blocks: list[tuple[IntArray, FloatArray, FloatArray]] = []

    def add(self, group: int, columns: Sequence[Column]) -> int:
        """Add columns of a vehicle group; how many are new."""
        new = [c for c in columns if (group, c.route) not in self._present]
        if not new:
            return 0
        groups, floors = len(self.state.groups), len(self.floors)
        visits = np.array([c.visits for c in new])
        counted = np.array([self.counted(c) for c in new]).reshape(len(new), self.cuts)
        levels = np.array([c.floors for c in new]).reshape(len(new), floors)
        values = np.array([c.value for c in new])
        matrix = np.hstack([visits[:, list(self.pois)], np.zeros((len(new), groups)), levels / self.sizes, counted])
        matrix[:, len(self.pois) + group] = 1.0
        column, row = np.nonzero(matrix)
        self._program.add_columns(values, np.searchsorted(column, np.arange(len(new) + 1)), row, matrix[column, row])
        self._present.update((group, c.route) for c in new)
        self.entries += [(group, c) for c in new]
        self._blocks.append((np.full(len(new), group), values, np.hstack([visits, levels, counted])))
        return len(new)

    def most(self, duals: Duals) -> FloatArray:
        """Greatest reduced value of each group's columns, at least 0, without the group's dual, shape (groups,)."""
        found = np.zeros(len(self.state.groups))
        if self._blocks:
            self._blocks = [tuple(np.concatenate(part) for part in zip(*self._blocks, strict=True))]  # type: ignore[list-item]
            group, value, taken = self._blocks[0]
            np.maximum.at(found, group, value - taken @ np.concatenate([duals.visit, duals.floor, duals.cut]))
        return found

    def solve(self, time_limit_s: float) -> Relaxed:
        """The relaxation over the columns so far."""
        return self._program.solve(time_limit_s)

    def duals(self, solved: Relaxed) -> Duals:
        """The duals of a solved relaxation."""
        visit = np.zeros(self.n)
        visit[list(self.pois)] = solved.duals[:len(self.pois)]
        group, floor, cut = np.split(solved.duals[len(self.pois):],
                                    np.cumsum([len(self.state.groups), len(self.floors)]))
        return Duals(visit=visit, group=group, floor=floor / self.sizes, cut=np.maximum(cut, 0.0))

    def bound(self, duals: Duals, best: FloatArray) -> float:
        """Lagrangian bound: an upper bound on the program over all columns, from any duals of the right signs.

        Args:
            duals: The duals.
            best: Upper bound on the reduced value of each group's routes, shape (groups,).
        """
        counts = np.array([u.count for u in self.state.groups], dtype=np.float64)
        return float(duals.visit.sum() + duals.floor @ self.floors + duals.cut.sum()
                     + counts @ np.maximum(best, 0.0))

    def solve_integer(self, time_limit_s: float) -> MipResult:
        """The best integer choice of columns; the relaxation can't be solved again after it."""
        return self._program.solve_integer(np.arange(self.others, self.others + len(self.entries)), time_limit_s)

    def share(self, values: FloatArray) -> list[tuple[int, Column, float]]:
        """The columns of positive value at a point: vehicle group, column and value."""
        used = values[self.others:]
        return [(*self.entries[k], float(used[k])) for k in np.flatnonzero(used > 1e-7)]

    def violation(self, values: FloatArray) -> float:
        """Total violation of the requirements at a point, in units of their rows."""
        return float(values[:self.penalties].sum())


def without(group: VehicleGroup, poi: int) -> VehicleGroup:
    """The group, no longer allowed to visit a POI."""
    return replace(group, forbidden=group.forbidden | {poi})
