"""Branch-and-price: the best plan as a choice of routes, which pricing generates as they are needed.

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
from sva_bench.solver.columns.master import BranchState, Column, Duals, VehicleGroup, without
from sva_bench.solver.program import Relaxed

_log = logging.getLogger(__name__)

_SLACK = 0.03  # share of the gap: a relaxation this close to its bound counts as solved
_VIOLATED = 1e-6  # violation of a requirement that counts as rounding
_STRONG, _PROBED = 8, 3  # candidates of strong branching by the columns there are, and of these by new ones too
_ROUNDS = 6  # of pricing for that
CUTTING = 6  # vehicles from which subset-row cuts shorten the proof
_SEARCH_EVERY = 5_000_000  # labels for which the heuristic runs once more: a small part of their time
_SEARCHES = 10  # at most
_TAIL = 0.02  # share of the gap: a round of cuts that lowers the bound by less is the last (tailing off)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Node:
    state: BranchState
    bound: float
    duals: Duals | None


@dataclass(eq=False, kw_only=True)
class BranchAndPrice:
    """A branch-and-price search for the best plan, best bound first.

    Attributes:
        generation: The columns, and the pricing that generates them.
        offer: Takes a plan, as POIs of each vehicle in order, and keeps it if it is better.
        search_again: Runs the heuristic with a seed, and adds its routes to the columns.
        left_s: Time left [s].
        report_bound: Takes every upper bound on the goal.
        nodes: Nodes of the search tree so far.
        searches: Runs of the heuristic so far.
    """

    generation: ColumnGeneration
    offer: Callable[[tuple[tuple[int, ...], ...]], None]
    search_again: Callable[[int], None]
    left_s: Callable[[], float]
    report_bound: Callable[[float], None]
    nodes: int = 0
    searches: int = 0

    def run(self) -> bool:
        """Search until no node's bound is above the cutoff; ``False`` if time runs out or labels overflow before."""
        root = BranchState(groups=tuple(
            VehicleGroup(vehicle_class=k, count=len(c.vehicles)) for k, c in enumerate(self.generation.classes)))
        ticket = itertools.count()
        waiting = [(-math.inf, next(ticket), _Node(state=root, bound=math.inf, duals=None))]
        while waiting and -waiting[0][0] > self.generation.cutoff():
            node = heapq.heappop(waiting)[2]
            if self.generation.is_over():
                return False
            self.nodes += 1
            children, bound = self._process(node)
            left = max((-entry[0] for entry in waiting), default=-math.inf)
            self.report_bound(max(left, bound, self.generation.cutoff()))
            if children is None:
                return False
            for child in children:
                heapq.heappush(waiting, (-child.bound, next(ticket), child))
            _log.debug("node %d: bound %.6g, %d waiting, %d columns, %s", self.nodes, bound, len(waiting),
                       len(self.generation.pool), self.generation.calls)
        return True

    def _process(self, node: _Node) -> tuple[list[_Node] | None, float]:
        """Solve a node: its children, ``None`` if time ran out or labels overflowed; and its upper bound."""
        generation, cutoff = self.generation, self.generation.cutoff
        centre, best, slack, before, dived = node.duals, node.bound, _SLACK, math.inf, False
        proving = False  # while ng-sets still grow: cycles show before the relaxation is solved to the end
        penalty = generation.penalty
        while True:
            master = generation.master(node.state, centre, penalty=penalty)
            made = generation.generate(master, node.state, centre, known=best, slack=slack, proving=proving,
                                       report_bound=self.report_bound if self.nodes == 1 else None)
            solved, centre = made.relaxed, made.duals
            best = min(best, made.bound)
            if best <= cutoff():
                return [], best
            if not made.complete or solved.values is None:
                return None, best
            used = master.share(solved.values)
            undecided = self._undecided(node.state, used)
            integral = not undecided or all(abs(share - round(share)) < 1e-6 for *_, share in used)
            # With no fractional visit left, only routes that visit a POI twice can make the solution fractional.
            if generation.remember([column for _, column, _ in used], ignore_most=integral):
                proving = False
                continue
            if not made.exact:
                proving = True
                continue
            if master.violation(solved.values) > _VIOLATED:
                # Violating a requirement cost less than any plan that keeps it, and branching would not change that:
                # a greater penalty gives a point that keeps it, or if there is none a bound below every plan.
                penalty *= 10.0
                continue
            generation.penalty = penalty
            if integral:
                self._offer_columns(used)
                if best <= cutoff() or slack == 0.0:
                    return [], min(best, cutoff())
                slack = 0.0  # the plan is the node's optimum only if the relaxation is solved to the end
                continue
            if not dived and (self.nodes == 1 or self.nodes % 10 == 0):
                self._dive(node.state, centre)
                dived = True
            if (settled := self._enumerate(node.state, made)) is not None:
                return ([], min(best, settled)) if settled <= cutoff() else (None, min(best, settled))
            if not (self._cutting() and before - best > _TAIL * (best - cutoff()) and generation.cut(used)):
                if self.nodes == 1 and generation.cuts:
                    self._dive(node.state, centre)
                self._search_again()
                if best <= cutoff():
                    return [], best
                return self._branch(node.state, solved, undecided, best, centre), best
            before = best

    def _search_again(self) -> None:
        """Run the heuristic with other seeds, as often as the proof is long."""
        while self.searches < min(_SEARCHES, self.generation.calls["labels"] // _SEARCH_EVERY) \
                and not self.generation.is_over():
            self.searches += 1
            self.search_again(self.searches)

    def _cutting(self) -> bool:
        """Whether to separate cuts: worthwhile with many vehicles; discounted labels carry no duals of cuts."""
        return len(self.generation.scopes) >= CUTTING and self.generation.is_plain

    def _enumerate(self, state: BranchState, made: Generated) -> float | None:
        """Solve the node over all routes that can be in a better plan, if few: its upper bound, else ``None``."""
        entries, penalty = self.generation.enumerate(state, made), self.generation.penalty
        if entries is None:
            return None
        while True:
            master = self.generation.master(state, None, entries, penalty)
            outcome = master.solve_integer(self.left_s())
            _log.debug("listed %d routes: %s, %.6g of %.6g, %d nodes", len(master.entries), outcome.status,
                       outcome.objective, outcome.bound, outcome.nodes)
            kept = outcome.values is not None and master.violation(outcome.values) <= _VIOLATED
            if kept and outcome.values is not None:
                self._offer_columns(master.share(outcome.values))
            if outcome.status == "interrupted":
                raise KeyboardInterrupt
            if not kept and outcome.status == "optimal" and outcome.bound > self.generation.cutoff():
                penalty *= 10.0
                continue
            return max(min(outcome.bound, made.bound), self.generation.cutoff())

    def _offer_columns(self, used: Sequence[tuple[int, Column, float]]) -> None:
        """Offer an integer solution as a plan.

        A vehicle that drives fractions of several routes over the same POIs may drive any of them.
        """
        free = [list(c.vehicles) for c in self.generation.classes]
        plan: list[tuple[int, ...]] = [()] * len(self.generation.instance.vehicles)
        split: set[int] = set()
        for number, column, share in sorted(used, key=lambda entry: -entry[1].value):
            times = round(share)
            if abs(share - times) > 1e-6:
                times = int(number not in split)
                split.add(number)
            for _ in range(times):
                order = tuple(j for j in column.route if self.generation.graphs[column.vehicle_class].bit[j] >= 0)
                plan[free[column.vehicle_class].pop(0)] = order
        self.offer(tuple(plan))

    def _dive(self, state: BranchState, centre: Duals | None) -> None:
        """Diving heuristic: fix the column of largest value and price again without its POIs, until none is left."""
        fixed: list[tuple[int, Column, float]] = []
        groups = list(state.groups)
        while True:
            state = BranchState(groups=tuple(groups))
            master = self.generation.master(state, centre)
            for _ in range(50):
                solved = master.solve(math.inf)
                if solved.values is None or self.generation.is_over():
                    return
                duals = master.duals(solved)
                added = 0
                for number, group in enumerate(groups):
                    if group.count:
                        threshold = float(duals.group[number]) + self.generation.tolerance
                        priced = self.generation.price(group, duals, threshold, 0)
                        added += self.generation.add(master, number, group, priced)
                if not added:
                    break
            assert solved.values is not None
            used = [(u, c, share) for u, c, share in master.share(solved.values) if c.visits.max(initial=0) <= 1]
            if not used:
                break
            number, column, _ = max(used, key=lambda entry: entry[2])
            fixed.append((number, column, 1.0))
            visited = frozenset(j for j in self.generation.instance.pois if column.visits[j])
            groups[number] = replace(groups[number], count=groups[number].count - 1)
            groups = [replace(u, forbidden=u.forbidden | visited) for u in groups]
        self._offer_columns(fixed)

    def _undecided(
        self, state: BranchState, used: Sequence[tuple[int, Column, float]],
    ) -> list[tuple[float, int, int]]:
        """Fractional visits of a relaxation, most fractional first: distance from 1/2, POI, and vehicle group or -1.

        A group is given where the POI is visited for sure, but it is open by which group.
        """
        each = np.zeros((len(state.groups), len(self.generation.instance.sites)))
        for number, column, share in used:
            each[number] += share * column.visits
        total = each.sum(axis=0)
        found = [(abs(total[j] - 0.5), j, -1) for j in self.generation.rows
                 if j not in state.required and 1e-6 < total[j] < 1 - 1e-6]
        if not found:
            found = [(abs(each[u, j] - 0.5), j, u) for u in range(len(state.groups)) for j in self.generation.rows
                     if 1e-6 < each[u, j] < 1 - 1e-6]
        if not found:  # integral visits by a group of several vehicles: branch on one vehicle of it
            found = [(1.0, j, u) for u, group in enumerate(state.groups) if group.count > 1
                     for j in self.generation.rows if each[u, j] > 1e-6][:1]
        return sorted(found)

    def _branch(
        self, state: BranchState, solved: Relaxed, candidates: Sequence[tuple[float, int, int]], bound: float,
        duals: Duals | None,
    ) -> list[_Node]:
        """Two children, by strong branching: on whether a POI is visited, or whether a vehicle group visits it."""
        if not candidates:
            raise RuntimeError("a fractional solution without a fractional visit")
        looks = [self._children(state, poi, number) for _, poi, number in candidates[:_STRONG]]
        if len(looks) > 1:
            looks = sorted(looks, key=lambda children: -self._score(solved, children, duals, rounds=0))[:_PROBED]
            looks = [max(looks, key=lambda children: self._score(solved, children, duals, rounds=_ROUNDS))]
        return [_Node(state=child, bound=bound, duals=None if duals is None else _fitted(duals, state, child))
                for child in looks[0]]

    def _score(self, solved: Relaxed, children: Sequence[BranchState], duals: Duals | None, *, rounds: int) -> float:
        """How far a branch brings the relaxation down, after so many rounds of the quickest pricing."""
        drops = []
        for child in children:
            master = self.generation.master(child, duals)
            relaxed = master.solve(math.inf)
            for _ in range(rounds):
                if relaxed.values is None or not self.generation.price_all(master, child, master.duals(relaxed), 0):
                    break
                relaxed = master.solve(math.inf)
            drops.append(max(solved.objective - relaxed.objective, 1e-6))
        return round(math.log(math.prod(drops)), 9)

    def _children(self, state: BranchState, poi: int, number: int) -> tuple[BranchState, BranchState]:
        if number < 0:
            unvisited = replace(state, groups=tuple(without(u, poi) for u in state.groups))
            return unvisited, replace(state, required=state.required | {poi})
        group = state.groups[number]
        others = [without(u, poi) for u in state.groups]
        if group.count > 1:
            others[number] = replace(others[number], count=group.count - 1)
            others.append(replace(group, count=1))
        else:
            others[number] = group
        barred = [without(u, poi) if k == number else u for k, u in enumerate(state.groups)]
        return (replace(state, groups=tuple(barred)),
                replace(state, groups=tuple(others), required=state.required | {poi}))


def _fitted(duals: Duals, state: BranchState, child: BranchState) -> Duals:
    """A node's duals for a child, which may have one more vehicle group."""
    group = duals.group
    if len(child.groups) > len(state.groups):
        number = next(k for k, (a, b) in enumerate(zip(state.groups, child.groups, strict=False)) if a.count != b.count)
        group = np.append(group, group[number])
    return replace(duals, group=group)
