"""Columns for the master program, as they are needed: duals from the program, routes from labels, and the same again.

Source:
    Roberti, Mingozzi (2014), "Dynamic ng-path relaxation for the delivery man problem"; Pessoa et al. (2018),
    "Automation and combination of linear-programming based stabilization techniques in column generation".
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
from sva_bench.solver.columns.master import BranchState, Column, Duals, Master, Unit, VehicleClass
from sva_bench.solver.columns.pricing import Priced
from sva_bench.solver.columns.pricing import price as best_routes
from sva_bench.solver.columns.subset_row import Counter, SubsetRow, cut_duals_of, separate
from sva_bench.solver.goal import Goal, sizes_of
from sva_bench.solver.highs import Relaxed
from sva_bench.solver.preprocess import Scope

_log = logging.getLogger(__name__)

ROUTES_A_ROUND = 40  # columns of one unit and pricing
MOST_LABELS = 4_000_000
_SMOOTHING = 0.5  # share of the best duals so far
_EPSILON = 1e-7
ENUMERATED = 0.03  # gap from which routes may be few enough to list them all
RETRIED = 0.7  # of the last gap that left too many
MOST_ENUMERATED = 6000
_POOL = 4000  # columns that a new node begins with at most


@dataclass(frozen=True, eq=False, kw_only=True)
class Generated:
    """What column generation came to.

    Attributes:
        relaxed: The last relaxation.
        bound: Upper bound on the node.
        duals: The duals that give it, if any were tried.
        most: With them the greatest reduced value of each unit's routes, shape (units,).
        complete: Whether no column is missing that counts.
    """

    relaxed: Relaxed
    bound: float
    duals: Duals | None
    most: FloatArray
    complete: bool


@dataclass(eq=False, kw_only=True)
class ColumnGeneration:
    """Routes found so far, and what is known to find more.

    Attributes:
        instance: The instance.
        goal: What to maximise.
        scopes: What each vehicle may do.
        survival: Chance of each vehicle to get to its next POI, shape (M,).
        cutoff: Bound at or below which a node holds no better plan.
        out: Whether to stop.
        left_s: Time left [s].
        classes: The vehicle classes.
        graphs: What each class may drive.
        penalty: What it costs to miss a required visit, or a floor by its size, unless a node wants more.
        calls: Pricing runs and labels.
        rows: POIs that can be visited.
        memory: POIs that each site remembers (ng-sets), bit by bit, for each class, shape (n, words).
        pool: The routes, by class and sites.
        cuts: Subset-row cuts.
    """

    instance: Instance
    goal: Goal
    scopes: Sequence[Scope]
    survival: FloatArray
    cutoff: Callable[[], float]
    out: Callable[[], bool]
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
            graph = graph_of(self.instance, self.scopes[m], float(self.survival[m]))
            own = VehicleClass(vehicles=(m,), weights=self.goal.weights[m], floors=floors[:, m])
            same = [k for k, other in enumerate(self.classes) if _identical(other, own, self.graphs[k], graph)]
            if same:
                known = self.classes[same[0]]
                self.classes[same[0]] = replace(known, vehicles=(*known.vehicles, m))
            else:
                self.classes.append(own)
                self.graphs.append(graph)
        # Without the triangle inequality a stop without reward can be of use; the legs tell.
        self.rows = tuple(j for j in self._pois if any(graph.legs[j].any() for graph in self.graphs))
        self.memory = [neighbours(graph, self._pois) for graph in self.graphs]
        self.pool: dict[tuple[int, tuple[int, ...]], Column] = {}
        self._single = [k for k, c in enumerate(self.classes) if len(c.vehicles) == 1]
        self._too_many = math.inf
        self.cuts: tuple[SubsetRow, ...] = ()
        self._counter = Counter((), n)
        self._counts: dict[tuple[int, tuple[int, ...]], FloatArray] = {}
        rates = self.goal.rates()
        self._most = float(rates.max(initial=0.0))
        longest = sum(graph.limit_s for graph in self.graphs)
        self.penalty = 10.0 * (float(rates.max(axis=0, initial=0.0).sum()) + self.goal.driving * longest) or 1.0
        self._sizes = sizes_of(self.goal.floors)
        if self.goal.risk is not None:  # columns of its own stand in all rows
            self._sizes[:] = self._sizes.max(initial=0.0)

    @property
    def priced(self) -> int:
        """Pricing runs."""
        return self.calls["heuristic"] + self.calls["exact"]

    def add_route(self, vehicle: int, route: tuple[int, ...]) -> None:
        """Offer a route of a vehicle as a column."""
        if len(route) > 2:
            kind = next(k for k, c in enumerate(self.classes) if vehicle in c.vehicles)
            self._column(kind, route)

    def master(
        self, state: BranchState, duals: Duals | None, entries: Sequence[Sequence[Column]] | None = None,
        penalty: float | None = None,
    ) -> Master:
        """The program at a node, with columns that are good at given duals, or with given columns of each unit."""
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
        for number, unit in enumerate(state.units):
            master.add(number, [c for c in columns if c.fits(unit)])
        return master

    def generate(
        self, master: Master, state: BranchState, centre: Duals | None, *, known: float, slack: float,
        tell: Callable[[float], None] | None = None,
    ) -> Generated:
        """Add columns until the relaxation is as good as solved.

        Args:
            master: The program.
            state: Its decisions.
            centre: Duals to begin near.
            known: Upper bound on the node.
            slack: Share of the gap within which the relaxation may stay of its bound.
            tell: Takes every bound.
        """
        best, limits = math.inf, np.zeros(len(state.units))
        centre = None if centre is None else self._padded(centre)
        smooth = _SMOOTHING if centre is not None and slack > 0 else 0.0
        quick = True
        while True:
            solved = master.solve(math.inf)
            if solved.values is None:
                raise RuntimeError(f"the master program is {solved.status}")
            if self.out():
                return Generated(relaxed=solved, bound=best, duals=centre, most=limits, complete=False)
            duals = master.duals(solved)
            if quick:
                added = sum(self.add(master, number, unit, self.price(
                    unit, duals, max(float(duals.unit[number]), 0.0) + self.tolerance, exact=False))
                    for number, unit in enumerate(state.units))
                if added:
                    continue
            at = duals if centre is None or smooth == 0.0 else duals.between(centre, smooth)
            most, added, complete = self._price_exactly(master, state, at, duals, min(best, known) - solved.objective)
            if not complete:
                return Generated(relaxed=solved, bound=best, duals=centre, most=limits, complete=False)
            bound = master.bound(at, most)
            if bound < best or centre is None:
                best, centre, limits = min(bound, best), at, most
                if tell:
                    tell(max(best, self.cutoff()))
            room = slack * (best - self.cutoff()) + 1e-9 * max(self._most, abs(best))
            if min(best, known) <= self.cutoff() or best <= solved.objective + room:
                return Generated(relaxed=solved, bound=best, duals=centre, most=limits, complete=True)
            if not added:
                if at is duals:
                    return Generated(relaxed=solved, bound=best, duals=centre, most=limits, complete=True)
                smooth = smooth / 2 if smooth > 0.1 else 0.0
                quick = False
            else:
                smooth, quick = _SMOOTHING, True

    def _price_exactly(
        self, master: Master, state: BranchState, at: Duals, duals: Duals, width: float,
    ) -> tuple[FloatArray, int, bool]:
        """Add the columns that exact pricing finds.

        Args:
            master: The program.
            state: Its decisions.
            at: Duals to price at.
            duals: The program's own, at which columns must improve it.
            width: How far below the best routes are looked for: they can be of use at the program's own duals.

        Returns:
            Greatest reduced value of each unit's routes, shape (units,); number of columns added; whether it is proved.
        """
        most, added, complete = master.most(at), 0, True
        for number, unit in enumerate(state.units):
            threshold = max(most[number] - (width if math.isfinite(width) else 0.0), 0.0)
            priced = self.price(unit, at, threshold + self.tolerance, exact=True)
            complete &= priced.complete
            most[number] = max(priced.best, most[number])
            routes = [self._column(unit.kind, route) for route in priced.routes]
            added += master.add(number, [c for c in routes if self._reduced(c, duals)
                                         > max(duals.unit[number], 0.0) + self.tolerance])
        return most, added, complete

    def _reward(self, unit: Unit, duals: Duals) -> FloatArray:
        """Reward of each site for a unit, shape (n,); ``-inf`` = not to be visited."""
        own = self.classes[unit.kind]
        reward = own.weights - duals.floor @ own.floors if len(self._floors) else own.weights.copy()
        reward = np.array(reward, dtype=np.float64)
        if unit.forbidden:
            reward[list(unit.forbidden)] = -np.inf
        return reward

    def price(self, unit: Unit, duals: Duals, threshold: float, *, exact: bool) -> Priced:
        """Routes of a unit worth more than a threshold."""
        graph, reward = self.graphs[unit.kind], self._reward(unit, duals)
        self.calls["exact" if exact else "heuristic"] += 1
        cut_duals = cut_duals_of(self.cuts, duals.cut, unit.kind, self._n)
        with deferring_ctrl_c():
            priced = best_routes(
                graph, reward, duals.visit, self.goal.driving, self.memory[unit.kind], threshold=threshold,
                exact=exact, most_routes=ROUTES_A_ROUND, most_labels=MOST_LABELS, cut_duals=cut_duals,
                left_s=self.left_s())
        self.calls["labels"] += priced.labels
        return priced

    def enumerate(self, state: BranchState, made: Generated) -> list[list[Column]] | None:
        """All columns of each unit that a plan above the cutoff can use; ``None`` if too many are possible."""
        room = made.bound - self.cutoff()
        if made.duals is None or room > min(ENUMERATED * abs(self.cutoff()), RETRIED * self._too_many) \
                or not bool((self.survival == 1.0).all()):
            return None
        found: list[tuple[tuple[int, ...], ...]] = []
        for number, unit in enumerate(state.units):
            with deferring_ctrl_c():
                routes = routes_above(
                    self.graphs[unit.kind], self._reward(unit, made.duals), made.duals.visit, self.goal.driving,
                    cut_duals_of(self.cuts, made.duals.cut, unit.kind, self._n),
                    best=float(made.most[number]), loss=room + self.tolerance, left_s=self.left_s())
            _log.debug("unit %d: %s routes within %.6g", number, routes and len(routes), room)
            if routes is None or len(routes) + sum(map(len, found)) > MOST_ENUMERATED:
                self._too_many = room
                return None
            found.append(routes)
        return [[self._column(unit.kind, route) for route in routes]
                for unit, routes in zip(state.units, found, strict=True)]

    def add(self, master: Master, number: int, unit: Unit, priced: Priced) -> int:
        return master.add(number, [self._column(unit.kind, route) for route in priced.routes])

    def _column(self, kind: int, route: tuple[int, ...]) -> Column:
        key = (kind, route)
        if key not in self.pool:
            own, graph = self.classes[kind], self.graphs[kind]
            visits, value, chance = np.zeros(self._n), 0.0, 1.0
            floors = np.zeros(len(self._floors))
            for i, j in itertools.pairwise(route):
                value -= self.goal.driving * graph.time_s[i, j]
                if graph.bit[j] >= 0:
                    chance *= graph.survival
                    value += chance * own.weights[j]
                    visits[j] += 1
                    floors += own.floors[:, j]
            self.pool[key] = Column(kind=kind, route=route, visits=visits, value=float(value), floors=floors)
        return self.pool[key]

    def _reduced(self, column: Column, duals: Duals) -> float:
        """Reduced value of a route: its value less the duals of its visits."""
        return column.value - float(duals.visit @ column.visits) - float(duals.floor @ column.floors) \
            - (float(duals.cut @ self._counted(column)) if self.cuts else 0.0)

    def _counted(self, column: Column) -> FloatArray:
        """How often each cut counts a route, shape (cuts,)."""
        key = (column.kind, column.route)
        if key not in self._counts:
            with deferring_ctrl_c():
                self._counts[key] = self._counter.of(*key)
        return self._counts[key]

    def cut(self, used: Sequence[tuple[int, Column, float]]) -> bool:
        """Add or widen the cuts that a solution violates; whether there are any."""
        cuts = separate(used, self.cuts, self._single, self.rows)
        changed = cuts != self.cuts
        if changed:
            self.cuts, self._counts, self._counter = cuts, {}, Counter(cuts, self._n)
        return changed

    def _padded(self, duals: Duals) -> Duals:
        """Duals from before the latest cuts."""
        return replace(duals, cut=np.pad(duals.cut, (0, len(self.cuts) - len(duals.cut))))

    @property
    def tolerance(self) -> float:
        """By how much a route's reduced value must exceed its unit's dual to count as new."""
        return _EPSILON * (self._most or 1.0)  # else seconds are all that counts

    def remember(self, used: Sequence[Column], *, ignore_most: bool) -> bool:
        """Make sites remember the POIs that routes in use visit again, and drop routes that forget; whether any did."""
        changed = False
        for column in used:
            graph, memory = self.graphs[column.kind], self.memory[column.kind]
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
                         if c.visits.max() <= 1 or allowed(c.route, self.graphs[c.kind], self.memory[c.kind])}
        return changed



def _identical(one: VehicleClass, other: VehicleClass, graph: Graph, other_graph: Graph) -> bool:
    return np.array_equal(one.weights, other.weights) and np.array_equal(one.floors, other.floors) \
        and (graph.capacity_s, graph.limit_s, graph.survival) == \
        (other_graph.capacity_s, other_graph.limit_s, other_graph.survival) \
        and np.array_equal(graph.legs, other_graph.legs) and np.array_equal(graph.time_s, other_graph.time_s) \
        and np.array_equal(graph.fuel_s, other_graph.fuel_s)
