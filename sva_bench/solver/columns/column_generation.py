"""Column generation: duals from the master program, routes from pricing, until no route has positive reduced value.

Source:
    Roberti, Mingozzi (2014), "Dynamic ng-path relaxation for the delivery man problem".
"""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.mission.instance import Instance
from sva_bench.solver.columns.enumeration import routes_above
from sva_bench.solver.columns.graph import NG_MOST, Graph, allowed, graph_of, neighbours
from sva_bench.solver.columns.master import BranchState, Column, Duals, Master, VehicleClass, VehicleGroup
from sva_bench.solver.columns.pricing import Priced
from sva_bench.solver.columns.pricing import price as best_routes
from sva_bench.solver.columns.subset_row import Counter, SubsetRow, cut_duals_of, separate
from sva_bench.solver.goal import Goal, sizes_of
from sva_bench.solver.preprocess import Scope
from sva_bench.solver.program import Relaxed

_log = logging.getLogger(__name__)

ROUTES_A_ROUND = 40  # columns of one vehicle group and pricing run
MOST_LABELS = 4_000_000
LEVELS = (3, 7)  # POIs of each site's ng-set that dominance compares, after none and before all
DEAR = 50_000  # labels of an exact run from which the levels before it pay
_EPSILON = 1e-7
ENUMERATED = 0.03  # relative gap below which routes may be few enough to enumerate
RETRIED = 0.7  # share of the gap that last left too many, below which enumeration is tried again
MOST_ENUMERATED = 6000
_POOL = 4000  # most columns that a node's master program begins with


@dataclass(frozen=True, eq=False, kw_only=True)
class Generated:
    """The result of column generation at a node.

    Attributes:
        relaxed: The last relaxation.
        bound: Upper bound on the node.
        duals: The duals that give the bound; ``None`` if none were priced exactly.
        most: Greatest reduced value of each vehicle group's routes at these duals, shape (groups,).
        complete: Whether the bound is proved: neither time nor labels ran out.
        exact: Whether the last pricing run was an exact one.
    """

    relaxed: Relaxed
    bound: float
    duals: Duals | None
    most: FloatArray
    complete: bool
    exact: bool = True


