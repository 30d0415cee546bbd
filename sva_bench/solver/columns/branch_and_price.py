"""Branch-and-price: the best plan as a choice of routes, which labels find as they are needed.

Source:
    Boussier, Feillet, Gendreau (2007), "An exact algorithm for team orienteering problems".
"""

from __future__ import annotations

import heapq
import itertools
import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.solver.columns.column_generation import ColumnGeneration, Generated
from sva_bench.solver.columns.master import Column, Prices, Side, Unit, without
from sva_bench.solver.highs import Relaxed

_log = logging.getLogger(__name__)

_SLACK = 0.03  # of the gap: a relaxation this close to its bound counts as solved
_MISSED = 1e-6  # of what is required: no more than rounding
_COARSE = 0.3  # ... as long as its routes visit POIs again: they tell what to remember soon enough
_STRONG = 8  # candidates for branching that are looked at closely
CUTTING = 6  # vehicles from which subset-row cuts are worth their labels
_TAIL = 0.02  # of the gap: cuts that lower the bound by less aren't worth it


@dataclass(frozen=True, eq=False, kw_only=True)
class _Node:
    side: Side
    bound: float
    prices: Prices | None


@dataclass(eq=False, kw_only=True)
class BranchAndPrice:
    """A search for the best plan.

    Attributes:
        generation: The routes.
        offer: Takes a plan, as POIs of each vehicle in order, and keeps it if it is better.
        left_s: Time left [s].
        tell: Takes every upper bound on the goal.
        nodes: Nodes of the search tree so far.
    """

    generation: ColumnGeneration
    offer: Callable[[tuple[tuple[int, ...], ...]], None]
    left_s: Callable[[], float]
    tell: Callable[[float], None]
    nodes: int = 0

    def run(self) -> bool:
        """Search until nothing above the cutoff is left; ``False`` if time is up or labels overflow before."""
        root = Side(units=tuple(Unit(kind=k, count=len(c.vehicles)) for k, c in enumerate(self.generation.classes)))
        ticket = itertools.count()
        waiting = [(-math.inf, next(ticket), _Node(side=root, bound=math.inf, prices=None))]
        while waiting and -waiting[0][0] > self.generation.cutoff():
            node = heapq.heappop(waiting)[2]
            if self.generation.out():
                return False
            self.nodes += 1
            children, bound = self._process(node)
            left = max((-entry[0] for entry in waiting), default=-math.inf)
            self.tell(max(left, bound, self.generation.cutoff()))
            if children is None:
                return False
            for child in children:
                heapq.heappush(waiting, (-child.bound, next(ticket), child))
            _log.debug("node %d: bound %.6g, %d waiting, %d columns, %s", self.nodes, bound, len(waiting),
                       len(self.generation.pool), self.generation.calls)
        return True

    def _process(self, node: _Node) -> tuple[list[_Node] | None, float]:
        """Solve a node; its children, ``None`` if time ran out or labels overflowed, and its bound."""
        generation, cutoff = self.generation, self.generation.cutoff
        centre, best, slack, before, dived = node.prices, node.bound, _COARSE, math.inf, False
        penalty = generation.penalty
        while True:
            master = generation.master(node.side, centre, penalty=penalty)
            made = generation.generate(master, node.side, centre, known=best, slack=slack,
                                       tell=self.tell if self.nodes == 1 else None)
            solved, centre = made.relaxed, made.prices
            best = min(best, made.bound)
            if best <= cutoff():
                return [], best
            if not made.complete or solved.values is None:
                return None, best
            used = master.share(solved.values)
            undecided = self._undecided(node.side, used)
            whole = not undecided or all(abs(share - round(share)) < 1e-6 for *_, share in used)
            # With nothing left to decide only routes that visit a POI again can be in the way.
            if generation.remember([column for _, column, _ in used], ignore_most=whole):
                continue
            if slack == _COARSE:
                slack = _SLACK
                continue
            if master.missed(solved.values) > _MISSED:
                # Missing what is required cost less than any plan that keeps it. Branching would decide the same again;
                # a dearer miss ends in a point that keeps it, or if there is none in a bound below every plan.
                penalty *= 10.0
                continue
            generation.penalty = penalty
            if whole:
                self._offer_columns(used)
                if best <= cutoff() or slack == 0.0:
                    return [], min(best, cutoff())
                slack = 0.0  # the plan is the best of the node only if nothing was left
                continue
            if not dived and (self.nodes == 1 or self.nodes % 10 == 0):
                self._dive(node.side, centre)
                dived = True
            if (settled := self._enumerate(node.side, made)) is not None:
                return ([], min(best, settled)) if settled <= cutoff() else (None, min(best, settled))
            if not (self._cutting() and before - best > _TAIL * (best - cutoff()) and generation.cut(used)):
                if self.nodes == 1 and generation.cuts:
                    self._dive(node.side, centre)
                return self._branch(node.side, solved, undecided, best, centre), best
            before = best

    def _cutting(self) -> bool:
        """Whether cuts are worth their labels: where vehicles are many; discounted labels can't pay for them."""
        survival = self.generation.survival
        return len(survival) >= CUTTING and bool((survival == 1.0).all())

    def _enumerate(self, side: Side, made: Generated) -> float | None:
        """Choose among all routes that count, if they are few; an upper bound on the node then."""
        entries, penalty = self.generation.enumerate(side, made), self.generation.penalty
        if entries is None:
            return None
        while True:
            master = self.generation.master(side, None, entries, penalty)
            outcome = master.solve_whole(self.left_s())
            _log.debug("listed %d routes: %s, %.6g of %.6g, %d nodes", len(master.entries), outcome.status,
                       outcome.objective, outcome.bound, outcome.nodes)
            kept = outcome.values is not None and master.missed(outcome.values) <= _MISSED
            if kept and outcome.values is not None:
                self._offer_columns(master.share(outcome.values))
            if outcome.status == "interrupted":
                raise KeyboardInterrupt
            if not kept and outcome.status == "optimal" and outcome.bound > self.generation.cutoff():
                penalty *= 10.0
                continue
            return max(min(outcome.bound, made.bound), self.generation.cutoff())

    def _offer_columns(self, used: Sequence[tuple[int, Column, float]]) -> None:
        """Offer a whole solution as a plan; a vehicle that drives parts of several routes over the same POIs may drive
        any of them."""
        free = [list(c.vehicles) for c in self.generation.classes]
        plan: list[tuple[int, ...]] = [()] * len(self.generation.instance.vehicles)
        parted: set[int] = set()
        for number, column, share in sorted(used, key=lambda entry: -entry[1].value):
            times = round(share)
            if abs(share - times) > 1e-6:
                times = int(number not in parted)
                parted.add(number)
            for _ in range(times):
                order = tuple(j for j in column.route if self.generation.graphs[column.kind].bit[j] >= 0)
                plan[free[column.kind].pop(0)] = order
        self.offer(tuple(plan))

    def _dive(self, side: Side, centre: Prices | None) -> None:
        """Fix the column of largest share, price again without its POIs, until a plan stands."""
        fixed: list[tuple[int, Column, float]] = []
        units = list(side.units)
        while True:
            side = Side(units=tuple(units))
            master = self.generation.master(side, centre)
            for _ in range(50):
                solved = master.solve(math.inf)
                if solved.values is None or self.generation.out():
                    return
                prices = master.prices(solved)
                added = 0
                for number, unit in enumerate(units):
                    if unit.count:
                        threshold = float(prices.unit[number]) + self.generation.tolerance
                        priced = self.generation.price(unit, prices, threshold, exact=False)
                        added += self.generation.add(master, number, unit, priced)
                if not added:
                    break
            assert solved.values is not None
            used = [(u, c, share) for u, c, share in master.share(solved.values) if c.visits.max(initial=0) <= 1]
            if not used:
                break
            number, column, _ = max(used, key=lambda entry: entry[2])
            fixed.append((number, column, 1.0))
            gone = frozenset(j for j in self.generation.instance.pois if column.visits[j])
            units[number] = replace(units[number], count=units[number].count - 1)
            units = [replace(u, forbidden=u.forbidden | gone) for u in units]
        self._offer_columns(fixed)

    def _undecided(
        self, side: Side, used: Sequence[tuple[int, Column, float]],
    ) -> list[tuple[float, int, int]]:
        """What a relaxation leaves open: distance from a half, POI, and unit, or -1: visited at all?."""
        each = np.zeros((len(side.units), len(self.generation.instance.sites)))
        for number, column, share in used:
            each[number] += share * column.visits
        total = each.sum(axis=0)
        found = [(abs(total[j] - 0.5), j, -1) for j in self.generation.rows
                 if j not in side.required and 1e-6 < total[j] < 1 - 1e-6]
        if not found:
            found = [(abs(each[u, j] - 0.5), j, u) for u in range(len(side.units)) for j in self.generation.rows
                     if 1e-6 < each[u, j] < 1 - 1e-6]
        if not found:  # several alike on whole visits: tell one of them from the others
            found = [(1.0, j, u) for u, unit in enumerate(side.units) if unit.count > 1
                     for j in self.generation.rows if each[u, j] > 1e-6][:1]
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
            drops = [max(solved.objective - self.generation.master(child, prices).solve(math.inf).objective, 0.0)
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


def _fitted(prices: Prices, side: Side, child: Side) -> Prices:
    """Prices for a child, which may have one more unit."""
    unit = prices.unit
    if len(child.units) > len(side.units):
        number = next(k for k, (a, b) in enumerate(zip(side.units, child.units, strict=False)) if a.count != b.count)
        unit = np.append(unit, unit[number])
    return replace(prices, unit=unit)
