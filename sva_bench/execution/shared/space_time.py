"""A plan in space and time of which only the order is kept: who passes first, wherever two robots can't be at once.

Robots are planned one after the other, each at its earliest among those before it, for several orders of priority. The
order of the plan with the least robot time is kept: every constraint agrees with that plan's times, so no robots wait
for each other in a circle, however late they are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from random import Random

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.execution.shared.conflicts import Runs, Strips, runs_of, strips_of
from sva_bench.execution.shared.crossings import crossings_of
from sva_bench.execution.shared.earliest import SPARE_S, plan_earliest
from sva_bench.execution.shared.flips import flipped
from sva_bench.execution.shared.lanes import Itinerary, Lane, Order

_ALL_ORDERS = 5  # robots up to which every order of priority is tried,
_ORDERS = 24  # beyond which so many are, and then moves of one robot in the best of them,
_MOST_ORDERS = 120  # until none saves anything, or so many orders were tried
_SAVED_S = 1e-6  # what a later order must save to be preferred: less is rounding


def plan_order(itineraries: Sequence[Itinerary], gap_m: float) -> Order | None:
    """The order of the plan with the least robot time: the sum of when the robots' last stops end.

    Every order of priority is planned for few robots, and a fixed choice and its neighbours for many; among plans of
    equal sum the first counts, by the robots' numbers. Then it is changed who passes first where two meet, as long as
    that saves time. A robot holds its first cell from the beginning, before it is
    ready too, and its last one for good; a robot without legs holds its place always.

    Args:
        itineraries: What each robot has yet to drive, at least one.
        gap_m: Least gap between two hulls in the middle of their cells [m]; smaller by ``STILL_M`` to a robot without
            legs.

    Returns:
        The order; ``None`` if no order of priority tried has a plan.
    """
    strips = strips_of(itineraries)
    search = _Search(itineraries, strips, runs_of(itineraries, strips, gap_m))
    plan = search.best()
    return None if plan is None else _order_of(itineraries, search, plan)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Plan:
    """A plan of all robots.

    Attributes:
        chosen: Which ways are driven, shape (ways,).
        enter, leave: When each of their cells is entered and left [s], shape (cells,).
        ends: When each robot's last stop ends [s], shape (robots,).
    """

    chosen: BoolArray
    enter: FloatArray
    leave: FloatArray
    ends: FloatArray


class _Search:
    """The search for the best order of priority, with plans of common beginnings made once."""

    def __init__(self, itineraries: Sequence[Itinerary], strips: Strips, runs: Runs) -> None:
        self.strips, self.runs = strips, runs
        self._ready = [itinerary.ready_s for itinerary in itineraries]
        self._driving = [number for number, itinerary in enumerate(itineraries) if itinerary.legs]
        self._chosen = np.zeros(len(strips.robot), dtype=np.bool_)
        self._enter, self._leave = np.zeros(len(strips.place_m)), np.zeros(len(strips.place_m))
        self._ends = np.array(self._ready)
        self._alone: dict[int, float] = {}
        self._planned: list[int] = []
        self._best: _Plan | None = None
        self._order: tuple[int, ...] = ()
        self._stranded: int | None = None  # the robot that had no way in the order tried last
        self._least = math.inf
        for number, itinerary in enumerate(itineraries):
            if not itinerary.legs:
                way = strips.leg[strips.legs[number]]
                self._chosen[way] = True
                self._enter[strips.first[way]], self._leave[strips.first[way]] = -math.inf, math.inf

    def best(self) -> _Plan | None:
        """The plan of the best order of priority tried; ``None`` if none has one."""
        for number in self._driving:
            self._alone[number] = self._plan(number)
            self._drop(number)
        tried = 0
        for order in _orders(self._driving):
            self._try(order)
            tried += 1
        order = tuple(self._driving)
        while len(order) > _ALL_ORDERS and tried < _MOST_ORDERS and not self._order and self._stranded is not None:
            # Whoever has no way among those before it must go before them.
            order = (self._stranded, *(number for number in order if number != self._stranded))
            self._try(order)
            tried += 1
        while len(self._driving) > _ALL_ORDERS and tried < _MOST_ORDERS and self._order:
            for order in _moved(self._order):
                tried += 1
                if self._try(order) or tried == _MOST_ORDERS:
                    break
            else:
                break
        return self._best

    def _try(self, order: tuple[int, ...]) -> bool:
        """Plan the robots in that order, and keep the plan if it is better; whether it is."""
        common = 0
        while common < len(self._planned) and self._planned[common] == order[common]:
            common += 1
        for number in self._planned[common:]:
            self._drop(number)
        del self._planned[common:]
        for number in order[common:]:
            # With nobody else driving a robot is as early as in any plan.
            least = sum(float(self._ends[n]) if n in self._planned else self._alone[n] for n in self._driving)
            if least >= self._least - _SAVED_S:
                return False
            if not math.isfinite(self._plan(number)):
                self._stranded = number
                return False
            self._planned.append(number)
        total = sum(float(self._ends[n]) for n in self._driving)
        if total >= self._least - _SAVED_S:
            return False
        self._least, self._order = total, order
        self._best = _Plan(chosen=self._chosen.copy(), enter=self._enter.copy(), leave=self._leave.copy(),
                           ends=self._ends.copy())
        return True

    def _plan(self, number: int) -> float:
        """Plan a robot among those planned; its end [s], ``inf`` if there is no way for it."""
        strips, runs = self.strips, self.runs
        ways = strips.leg[strips.legs[number]:strips.legs[number + 1] + 1]
        self._ends[number] = plan_earliest(
            ways, strips.first, strips.lasts_s, self._ready[number], runs.start, runs.way, runs.low, runs.high,
            self._chosen, self._enter, self._leave)
        return float(self._ends[number])

    def _drop(self, number: int) -> None:
        """Take a robot out of those planned."""
        legs = self.strips.legs
        self._chosen[self.strips.leg[legs[number]]:self.strips.leg[legs[number + 1]]] = False


def _orders(numbers: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Orders of priority to begin with: all of few robots, else a fixed choice, sorted so that they begin alike."""
    if len(numbers) <= _ALL_ORDERS:
        yield from permutations(numbers)
        return
    draws, tried = Random(0), {tuple(numbers), tuple(reversed(numbers))}
    while len(tried) < _ORDERS:
        tried.add(tuple(draws.sample(list(numbers), len(numbers))))
    yield from sorted(tried)


