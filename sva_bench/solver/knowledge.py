"""The state of solves: limits, incumbent and bound, results, and what solves of one instance share."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray
from sva_bench.choices import Status
from sva_bench.interrupts import hear_ctrl_c
from sva_bench.mission.instance import Instance
from sva_bench.solver.goal import Goal
from sva_bench.solver.routes.fronts import LegTables, leg_tables
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.refuelling import VehicleLegs, quickest_route, vehicle_legs
from sva_bench.solver.routes.ways import ValuedRoute, best_way
from sva_bench.solver.units import common_unit

Routes = tuple[tuple[int, ...], ...]
"""Sites of each vehicle's route, from base to base; empty for one that stays home."""


@dataclass(frozen=True, kw_only=True)
class SolveLimits:
    """When a solve may stop.

    Attributes:
        time_limit_s: Wall-clock time for one plan [s]; ``None`` = none.
        gap: Gap, relative to the value, at which a plan counts as optimal.
        watch: Called as the search for a plan begins, with what it has found whenever that is looked at.
    """

    time_limit_s: float | None = None
    gap: float = 1e-6
    watch: Callable[[Watched], None] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.gap < 0 or (self.time_limit_s is not None and self.time_limit_s < 0):
            raise ValueError("limits can't be negative")

    def clock(self) -> Clock:
        """A clock that starts now."""
        now = time.monotonic()
        return Clock(started=now, deadline=math.inf if self.time_limit_s is None else now + self.time_limit_s)


