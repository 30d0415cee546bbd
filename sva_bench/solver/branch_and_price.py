"""Branch-and-price: the best plan as a choice of routes, which labels find as they are needed.

Source:
    Boussier, Feillet, Gendreau (2007), "An exact algorithm for team orienteering problems"; Roberti, Mingozzi (2014),
    "Dynamic ng-path relaxation for the delivery man problem"; Pessoa et al. (2018) on smoothing of duals.
"""

from __future__ import annotations

import heapq
import itertools
import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.columns import Class, Column, Master, Prices, Side, Unit, without
from sva_bench.solver.formulation import Goal
from sva_bench.solver.graph import NG_MOST, Graph, allowed, graph_of, neighbours
from sva_bench.solver.highs import Relaxed
from sva_bench.solver.preprocess import Scope
from sva_bench.solver.pricing import Priced, price

_log = logging.getLogger(__name__)

ROUTES_A_ROUND = 40  # columns of one unit and pricing
MOST_LABELS = 4_000_000
_SLACK = 0.03  # of the gap: a relaxation this close to its bound counts as solved
_SMOOTHING = 0.5  # share of the best prices so far
_STRONG = 8  # candidates for branching that are looked at closely
_EPSILON = 1e-7
_POOL = 4000  # columns that a new node begins with at most


@dataclass(frozen=True, eq=False, kw_only=True)
class _Node:
    side: Side
    bound: float
    prices: Prices | None