def _moved(order: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """The orders in which one robot has another place, those that begin alike first."""
    for low in range(len(order) - 2, -1, -1):
        for high in range(low + 1, len(order)):
            yield (*order[:low], order[high], *order[low:high], *order[high + 1:])
            if high > low + 1:
                yield (*order[:low], *order[low + 1:high + 1], order[low], *order[high + 1:])


def _order_of(itineraries: Sequence[Itinerary], search: _Search, plan: _Plan) -> Order:
    """The lanes of a plan, and what each robot must wait for."""
    strips, runs = search.strips, search.runs
    chosen, cells = [], []
    for robot in range(len(itineraries)):
        legs = range(strips.legs[robot], strips.legs[robot + 1])
        chosen.append([next(way for way in range(strips.leg[leg], strips.leg[leg + 1]) if plan.chosen[way])
                       for leg in legs])
        cells.append(np.concatenate([np.arange(strips.first[way], strips.first[way + 1]) for way in chosen[-1]]))
    crossings = crossings_of(cells, strips.robot, strips.lasts_s, runs.start, runs.way, runs.low, runs.high,
                             plan.chosen, plan.enter)
    ready_s = np.array([itinerary.ready_s for itinerary in itineraries])
    better = flipped(crossings, ready_s, SPARE_S)
    enter_s, ends_s = plan.enter[np.concatenate(cells)], plan.ends
    if better is not None:
        second, enter_s = better
        crossings = replace(crossings, second=second)
        enter_s[crossings.first[:-1]], last = ready_s, crossings.first[1:] - 1
        ends_s = np.where([bool(itinerary.legs) for itinerary in itineraries],
                          enter_s[last] + crossings.stay_s[last], ready_s)
    lanes = []
    for robot, (itinerary, ways, mine) in enumerate(zip(itineraries, chosen, cells, strict=True)):
        enter = enter_s[crossings.first[robot]:crossings.first[robot + 1]].copy()
        enter[0] = itinerary.ready_s
        leg = strips.legs[robot]
        cuts = tuple(itinerary.legs[k][way - strips.leg[leg + k]] for k, way in enumerate(ways)) \
            if itinerary.legs else ()
        sizes = [int(strips.first[way + 1] - strips.first[way]) for way in ways]
        lanes.append(Lane(cuts=cuts, first_cell=np.cumsum([0, *sizes]) if cuts else np.array([1]), enter_s=enter,
                          place_m=strips.place_m[mine]))
    needs = crossings.by_lane(crossings.needs(crossings.second))
    return Order(lanes=tuple(lanes), needs=needs, ends_s=ends_s, crossings=crossings)