@dataclass(frozen=True, kw_only=True)
class Clock:
    """Time used and time left, in ``time.monotonic``.

    Attributes:
        started, deadline: When it started, and when time is over.
        watch: Called as a solve begins, with its progress and the factor between its values and those asked for.
    """

    started: float
    deadline: float
    watch: Callable[[Progress, float], None] | None = None

    def left_s(self) -> float:
        """Time left [s]."""
        return max(self.deadline - time.monotonic(), 0.0)

    def used_s(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self.started

    def is_over(self) -> bool:
        """Whether the deadline has passed; raises ``KeyboardInterrupt`` if Ctrl-C was pressed."""
        hear_ctrl_c()
        return time.monotonic() >= self.deadline


@dataclass(frozen=True, kw_only=True, order=True)
class Cut:
    """A connectivity cut of one vehicle: ``y(out of S) >= y(into i)`` for a POI i in S.

    Attributes:
        vehicle: Number of the vehicle.
        inside: The sites of S, without the base, in order.
        poi: The POI i in S.
    """

    vehicle: int
    inside: tuple[int, ...]
    poi: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """The result of a solve.

    Attributes:
        routes: Sites of each vehicle's route.
        orders: POIs of each vehicle in order of visit.
        value: Objective value.
        bound: Upper bound on it.
        status: How the solve ended.
        nodes: Branch-and-bound nodes.
        cuts: Connectivity cuts in the last program.
        optimality_cuts: Cuts from the second stage, of the L-shaped method.
        rounds: Linear and integer programs solved.
        seconds: Wall-clock time of each phase [s].
        method: The method that proved it.
    """

    routes: Routes
    orders: VisitOrders
    value: float
    bound: float
    status: Status
    nodes: int
    cuts: int
    optimality_cuts: int
    rounds: int
    seconds: dict[str, float]
    method: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Knowledge:
    """What solves of one instance share: cuts, plans and solutions.

    Between the solves, what vehicles' reliability is made of may differ: availabilities, and the rest of it.

    Attributes:
        instance: The instance of the first solve.
        legs_by_vehicle: Legs of each vehicle.
        tables: The same as arrays, for compiled code.
        cuts: Connectivity cuts, valid for any goal, in order of discovery.
        orders: Feasible plans, in order of discovery.
        solutions: Proved solutions by what defines their goal.
    """

    instance: Instance
    legs_by_vehicle: tuple[VehicleLegs, ...]
    tables: LegTables
    cuts: dict[Cut, None] = field(default_factory=dict)
    orders: dict[VisitOrders, None] = field(default_factory=dict)
    solutions: dict[tuple[object, ...], Solution] = field(default_factory=dict)

    def check(self, instance: Instance) -> None:
        """Refuse an instance that differs in more than its availabilities.

        Raises:
            ValueError: If it does.
        """
        first = self.instance
        same = (first.sites, first.base, first.stations) == (instance.sites, instance.base, instance.stations) \
            and np.array_equal(first.stop_s, instance.stop_s) and np.array_equal(first.charging, instance.charging) \
            and len(first.vehicles) == len(instance.vehicles) \
            and all(
                (a.name, a.fuel_capacity_s, a.mission_limit_s, a.idle_share)
                == (b.name, b.fuel_capacity_s, b.mission_limit_s, b.idle_share)
                and np.array_equal(a.fuel_s, b.fuel_s) and np.array_equal(a.leg_time_s, b.leg_time_s)
                and np.array_equal(a.incentives, b.incentives)
                for a, b in zip(first.vehicles, instance.vehicles, strict=True))
        if not same:
            raise ValueError(f"what is known of instance {first.name!r} doesn't hold for {instance.name!r}: "
                             "they differ in more than their availabilities")


def knowledge_of(instance: Instance) -> Knowledge:
    """The knowledge of an instance before its first solve."""
    return Knowledge(instance=instance, legs_by_vehicle=tuple(vehicle_legs(instance, v) for v in instance.vehicles),
                     tables=leg_tables(instance))


@dataclass(eq=False, kw_only=True)
class Progress:
    """The incumbent, its bound and counters of a running solve; kept when Ctrl-C ends it.

    Attributes:
        orders: POIs of each vehicle, of the best plan so far.
        value: Its objective value.
        bound: Upper bound on the objective.
        status: How the solve ended, so far.
        nodes: Branch-and-bound nodes.
        cuts: Connectivity cuts in the last program.
        optimality_cuts: Cuts from the second stage, of the L-shaped method.
        rounds: Linear and integer programs solved.
        seconds: Wall-clock time of each phase [s].
        grain: Every plan's value is a multiple of it; 0 = unknown.
        rounding: Difference up to which a bound and a value are the same.
        constants: Parts of every plan's value that are left out here, by two ways to count them; a relative gap is that
            of the smaller value.
    """

    orders: VisitOrders
    value: float
    bound: float
    status: Status = "feasible"
    nodes: int = 0
    cuts: int = 0
    optimality_cuts: int = 0
    rounds: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    grain: float = 0.0
    rounding: float = 0.0
    constants: tuple[float, ...] = (0.0,)

    def tighten(self, bound: float) -> None:
        """Lower the bound, rounded down to a multiple of the grain."""
        if self.grain and math.isfinite(bound):
            bound = math.floor((bound + self.rounding) / self.grain + 1e-6) * self.grain
        self.bound = min(self.bound, bound)

    def closed(self, gap: float) -> bool:
        """Whether the incumbent is proved within a relative gap."""
        return self.bound - self.value <= max(gap * self._size(), self.rounding)

    def _size(self) -> float:
        """What a gap is relative to."""
        return min(abs(self.value + constant) for constant in self.constants)

    def slack(self, gap: float) -> float:
        """Least improvement over the incumbent that matters: beyond the gap, the grain and rounding."""
        return max(gap * self._size(), (1 - 1e-5) * self.grain - 2 * self.rounding,
                   self.rounding / 2)


@dataclass(frozen=True, eq=False, kw_only=True)
class Watched:
    """What the search for a plan has found by now, in the units of its instance.

    Attributes:
        objective: What it maximises.
    """

    objective: str
    _progress: Progress
    _unit: float

    @property
    def value(self) -> float:
        """Value of the best plan."""
        return (self._progress.value + self._progress.constants[0]) * self._unit

    @property
    def bound(self) -> float:
        """Upper bound on the value of any plan."""
        return (self._progress.bound + self._progress.constants[0]) * self._unit

    @property
    def nodes(self) -> int:
        """Branch-and-bound nodes."""
        return self._progress.nodes


def best_known(goal: Goal, known: Knowledge) -> VisitOrders | None:
    """The best of the known plans under a goal; ``None`` if none keeps the floors.

    Stops that earn nothing are left out, and routes whose risk costs more than they earn.
    """
    rewarded = goal.rewarded()
    all_at_base: VisitOrders = tuple(() for _ in known.legs_by_vehicle)
    candidates = [
        without_losses(goal, known.legs_by_vehicle, tuple(
            without_idle_stops(own_legs, order, rewarded[m])
            for m, (own_legs, order) in enumerate(zip(known.legs_by_vehicle, orders, strict=True))))
        for orders in (*known.orders, all_at_base)]
    kept = [orders for orders in candidates if _keeps_floors(goal, orders)]
    return max(kept, key=lambda orders: value_of(goal, known.legs_by_vehicle, orders)) if kept else None


def without_idle_stops(own_legs: VehicleLegs, order: tuple[int, ...], rewarded: BoolArray) -> tuple[int, ...]:
    """The order without POIs of no reward, but for those without which the route would be infeasible."""
    if not any(rewarded[j] for j in order):
        return ()
    for poi in order:
        shorter = tuple(j for j in order if j != poi)
        if not rewarded[poi] and quickest_route(own_legs, shorter) is not None:
            order = shorter
    return order


def without_losses(goal: Goal, legs_by_vehicle: Sequence[VehicleLegs], orders: VisitOrders) -> VisitOrders:
    """The plan without the routes that are worth less than staying at the base."""
    if goal.discounts is None:
        return orders
    return tuple(order if _way(goal, m, legs_by_vehicle[m], order).value > 0 else () for m, order in enumerate(orders))


def _keeps_floors(goal: Goal, orders: VisitOrders) -> bool:
    return goal.risk is not None or all(_sum(weights, orders) >= floor for weights, floor in goal.floors)


def adopt(progress: Progress, goal: Goal, known: Knowledge, orders: VisitOrders) -> None:
    """Make a plan the incumbent if it is better."""
    orders = without_losses(goal, known.legs_by_vehicle, orders)
    value = value_of(goal, known.legs_by_vehicle, orders)
    if value > progress.value and _keeps_floors(goal, orders):
        progress.orders, progress.value = orders, value


def value_of(goal: Goal, legs_by_vehicle: Sequence[VehicleLegs], orders: VisitOrders) -> float:
    """Value of a feasible plan under a goal.

    Raises:
        ValueError: If the plan is infeasible, and its driving times matter.
    """
    if goal.discounts is not None:
        return math.fsum(_way(goal, m, own_legs, order).value
                         for m, (own_legs, order) in enumerate(zip(legs_by_vehicle, orders, strict=True)))
    value = _sum(goal.weights, orders)
    if goal.risk is not None:
        earned = goal.risk.outcomes.incentives
        sums = np.array([math.fsum(earned[m, j] for j in order) for m, order in enumerate(orders)])
        value += goal.risk.measure.weight * goal.risk.of(sums)
    if goal.driving:
        for own_legs, order in zip(legs_by_vehicle, orders, strict=True):
            found = quickest_route(own_legs, order)
            if found is None:
                raise ValueError("an infeasible plan has no value")
            value -= goal.driving * found.time_s
    return value


def _sum(weights: FloatArray, orders: VisitOrders) -> float:
    return math.fsum(weights[m, j] for m, order in enumerate(orders) for j in order)


def _way(goal: Goal, vehicle: int, own_legs: VehicleLegs, order: tuple[int, ...]) -> ValuedRoute:
    found = best_way(own_legs, order, [float(goal.weights[vehicle, j]) for j in order], goal.discount(vehicle))
    if found is None:
        raise ValueError(f"no feasible route visits {order}")
    return found


def routes_of(goal: Goal, legs_by_vehicle: Sequence[VehicleLegs], orders: VisitOrders) -> Routes:
    """The most valuable route of each vehicle over its POIs in order, of several the quickest.

    Raises:
        ValueError: If an order is infeasible.
    """
    return tuple(_way(goal, m, own_legs, order).route
                 for m, (own_legs, order) in enumerate(zip(legs_by_vehicle, orders, strict=True)))


def route_over(own_legs: VehicleLegs, order: tuple[int, ...]) -> tuple[int, ...]:
    """Sites of the quickest route over POIs in this order, from base to base.

    Raises:
        RuntimeError: If the order is infeasible.
    """
    found = quickest_route(own_legs, order)
    if found is None:
        raise RuntimeError(f"no feasible route visits {order}")
    return found.route


def trivial_bound(goal: Goal) -> float:
    """Upper bound on a goal: every POI visited by the vehicle that earns most there, at no cost."""
    if not len(goal.weights):
        return 0.0
    earned = goal.weights if goal.arrival is None else goal.weights * goal.arrival
    bound = float(np.maximum(earned.max(axis=0), 0.0).sum())
    if goal.risk is not None and goal.risk.measure.kind == "cvar":
        bound += float(goal.risk.rates().max(axis=0).sum())
    return bound


def grain_of(goal: Goal) -> float:
    """The greatest number of which every plan's value is a multiple; 0 where none is known."""
    if goal.driving or goal.discounts is not None or goal.risk is not None:
        return 0.0
    return common_unit(goal.weights.ravel())
