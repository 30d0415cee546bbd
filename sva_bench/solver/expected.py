"""The collapsed model solved to a proof: heuristic, cuts at the root, branch and bound, more cuts."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Status
from sva_bench.solver.cuts import Cut, cut_rows, violated_by_fractions, violated_by_integers
from sva_bench.solver.formulation import Goal, Legs, LinearModel, columns_of, formulate
from sva_bench.solver.heuristic import Orders, search, shorten
from sva_bench.solver.highs import Outcome, Relaxation, maximise
from sva_bench.solver.preprocess import Scope, scope_of
from sva_bench.solver.refuelling import Road, quickest, road_of

_log = logging.getLogger(__name__)

Routes = tuple[tuple[int, ...], ...]
"""Sites of each vehicle's route, from base to base; empty for one that stays home."""

HEURISTIC_ROUNDS = 150
ROOT_ROUNDS = 60
_DECIMALS = 1000  # incentives times probabilities are often whole in thousandths
_STALL = 1e-4  # relative gain of the bound below which a round counts as idle
_IDLE_ROUNDS = 4


@dataclass(frozen=True, kw_only=True)
class SolveLimits:
    """When a solve may stop.

    Attributes:
        time_limit_s: Wall-clock time for one plan [s]; ``None`` = none.
        gap: Relative gap (absolute below a value of 1) at which a plan counts as optimal.
    """

    time_limit_s: float | None = None
    gap: float = 1e-6

    def __post_init__(self) -> None:
        if self.gap < 0 or (self.time_limit_s is not None and self.time_limit_s < 0):
            raise ValueError("limits can't be negative")

    def clock(self) -> Clock:
        """A clock that starts now."""
        now = time.monotonic()
        return Clock(started=now, deadline=math.inf if self.time_limit_s is None else now + self.time_limit_s)