@dataclass(eq=False, kw_only=True)
class BranchAndPrice:
    """A search for the best plan.

    Attributes:
        instance: The instance.
        goal: What to maximise.
        scopes: What each vehicle may do.
        survival: Chance of each vehicle to get to its next POI, shape (M,).
        offer: Takes a plan, as POIs of each vehicle in order, and keeps it if it is better.
        cutoff: Bound at or below which a node holds nothing of interest.
        out: Whether to stop.
        tell: Takes every upper bound on the goal.
    """

    instance: Instance
    goal: Goal
    scopes: Sequence[Scope]
    survival: FloatArray
    offer: Callable[[tuple[tuple[int, ...], ...]], None]
    cutoff: Callable[[], float]
    out: Callable[[], bool]
    tell: Callable[[float], None]
    nodes: int = 0
    calls: dict[str, int] = field(default_factory=lambda: {"heuristic": 0, "exact": 0, "labels": 0})

    def __post_init__(self) -> None:
        n = len(self.instance.sites)
        self._n, self._pois = n, self.instance.pois
        self._floors = np.array([floor for _, floor in self.goal.floors])
        floors = np.array([weights for weights, _ in self.goal.floors]).reshape(
            len(self._floors), len(self.instance.vehicles), n)
        self.classes: list[Class] = []
        self.graphs: list[Graph] = []
        for m in range(len(self.instance.vehicles)):
            graph = graph_of(self.instance, self.scopes[m], float(self.survival[m]))
            own = Class(vehicles=(m,), weights=self.goal.weights[m], floors=floors[:, m])
            same = [k for k, other in enumerate(self.classes) if _alike(other, own, self.graphs[k], graph)]
            if same:
                known = self.classes[same[0]]
                self.classes[same[0]] = replace(known, vehicles=(*known.vehicles, m))
            else:
                self.classes.append(own)
                self.graphs.append(graph)
        # A stop that counts for nothing can be of use without the triangle inequality; the legs know.
        self._rows = tuple(j for j in self._pois if any(graph.legs[j].any() for graph in self.graphs))
        self.memory = [neighbours(graph, self._pois) for graph in self.graphs]
        self.pool: dict[tuple[int, tuple[int, ...]], Column] = {}
        total = float(np.abs(self.goal.weights).max(axis=0, initial=0.0).sum())
        longest = sum(graph.limit_s for graph in self.graphs)
        self._penalty = 10.0 * (total + self.goal.driving * longest + 1.0)

    @property
    def priced(self) -> int:
        """Pricing runs."""
        return self.calls["heuristic"] + self.calls["exact"]

    def add_route(self, vehicle: int, route: tuple[int, ...]) -> None:
        """Offer a route of a vehicle as a column."""
        if len(route) > 2:
            kind = next(k for k, c in enumerate(self.classes) if vehicle in c.vehicles)
            self._column(kind, route)

    def run(self) -> bool:
        """Search until nothing above the cutoff is left; ``False`` if time is up or labels overflow before."""
        root = Side(units=tuple(Unit(kind=k, count=len(c.vehicles)) for k, c in enumerate(self.classes)))
        ticket = itertools.count()
        waiting = [(-math.inf, next(ticket), _Node(side=root, bound=math.inf, prices=None))]
        while waiting and -waiting[0][0] > self.cutoff():
            node = heapq.heappop(waiting)[2]
            if self.out():
                return False
            self.nodes += 1
            children, bound = self._process(node)
            left = max((-entry[0] for entry in waiting), default=-math.inf)
            self.tell(max(left, bound, self.cutoff()))
            if children is None:
                return False
            for child in children:
                heapq.heappush(waiting, (-child.bound, next(ticket), child))
            _log.debug("node %d: bound %.6g, %d waiting, %d columns, %s", self.nodes, bound, len(waiting),
                       len(self.pool), self.calls)
        return True

    def _process(self, node: _Node) -> tuple[list[_Node] | None, float]:
        """Solve a node; its children, ``None`` if time ran out or labels overflowed, and its bound."""
        centre = node.prices
        best = node.bound
        slack = _SLACK
        while True:
            master = self._master(node.side, centre)
            solved, bound, centre, proved = self._generate(master, node.side, centre, best, slack)
            best = min(best, bound)
            if best <= self.cutoff():
                return [], best
            if not proved or solved.values is None:
                return None, best
            used = master.share(solved)
            visited = [(unit, column) for unit, column, _ in used]
            whole = all(abs(share - round(share)) < 1e-6 for *_, share in used)
            undecided = self._undecided(node.side, used)
            # With nothing left to decide only routes that visit a POI again can be in the way.
            if self._remember(visited, ignore_most=whole or not undecided):
                self._forget()
            elif whole and master.missed(solved) < 1e-6:
                self._offer_columns(used)
                if best <= self.cutoff() or slack == 0.0:
                    return [], min(best, self.cutoff())
                slack = 0.0  # the plan is the best of the node only if nothing was left
            else:
                break
        if self.nodes == 1 or self.nodes % 10 == 0:
            self._dive(node.side, centre)
        return self._branch(node.side, solved, undecided, best, centre), best

    def _master(self, side: Side, prices: Prices | None) -> Master:
        master = Master(side=side, pois=self._rows, n=self._n, floors=self._floors, penalty=self._penalty,
                        risk=self.goal.risk)
        columns = list(self.pool.values())
        if len(columns) > _POOL and prices is not None:
            gain = np.array([self._reduced(c, prices) for c in columns])
            columns = [columns[k] for k in np.sort(np.argsort(-gain, kind="stable")[:_POOL])]
        for number, unit in enumerate(side.units):
            master.add(number, [c for c in columns if c.fits(unit)])
        return master

    def _generate(
        self, master: Master, side: Side, centre: Prices | None, known: float, slack: float,
    ) -> tuple[Relaxed, float, Prices | None, bool]:
        """Column generation; the relaxation, an upper bound, the prices of the bound, and whether it is done."""
        best = math.inf
        smooth = _SMOOTHING if centre is not None and slack > 0 else 0.0
        quick = True
        while True:
            solved = master.solve(math.inf)
            if solved.values is None:
                raise RuntimeError(f"the master program is {solved.status}")
            if self.out():
                return solved, min(best, known), centre, False
            prices = master.prices(solved)
            if quick:
                added = 0
                for number, unit in enumerate(side.units):
                    priced = self._price(unit, prices, max(float(prices.unit[number]), 0.0) + self._tolerance(),
                                         exact=False)
                    added += self._add(master, number, unit, priced)
                if added:
                    continue
            at = prices if centre is None or smooth == 0.0 else prices.between(centre, smooth)
            most, added, complete = np.zeros(len(side.units)), 0, True
            for number, unit in enumerate(side.units):
                known_best = max([0.0, *(self._reduced(c, at) for u, c in master.entries if u == number)])
                # A little below the best, for routes there can be of use at the program's own prices.
                width = min(best, known) - solved.objective
                threshold = max(known_best - (width if math.isfinite(width) else 0.0), 0.0)
                priced = self._price(unit, at, threshold + self._tolerance(), exact=True)
                complete &= priced.complete
                most[number] = max(priced.best, known_best)
                routes = [self._column(unit.kind, route) for route in priced.routes]
                added += master.add(number, [c for c in routes if self._reduced(c, prices)
                                             > max(prices.unit[number], 0.0) + self._tolerance()])
            if not complete:
                return solved, min(best, known), centre, False
            bound = master.bound(at, most)
            if bound < best - 1e-12 or centre is None:
                best, centre = min(bound, best), at
                if self.nodes == 1:
                    self.tell(max(best, self.cutoff()))
            room = slack * (best - self.cutoff()) + 1e-9 * max(1.0, abs(best))
            if min(best, known) <= self.cutoff() or best <= solved.objective + room:
                return solved, best, centre, True
            if not added:
                if at is prices:
                    return solved, best, centre, True
                smooth = smooth / 2 if smooth > 0.1 else 0.0
                quick = False
            else:
                smooth, quick = _SMOOTHING, True

    def _price(self, unit: Unit, prices: Prices, threshold: float, *, exact: bool) -> Priced:
        own, graph = self.classes[unit.kind], self.graphs[unit.kind]
        reward = own.weights - prices.floor @ own.floors if len(self._floors) else own.weights.copy()
        reward = np.array(reward, dtype=np.float64)
        if unit.forbidden:
            reward[list(unit.forbidden)] = -np.inf
        self.calls["exact" if exact else "heuristic"] += 1
        priced = price(graph, reward, prices.visit, self.goal.driving, self.memory[unit.kind], threshold=threshold,
                       exact=exact, most_routes=ROUTES_A_ROUND, most_labels=MOST_LABELS)
        self.calls["labels"] += priced.labels
        return priced

    def _add(self, master: Master, number: int, unit: Unit, priced: Priced) -> int:
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

    def _reduced(self, column: Column, prices: Prices) -> float:
        """Value of a route less the prices of its visits."""
        return column.value - float(prices.visit @ column.visits) - float(prices.floor @ column.floors)

    def _tolerance(self) -> float:
        return _EPSILON * max(1.0, float(np.abs(self.goal.weights).max(initial=0.0)))

    def _remember(self, used: Sequence[tuple[int, Column]], *, ignore_most: bool) -> bool:
        """Make sites remember the POIs that routes in use visit again; whether anything changed."""
        changed = False
        for _, column in used:
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
        return changed

    def _forget(self) -> None:
        """Drop the columns that the ng-sets no longer allow."""
        self.pool = {key: c for key, c in self.pool.items()
                     if c.visits.max() <= 1 or allowed(c.route, self.graphs[c.kind], self.memory[c.kind])}

    def _offer_columns(self, used: Sequence[tuple[int, Column, float]]) -> None:
        """Offer a whole solution as a plan."""
        free = [list(self.classes[k].vehicles) for k in range(len(self.classes))]
        plan: list[tuple[int, ...]] = [()] * len(self.instance.vehicles)
        for _, column, share in used:
            for _ in range(round(share)):
                order = tuple(j for j in column.route if self.graphs[column.kind].bit[j] >= 0)
                plan[free[column.kind].pop(0)] = order
        self.offer(tuple(plan))

    def _dive(self, side: Side, centre: Prices | None) -> None:
        """Fix the column of largest share, price again without its POIs, until a plan stands."""
        fixed: list[tuple[int, Column, float]] = []
        units = list(side.units)
        while True:
            side = Side(units=tuple(units))
            master = self._master(side, centre)
            for _ in range(50):
                solved = master.solve(math.inf)
                if solved.values is None or self.out():
                    return
                prices = master.prices(solved)
                added = 0
                for number, unit in enumerate(units):
                    if unit.count:
                        priced = self._price(unit, prices, float(prices.unit[number]) + self._tolerance(), exact=False)
                        added += self._add(master, number, unit, priced)
                if not added:
                    break
            used = [(u, c, share) for u, c, share in master.share(solved) if c.visits.max(initial=0) <= 1]
            if not used:
                break
            number, column, _ = max(used, key=lambda entry: entry[2])
            fixed.append((number, column, 1.0))
            gone = frozenset(j for j in self._pois if column.visits[j])
            units[number] = replace(units[number], count=units[number].count - 1)
            units = [replace(u, forbidden=u.forbidden | gone) for u in units]
        self._offer_columns(fixed)

    def _undecided(
        self, side: Side, used: Sequence[tuple[int, Column, float]],
    ) -> list[tuple[float, int, int]]:
        """What a relaxation leaves open: distance from a half, POI, and unit, or -1: visited at all?."""
        each = np.zeros((len(side.units), self._n))
        for number, column, share in used:
            each[number] += share * column.visits
        total = each.sum(axis=0)
        found = [(abs(total[j] - 0.5), j, -1) for j in self._rows if 1e-6 < total[j] < 1 - 1e-6]
        if not found:
            found = [(abs(each[u, j] - 0.5), j, u) for u in range(len(side.units)) for j in self._rows
                     if 1e-6 < each[u, j] < 1 - 1e-6]
        if not found:  # several alike on whole visits: tell one of them from the others
            found = [(1.0, j, u) for u, unit in enumerate(side.units) if unit.count > 1
                     for j in self._rows if each[u, j] > 1e-6][:1]
        return sorted(found)

    def _branch(
        self, side: Side, solved: Relaxed, candidates: Sequence[tuple[float, int, int]], bound: float,
        prices: Prices | None,
    ) -> list[_Node]:
        """The two sides of a decision: is a POI visited, or does a unit visit it."""
        if not candidates:
            raise RuntimeError("a fractional solution without a fractional visit")
        best, chosen = -math.inf, self._sides(side, *candidates[0][1:])
        for _, poi, number in candidates[:_STRONG if len(candidates) > 1 else 0]:
            sides = self._sides(side, poi, number)
            drops = [max(solved.objective - self._master(child, prices).solve(math.inf).objective, 0.0)
                     for child in sides]
            score = max(min(drops), 1e-6) * max(max(drops), 1e-6)
            if score > best * (1 + 1e-9):
                best, chosen = score, sides
        return [_Node(side=child, bound=bound, prices=None if prices is None else _fitted(prices, side, child))
                for child in chosen]

    def _sides(self, side: Side, poi: int, number: int) -> tuple[Side, Side]:
        if number < 0:
            nobody = replace(side, units=tuple(without(u, poi) for u in side.units))
            return nobody, replace(side, required=side.required | {poi})
        unit = side.units[number]
        others = [without(u, poi) for u in side.units]
        if unit.count > 1:
            others[number] = replace(others[number], count=unit.count - 1)
            others.append(replace(unit, count=1))
        else:
            others[number] = unit
        barred = [without(u, poi) if k == number else u for k, u in enumerate(side.units)]
        return (replace(side, units=tuple(barred)),
                replace(side, units=tuple(others), required=side.required | {poi}))


def _alike(one: Class, other: Class, graph: Graph, other_graph: Graph) -> bool:
    return np.array_equal(one.weights, other.weights) and np.array_equal(one.floors, other.floors) \
        and (graph.capacity_s, graph.limit_s, graph.survival) == \
        (other_graph.capacity_s, other_graph.limit_s, other_graph.survival) \
        and np.array_equal(graph.legs, other_graph.legs) and np.array_equal(graph.time_s, other_graph.time_s) \
        and np.array_equal(graph.fuel_s, other_graph.fuel_s)


def _fitted(prices: Prices, side: Side, child: Side) -> Prices:
    """Prices for a child, which may have one more unit."""
    unit = prices.unit
    if len(child.units) > len(side.units):
        number = next(k for k, (a, b) in enumerate(zip(side.units, child.units, strict=False)) if a.count != b.count)
        unit = np.append(unit, unit[number])
    return replace(prices, unit=unit)