@dataclass(eq=False, kw_only=True)
class ColumnGeneration:
    """The pool of columns, and all that pricing needs to generate more.

    Attributes:
        instance: The instance.
        goal: What to maximise.
        scopes: Legs and bounds of each vehicle.
        cutoff: Bound at or below which a node holds no better plan.
        is_over: Whether time is up.
        left_s: Time left [s].
        classes: The vehicle classes.
        graphs: The pricing graph of each class.
        penalty: Cost of violating a required visit, or a floor by its size; nodes may raise it.
        calls: Number of heuristic and exact pricing runs, and of labels.
        rows: POIs that can be visited.
        memory: ng-sets of each class: the POIs that each site remembers, as bits, shape (n, words).
        pool: The routes, by class and sites.
        cuts: Subset-row cuts.
    """

    instance: Instance
    goal: Goal
    scopes: Sequence[Scope]
    cutoff: Callable[[], float]
    is_over: Callable[[], bool]
    left_s: Callable[[], float]
    classes: list[VehicleClass] = field(init=False, default_factory=list)
    graphs: list[Graph] = field(init=False, default_factory=list)
    penalty: float = field(init=False)
    calls: dict[str, int] = field(default_factory=lambda: {"heuristic": 0, "exact": 0, "labels": 0})

    def __post_init__(self) -> None:
        n = len(self.instance.sites)
        self._n, self._pois = n, self.instance.pois
        self._floors = np.array([floor for _, floor in self.goal.floors])
        floors = np.array([weights for weights, _ in self.goal.floors]).reshape(
            len(self._floors), len(self.instance.vehicles), n)
        for m in range(len(self.instance.vehicles)):
            graph = graph_of(self.instance, self.scopes[m], self.goal.discount(m))
            own = VehicleClass(vehicles=(m,), weights=self.goal.weights[m], floors=floors[:, m])
            same = [k for k, other in enumerate(self.classes) if _identical(other, own, self.graphs[k], graph)]
            if same:
                known = self.classes[same[0]]
                self.classes[same[0]] = replace(known, vehicles=(*known.vehicles, m))
            else:
                self.classes.append(own)
                self.graphs.append(graph)
        # Without the triangle inequality a stop without reward can shorten a route; the legs of the scopes allow it.
        self.rows = tuple(j for j in self._pois if any(graph.legs[j].any() for graph in self.graphs))
        self.memory = [neighbours(graph, self._pois) for graph in self.graphs]
        self.pool: dict[tuple[int, tuple[int, ...]], Column] = {}
        self._single_vehicle = [k for k, c in enumerate(self.classes) if len(c.vehicles) == 1]
        self._too_many = math.inf
        self._exact_labels = 0  # of the dearest exact run; the first, an early one, gives those who stop soon a bound
        self.cuts: tuple[SubsetRow, ...] = ()
        self._counter = Counter((), n)
        self._counts: dict[tuple[int, tuple[int, ...]], FloatArray] = {}
        rates = self.goal.rates()
        self._most = float(rates.max(initial=0.0))
        longest = sum(graph.limit_s for graph in self.graphs)
        self.penalty = 10.0 * (float(rates.max(axis=0, initial=0.0).sum()) + self.goal.driving * longest) or 1.0
        self._sizes = sizes_of(self.goal.floors)
        if self.goal.risk is not None:  # its columns have entries in several floors' rows: one scale for all
            self._sizes[:] = self._sizes.max(initial=0.0)

    @property
    def is_plain(self) -> bool:
        """Whether no vehicle's rewards depend on the way to them."""
        return all(graph.is_plain for graph in self.graphs)

    @property
    def priced(self) -> int:
        """Pricing runs."""
        return self.calls["heuristic"] + self.calls["exact"]

    def add_route(self, vehicle: int, route: tuple[int, ...]) -> None:
        """Add a route of a vehicle to the pool."""
        if len(route) > 2:
            vehicle_class = next(k for k, c in enumerate(self.classes) if vehicle in c.vehicles)
            self._column(vehicle_class, route)

    def master(
        self, state: BranchState, duals: Duals | None, entries: Sequence[Sequence[Column]] | None = None,
        penalty: float | None = None,
    ) -> Master:
        """The master program of a node.

        Args:
            state: The branching decisions.
            duals: Duals by whose reduced values the pool's best columns are chosen; ``None`` = all columns.
            entries: Columns of each vehicle group, in place of the pool's.
            penalty: Cost of violating a requirement; ``None`` = that of ``self``.
        """
        master = Master(state=state, pois=self.rows, n=self._n, floors=self._floors, sizes=self._sizes,
                        cuts=len(self.cuts), counted=self._counted, penalty=penalty or self.penalty,
                        risk=self.goal.risk)
        if entries is not None:
            for number, columns in enumerate(entries):
                master.add(number, columns)
            return master
        columns = list(self.pool.values())
        if len(columns) > _POOL and duals is not None:
            gain = np.array([self._reduced(c, self._padded(duals)) for c in columns])
            columns = [columns[k] for k in np.sort(np.argsort(-gain, kind="stable")[:_POOL])]
        for number, group in enumerate(state.groups):
            master.add(number, [c for c in columns if c.fits(group)])
        return master

    def generate(
        self, master: Master, state: BranchState, centre: Duals | None, *, known: float, slack: float, proving: bool,
        report_bound: Callable[[float], None] | None = None,
    ) -> Generated:
        """Add columns until quick pricing finds no more, or until the relaxation is within ``slack`` of its bound.

        Args:
            master: The program.
            state: Its branching decisions.
            centre: Duals of the best bound so far; ``None`` = none.
            known: Upper bound on the node.
            slack: Distance from relaxation to bound at which it counts as solved, as a share of the gap.
            proving: Whether to price exactly in the end, which proves the bound.
            report_bound: Takes every improved bound.
        """
        best, limits = math.inf, np.zeros(len(state.groups))
        centre = None if centre is None else self._padded(centre)
        while True:
            solved = master.solve(math.inf)
            if solved.values is None:
                raise RuntimeError(f"the master program is {solved.status}")
            if self.is_over():
                return Generated(relaxed=solved, bound=best, duals=centre, most=limits, complete=False)
            duals = master.duals(solved)
            if self.price_all(master, state, duals, 0):
                continue
            if self._exact_labels > DEAR:
                levels = LEVELS if proving else LEVELS[:1]
                if any(self.price_all(master, state, duals, compared) for compared in levels):
                    continue
                if not proving:
                    return Generated(relaxed=solved, bound=known, duals=centre, most=limits, complete=True,
                                     exact=False)
            priced = self._price_exactly(master, state, duals)
            if priced is None:
                return Generated(relaxed=solved, bound=best, duals=centre, most=limits, complete=False)
            most, added = priced
            bound = master.bound(duals, most)
            if bound < best or centre is None:
                best, centre, limits = min(bound, best), duals, most
                if report_bound:
                    report_bound(max(best, self.cutoff()))
            room = slack * (best - self.cutoff()) + 1e-9 * max(self._most, abs(best))
            if min(best, known) <= self.cutoff() or best <= solved.objective + room or not added:
                return Generated(relaxed=solved, bound=best, duals=centre, most=limits, complete=True)

    def price_all(self, master: Master, state: BranchState, duals: Duals, compared: int) -> int:
        """Add the columns of all groups that a quick pricing run finds; how many are new."""
        return sum(self.add(master, number, group, self.price(group, duals, self._threshold(duals, number), compared))
                   for number, group in enumerate(state.groups))

    def _threshold(self, duals: Duals, number: int) -> float:
        """Reduced value above which a route of a group enters the program."""
        return max(float(duals.group[number]), 0.0) + self.tolerance

    def _price_exactly(self, master: Master, state: BranchState, duals: Duals) -> tuple[FloatArray, int] | None:
        """Add the columns that exact pricing finds.

        Returns:
            Greatest reduced value of each group's routes, shape (groups,), and columns added; ``None`` without a proof.
        """
        most, added = master.most(duals), 0
        for number, group in enumerate(state.groups):
            priced = self.price(group, duals, self._threshold(duals, number), None)
            self._exact_labels = max(self._exact_labels, priced.labels)
            if not priced.complete:
                return None
            most[number] = max(priced.best, most[number])
            added += self.add(master, number, group, priced)
        return most, added

    def _reward(self, group: VehicleGroup, duals: Duals) -> FloatArray:
        """Reward of each site for a vehicle group, floors' duals included, shape (n,); ``-inf`` = forbidden."""
        own = self.classes[group.vehicle_class]
        reward = own.weights - duals.floor @ own.floors if len(self._floors) else own.weights.copy()
        reward = np.array(reward, dtype=np.float64)
        if group.forbidden:
            reward[list(group.forbidden)] = -np.inf
        return reward

    def price(self, group: VehicleGroup, duals: Duals, threshold: float, compared: int | None) -> Priced:
        """Routes of a vehicle group of reduced value above a threshold; ``compared`` as in ``pricing.price``."""
        graph, reward = self.graphs[group.vehicle_class], self._reward(group, duals)
        self.calls["exact" if compared is None else "heuristic"] += 1
        cut_duals = cut_duals_of(self.cuts, duals.cut, group.vehicle_class, self._n)
        with deferring_ctrl_c():
            priced = best_routes(
                graph, reward, duals.visit, self.goal.driving, self.memory[group.vehicle_class], threshold=threshold,
                compared=compared, most_routes=ROUTES_A_ROUND, most_labels=MOST_LABELS, cut_duals=cut_duals,
                left_s=self.left_s())
        self.calls["labels"] += priced.labels
        return priced

    def enumerate(self, state: BranchState, made: Generated) -> list[list[Column]] | None:
        """All columns of each vehicle group that a plan above the cutoff can use; ``None`` if they are too many."""
        room = made.bound - self.cutoff()
        if made.duals is None or room > min(ENUMERATED * abs(self.cutoff()), RETRIED * self._too_many) \
                or not self.is_plain:
            return None
        found: list[tuple[tuple[int, ...], ...]] = []
        for number, group in enumerate(state.groups):
            with deferring_ctrl_c():
                routes = routes_above(
                    self.graphs[group.vehicle_class], self._reward(group, made.duals), made.duals.visit,
                    self.goal.driving,
                    cut_duals_of(self.cuts, made.duals.cut, group.vehicle_class, self._n),
                    best=float(made.most[number]), loss=room + self.tolerance, left_s=self.left_s())
            _log.debug("group %d: %s routes within %.6g", number, routes and len(routes), room)
            if routes is None or len(routes) + sum(map(len, found)) > MOST_ENUMERATED:
                self._too_many = room
                return None
            found.append(routes)
        return [[self._column(group.vehicle_class, route) for route in routes]
                for group, routes in zip(state.groups, found, strict=True)]

    def add(self, master: Master, number: int, group: VehicleGroup, priced: Priced) -> int:
        """Add priced routes to the columns of a vehicle group; how many are new."""
        return master.add(number, [self._column(group.vehicle_class, route) for route in priced.routes])

    def _column(self, vehicle_class: int, route: tuple[int, ...]) -> Column:
        """The column of a class's route, made once."""
        key = (vehicle_class, route)
        if key not in self.pool:
            own, graph = self.classes[vehicle_class], self.graphs[vehicle_class]
            visits, value, chance, burnt = np.zeros(self._n), 0.0, 1.0, 0.0
            floors = np.zeros(len(self._floors))
            for i, j in itertools.pairwise(route):
                value -= self.goal.driving * graph.time_s[i, j]
                burnt += graph.fuel_s[i, j]
                if graph.bit[j] < 0:
                    value -= self.goal.driving * graph.charging[j] * burnt
                    burnt = 0.0
                chance *= graph.survival[i, j]
                if graph.bit[j] >= 0:
                    value += chance * own.weights[j]
                    visits[j] += 1
                    floors += own.floors[:, j]
            if not graph.is_plain:
                value += graph.discount.home * chance - graph.discount.departure
            self.pool[key] = Column(vehicle_class=vehicle_class, route=route, visits=visits, value=float(value),
                                    floors=floors)
        return self.pool[key]

    def _reduced(self, column: Column, duals: Duals) -> float:
        """Reduced value of a column: its value less the duals of its visits, floors and cuts."""
        return column.value - float(duals.visit @ column.visits) - float(duals.floor @ column.floors) \
            - (float(duals.cut @ self._counted(column)) if self.cuts else 0.0)

    def _counted(self, column: Column) -> FloatArray:
        """Coefficient of each cut for a column, shape (cuts,)."""
        key = (column.vehicle_class, column.route)
        if key not in self._counts:
            with deferring_ctrl_c():
                self._counts[key] = self._counter.of(*key)
        return self._counts[key]

    def cut(self, used: Sequence[tuple[int, Column, float]]) -> bool:
        """Separate subset-row cuts at a solution, and widen the memory of present ones; whether any changed."""
        cuts = separate(used, self.cuts, self._single_vehicle, self.rows)
        changed = cuts != self.cuts
        if changed:
            self.cuts, self._counts, self._counter = cuts, {}, Counter(cuts, self._n)
        return changed

    def _padded(self, duals: Duals) -> Duals:
        """Duals from before the latest cuts, with duals 0 for those."""
        return replace(duals, cut=np.pad(duals.cut, (0, len(self.cuts) - len(duals.cut))))

    @property
    def tolerance(self) -> float:
        """By how much a route's reduced value must exceed its group's dual to enter the program."""
        return _EPSILON * (self._most or 1.0)  # without rewards, values are seconds of driving

    def remember(self, used: Sequence[Column], *, ignore_most: bool) -> bool:
        """Extend ng-sets by the cycles of columns in use, and drop columns they no longer allow; whether any changed.

        Args:
            used: Columns of a solution.
            ignore_most: Whether ng-sets may exceed ``NG_MOST``.
        """
        changed = False
        for column in used:
            graph, memory = self.graphs[column.vehicle_class], self.memory[column.vehicle_class]
            last: dict[int, int] = {}
            for position, j in enumerate(column.route):
                if graph.bit[j] < 0:
                    continue
                if j in last:
                    for i in column.route[last[j] + 1:position]:
                        most = NG_MOST if graph.bit[i] >= 0 else 2 * NG_MOST
                        word, bit = graph.bit[j] >> 6, np.uint64(1) << np.uint64(graph.bit[j] & 63)
                        if memory[i, word] & bit:
                            continue
                        if ignore_most or sum(int(w).bit_count() for w in memory[i]) < most:
                            memory[i, word] |= bit
                            changed = True
                last[j] = position
        if changed:
            self.pool = {key: c for key, c in self.pool.items()
                         if c.visits.max() <= 1
                         or allowed(c.route, self.graphs[c.vehicle_class], self.memory[c.vehicle_class])}
        return changed


def _identical(one: VehicleClass, other: VehicleClass, graph: Graph, other_graph: Graph) -> bool:
    return np.array_equal(one.weights, other.weights) and np.array_equal(one.floors, other.floors) \
        and (graph.capacity_s, graph.limit_s, graph.discount) == \
        (other_graph.capacity_s, other_graph.limit_s, other_graph.discount) \
        and np.array_equal(graph.legs, other_graph.legs) and np.array_equal(graph.time_s, other_graph.time_s) \
        and np.array_equal(graph.fuel_s, other_graph.fuel_s) \
        and np.array_equal(graph.survival[graph.legs], other_graph.survival[graph.legs])