@dataclass(frozen=True, kw_only=True)
class Clock:
    """Time used and time left, in ``time.monotonic``."""

    started: float
    deadline: float

    def left_s(self) -> float:
        """Time left [s]."""
        return max(self.deadline - time.monotonic(), 0.0)

    def used_s(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self.started

    def out(self) -> bool:
        """Whether no time is left."""
        return time.monotonic() >= self.deadline


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """What a solve came to.

    Attributes:
        routes: Sites of each vehicle's route.
        orders: Its POIs alone.
        value: Value of the goal.
        bound: Upper bound on it.
        status: How it ended.
        nodes: Branch-and-bound nodes.
        cuts: Connectivity cuts in the last program.
        rounds: Linear and integer programs solved.
        seconds: Wall-clock time of each phase [s].
    """

    routes: Routes
    orders: Orders
    value: float
    bound: float
    status: Status
    nodes: int
    cuts: int
    rounds: int
    seconds: dict[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Knowledge:
    """What earlier solves of the same sites and vehicles found; availabilities may differ between them.

    Attributes:
        instance: The instance it began with.
        roads: Road of each vehicle.
        cuts: Connectivity cuts, valid for any goal, in order of discovery.
        orders: Feasible plans, in order of discovery.
        solutions: Proved solutions by what defines their goal.
    """

    instance: Instance
    roads: tuple[Road, ...]
    cuts: dict[Cut, None] = field(default_factory=dict)
    orders: dict[Orders, None] = field(default_factory=dict)
    solutions: dict[tuple[object, ...], Solution] = field(default_factory=dict)

    def check(self, instance: Instance) -> None:
        """Refuse an instance that differs in more than its availabilities.

        Raises:
            ValueError: If it does.
        """
        first = self.instance
        same = (first.sites, first.base, first.stations) == (instance.sites, instance.base, instance.stations) \
            and np.array_equal(first.stop_s, instance.stop_s) and len(first.vehicles) == len(instance.vehicles) \
            and all(
                (a.name, a.fuel_capacity_s, a.mission_limit_s) == (b.name, b.fuel_capacity_s, b.mission_limit_s)
                and np.array_equal(a.fuel_s, b.fuel_s) and np.array_equal(a.incentives, b.incentives)
                for a, b in zip(first.vehicles, instance.vehicles, strict=True))
        if not same:
            raise ValueError(f"what is known of instance {first.name!r} doesn't hold for {instance.name!r}: "
                             "they differ in more than their availabilities")


def knowledge_of(instance: Instance) -> Knowledge:
    """Nothing known yet."""
    return Knowledge(instance=instance, roads=tuple(road_of(instance, v) for v in instance.vehicles))


@dataclass(eq=False, kw_only=True)
class _Progress:
    """The state of a solve, kept where Ctrl-C can't lose it."""

    orders: Orders
    value: float
    bound: float
    status: Status = "feasible"
    nodes: int = 0
    cuts: int = 0
    rounds: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    grain: float = 0.0  # every plan's value is a multiple of it; 0 = unknown

    def tighten(self, bound: float) -> None:
        """Take up an upper bound, and round it down to a value that a plan can have."""
        if self.grain and math.isfinite(bound):
            bound = math.floor(bound / self.grain + 1e-6) * self.grain
        self.bound = min(self.bound, bound)

    def closed(self, gap: float) -> bool:
        """Whether nothing is left to prove."""
        return self.bound - self.value <= gap * max(1.0, abs(self.value))


def solve(instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float) -> Solution:
    """The best plan for a goal, with a proof unless time runs out or Ctrl-C is pressed.

    Args:
        instance: The instance.
        goal: What to maximise.
        known: What earlier solves found; this one adds to it.
        clock: Time left.
        gap: Gap at which the plan counts as optimal.

    Raises:
        ValueError: If the goal has floors and no known plan reaches them.
    """
    known.check(instance)
    start = _best_known(goal, known)
    if start is None:
        raise ValueError("no known plan reaches the floors of the goal")
    progress = _Progress(orders=start, value=_value(goal, known.roads, start), bound=_trivial_bound(goal),
                         grain=_grain(goal))
    try:
        if not goal.floors and not goal.driving and bool((goal.weights >= 0).all()):
            began = clock.used_s()
            _adopt(progress, goal, known, search(
                known.roads, goal.weights, start, rounds=HEURISTIC_ROUNDS, seed=0, out_of_time=clock.out))
            progress.seconds["heuristic"] = clock.used_s() - began
        _prove(instance, goal, known, clock, gap, progress)
    except KeyboardInterrupt:
        progress.status = "interrupted"
    progress.bound = max(progress.bound, progress.value)
    if progress.closed(gap):
        progress.status = "optimal"
    orders = progress.orders
    if not goal.driving and progress.status != "interrupted":
        orders = tuple(shorten(road, order) for road, order in zip(known.roads, orders, strict=True))
    known.orders[orders] = None
    routes = tuple(_drive(road, order) for road, order in zip(known.roads, orders, strict=True))
    return Solution(routes=routes, orders=orders, value=progress.value, bound=progress.bound, status=progress.status,
                    nodes=progress.nodes, cuts=progress.cuts, rounds=progress.rounds, seconds=progress.seconds)


def _prove(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, progress: _Progress,
) -> None:
    if progress.closed(gap):
        return
    rewarded = goal.rewarded()
    scopes = [scope_of(instance, v, rewarded[m]) for m, v in enumerate(instance.vehicles)]
    model, legs = formulate(instance, scopes, goal)
    largest = float(np.abs(model.objective).max(initial=0.0))
    # Whole incentives stay whole: HiGHS then rounds its bounds.
    size = 1.0 if largest == 0 or 1 <= largest <= 1e4 else largest
    model = replace(model, objective=model.objective / size)
    began = clock.used_s()
    cuts = _root(instance, known, clock, gap, progress, model, legs, size)
    progress.seconds["root"] = clock.used_s() - began
    began = clock.used_s()
    _branch(instance, goal, known, clock, gap, progress, model, legs, scopes, size, cuts)
    progress.seconds["branch"] = clock.used_s() - began


def _root(
    instance: Instance, known: Knowledge, clock: Clock, gap: float, progress: _Progress,
    model: LinearModel, legs: Legs, size: float,
) -> list[Cut]:
    """Tighten the relaxation by cuts; the ones that are tight in the end. Lowers the bound of ``progress``."""
    n = len(instance.sites)
    cuts = list(known.cuts)
    relaxation = Relaxation(model)
    relaxation.add(cut_rows(cuts, legs, n))
    present, idle, last = set(cuts), 0, math.inf
    activity: FloatArray = np.zeros(0)
    for _ in range(ROOT_ROUNDS):
        if clock.out() or progress.closed(gap):
            break
        outcome, activity_now = relaxation.solve(clock.left_s())
        progress.rounds += 1
        if outcome.status == "infeasible":
            progress.bound = progress.value
            break
        if outcome.values is None:
            break
        activity = activity_now
        progress.tighten(outcome.bound * size)
        idle = idle + 1 if last - outcome.bound < _STALL * max(abs(outcome.bound), 1e-9) else 0
        last = outcome.bound
        new = [cut for cut in _separate(instance, legs, outcome.values) if cut not in present]
        if not new or idle >= _IDLE_ROUNDS:
            break
        relaxation.add(cut_rows(new, legs, n))
        cuts += new
        present.update(new)
    slack = activity[len(model.rows.lower):]
    tight = [cut for cut, room in zip(cuts, slack, strict=False) if room < 1e-6]
    known.cuts.update(dict.fromkeys(tight))
    _log.debug("root: bound %.6g, value %.6g, %d of %d cuts kept", progress.bound, progress.value, len(tight),
               len(cuts))
    return tight


def _branch(
    instance: Instance, goal: Goal, known: Knowledge, clock: Clock, gap: float, progress: _Progress,
    model: LinearModel, legs: Legs, scopes: Sequence[Scope], size: float, cuts: list[Cut],
) -> None:
    """Branch and bound, again with every cut that its solution breaks."""
    n = len(instance.sites)
    pois = frozenset(instance.pois)
    while not progress.closed(gap):
        if clock.out():
            progress.status = "time_limit"
            return
        progress.cuts = len(cuts)
        routes = [_drive(road, order) for road, order in zip(known.roads, progress.orders, strict=True)]
        slack = max(gap / 2 * max(1.0, abs(progress.value)), 0.99 * progress.grain)  # below the grain there is no plan
        outcome = maximise(
            model, cut_rows(cuts, legs, n), gap=gap / 2, absolute_gap=slack / size,
            time_limit_s=clock.left_s(), start=columns_of(instance, legs, scopes, routes))
        progress.rounds += 1
        progress.nodes += outcome.nodes
        progress.tighten(progress.value if outcome.status == "infeasible" else outcome.bound * size)
        broken = _integers(instance, goal, known, legs, outcome, pois, progress)
        if outcome.status in ("time_limit", "interrupted"):
            progress.status = outcome.status
            return
        if not broken:
            return
        new = [replace(cut, vehicle=m) for cut in broken for m in range(len(instance.vehicles))]
        cuts = list(dict.fromkeys([*cuts, *new]))
        known.cuts.update(dict.fromkeys(new))
        _log.debug("branch: bound %.6g, value %.6g, %d cuts broken", progress.bound, progress.value, len(broken))


def _integers(
    instance: Instance, goal: Goal, known: Knowledge, legs: Legs, outcome: Outcome, pois: frozenset[int],
    progress: _Progress,
) -> list[Cut]:
    """Take up an integer solution, as far as it hangs together with the base; the cuts that it breaks."""
    if outcome.values is None:
        return []
    broken: list[Cut] = []
    orders = []
    for m, road in enumerate(known.roads):
        visits = np.rint(legs.matrix(outcome.values, m, len(instance.sites)))
        broken += violated_by_integers(visits, m, instance.base, pois)
        order = tuple(j for j in euler_walk(visits, instance.base) if j in pois)
        if quickest(road, order) is None:
            raise RuntimeError(f"the solver's route of {instance.vehicles[m].name} breaks its fuel or limit")
        orders.append(_without_idle_stops(road, order, goal.rewarded()[m]))
    _adopt(progress, goal, known, tuple(orders))
    return broken


def _separate(instance: Instance, legs: Legs, values: FloatArray) -> list[Cut]:
    pois = frozenset(instance.pois)
    return [cut for m in range(len(instance.vehicles))
            for cut in violated_by_fractions(legs.matrix(values, m, len(instance.sites)), m, instance.base, pois)]


def euler_walk(visits: FloatArray, base: int) -> list[int]:
    """A walk from base to base that drives every leg as often as ``visits`` says, as far as legs join up with the base.

    Any such walk will do: a POI is entered and left once, so the stretches between refuels are the same in all.

    Args:
        visits: How often each leg is driven, shape (n, n); as often into a site as out of it.
        base: The base.

    Source:
        Hierholzer (1873).
    """
    left = visits.copy()
    stack, walk = [base], []
    while stack:
        onward = np.flatnonzero(left[stack[-1]] > 0.5)
        if len(onward):
            left[stack[-1], onward[0]] -= 1
            stack.append(int(onward[0]))
        else:
            walk.append(stack.pop())
    return walk[::-1]


def _best_known(goal: Goal, known: Knowledge) -> Orders | None:
    """The best of the known plans under a goal, without stops that earn nothing; ``None`` if none keeps the floors."""
    rewarded = goal.rewarded()
    nobody: Orders = tuple(() for _ in known.roads)
    candidates = [
        tuple(_without_idle_stops(road, order, rewarded[m])
              for m, (road, order) in enumerate(zip(known.roads, orders, strict=True)))
        for orders in (*known.orders, nobody)]
    kept = [orders for orders in candidates if _keeps_floors(goal, orders)]
    return max(kept, key=lambda orders: _value(goal, known.roads, orders)) if kept else None


def _without_idle_stops(road: Road, order: tuple[int, ...], rewarded: BoolArray) -> tuple[int, ...]:
    """The order without POIs that count for nothing, but for those that the rest can't be driven without."""
    if not any(rewarded[j] for j in order):
        return ()
    for poi in order:
        shorter = tuple(j for j in order if j != poi)
        if not rewarded[poi] and quickest(road, shorter) is not None:
            order = shorter
    return order


def _keeps_floors(goal: Goal, orders: Orders) -> bool:
    return all(_sum(weights, orders) >= floor for weights, floor in goal.floors)


def _adopt(progress: _Progress, goal: Goal, known: Knowledge, orders: Orders) -> None:
    """Make a plan the incumbent if it is better."""
    value = _value(goal, known.roads, orders)
    if value > progress.value and _keeps_floors(goal, orders):
        progress.orders, progress.value = orders, value


def _value(goal: Goal, roads: Sequence[Road], orders: Orders) -> float:
    value = _sum(goal.weights, orders)
    if goal.driving:
        for road, order in zip(roads, orders, strict=True):
            drive = quickest(road, order)
            if drive is None:
                raise ValueError("an infeasible plan has no value")
            value -= goal.driving * drive.time_s
    return value


def _sum(weights: FloatArray, orders: Orders) -> float:
    return math.fsum(weights[m, j] for m, order in enumerate(orders) for j in order)


def _drive(road: Road, order: tuple[int, ...]) -> tuple[int, ...]:
    drive = quickest(road, order)
    if drive is None:
        raise RuntimeError(f"no feasible route visits {order}")
    return drive.route


def _trivial_bound(goal: Goal) -> float:
    """Every POI visited by whoever earns most there."""
    if not len(goal.weights):
        return 0.0
    return float(np.maximum(goal.weights.max(axis=0), 0.0).sum())


def _grain(goal: Goal) -> float:
    """The greatest number of which every plan's value is a multiple; 0 where none is plain to see."""
    scaled = goal.weights * _DECIMALS
    whole = np.rint(scaled)
    if goal.driving or np.abs(scaled - whole).max(initial=0.0) > 1e-9 or np.abs(whole).max(initial=0.0) > 1e9:
        return 0.0
    return float(np.gcd.reduce(np.abs(whole).astype(np.int64), axis=None)) / _DECIMALS
