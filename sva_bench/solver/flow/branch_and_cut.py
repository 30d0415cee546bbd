"""Branch and cut: cuts at the root, then branch and bound, repeated with the cuts that its solution violates.

HiGHS takes no lazy constraints, so each integer solution that isn't connected costs another run.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.flow.cuts import violated_by_fractions, violated_by_integers
from sva_bench.solver.highs import Relaxation, maximise
from sva_bench.solver.knowledge import Cut, adopt, without_idle_stops
from sva_bench.solver.problem import Problem
from sva_bench.solver.program import LinearModel, MipResult, Rows
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.routes.refuelling import quickest_route
from sva_bench.solver.units import LARGEST

_log = logging.getLogger(__name__)

ROOT_ROUNDS = 60
_STALL = 1e-4  # relative gain of the bound below which a round counts as idle
_IDLE_ROUNDS = 4
_FIXING = 1e-6  # relative; columns are dropped only if they are worse by more
_INTEGERS = 1e4  # largest integer coefficient of an objective; beyond it HiGHS's rounding of bounds gains nothing


class FlowModel(Protocol):
    """A linear model of routes, without the connectivity cuts."""

    model: LinearModel

    def rows(self, cuts: Sequence[Cut]) -> Rows:
        """The cuts as rows over the model's columns."""

    def visits(self, values: FloatArray, vehicle: int) -> FloatArray:
        """How often a vehicle drives each leg in a point of the model, shape (n, n)."""

    def order(self, values: FloatArray, vehicle: int) -> tuple[int, ...]:
        """POIs of a vehicle's route in an integer point, of the component that holds the base."""

    def point(self, orders: VisitOrders) -> FloatArray | None:
        """A plan as a point of the model; ``None`` where it uses a leg that the model leaves out."""


def prove_by_cuts(flow: FlowModel, problem: Problem) -> None:
    """Prove the plan of ``problem.progress``, or a better one, within the gap, by branch and cut.

    Args:
        flow: A model of the problem.
        problem: The problem.
    """
    progress, clock = problem.progress, problem.clock
    largest = float(np.abs(flow.model.objective).max(initial=0.0))
    # Multiples of one number become integers, if not too large: HiGHS then rounds its bounds.
    size = progress.grain if 0 < largest <= _INTEGERS * progress.grain else largest / LARGEST or 1.0
    model = replace(flow.model, objective=flow.model.objective / size)
    began = clock.used_s()
    cuts, model = _root(flow, problem, model, size)
    progress.seconds["root"] = clock.used_s() - began
    began = clock.used_s()
    _branch(flow, problem, model, size, cuts)
    progress.seconds["branch"] = clock.used_s() - began


def _root(
    flow: FlowModel, problem: Problem, model: LinearModel, size: float,
) -> tuple[list[Cut], LinearModel]:
    """Tighten the relaxation by cuts: those that are tight in the end, and the model with columns fixed at 0.

    Lowers the bound of ``problem.progress``. Columns are fixed by their reduced costs.
    """
    progress, clock = problem.progress, problem.clock
    cuts = list(problem.known.cuts)
    relaxation = Relaxation(model)
    relaxation.add(flow.rows(cuts))
    present, idle, last = set(cuts), 0, math.inf
    activity: FloatArray = np.zeros(0)
    upper = model.upper.copy()
    for _ in range(ROOT_ROUNDS):
        if clock.is_over() or progress.closed(problem.gap):
            break
        relaxed = relaxation.solve(clock.left_s())
        progress.rounds += 1
        if relaxed.status == "infeasible":
            progress.bound = progress.value
            break
        if relaxed.values is None:
            break
        activity = relaxed.activity
        progress.tighten(relaxed.objective * size)
        # Reduced-cost fixing: such a column is in no better plan. Only integer columns are fixed.
        least = progress.value - _FIXING * max(abs(progress.value), LARGEST)
        worse = (relaxed.objective + relaxed.reduced) * size < least
        upper[model.integer & worse] = 0.0
        idle = idle + 1 if last - relaxed.objective < _STALL * max(abs(relaxed.objective), 1e-9) else 0
        last = relaxed.objective
        new = [cut for cut in _separate(flow, problem.instance, relaxed.values) if cut not in present]
        if not new or idle >= _IDLE_ROUNDS:
            break
        relaxation.add(flow.rows(new))
        cuts += new
        present.update(new)
    slack = activity[len(model.rows.lower):]
    tight = [cut for cut, room in zip(cuts, slack, strict=False) if room < 1e-6]
    problem.known.cuts.update(dict.fromkeys(tight))
    _log.debug("root: bound %.6g, value %.6g, %d of %d cuts kept, %d of %d columns", progress.bound, progress.value,
               len(tight), len(cuts), int((upper > 0).sum()), len(upper))
    return tight, replace(model, upper=upper)


def _branch(flow: FlowModel, problem: Problem, model: LinearModel, size: float, cuts: list[Cut]) -> None:
    """Branch and bound, repeated with the cuts that its solution violates."""
    progress, clock, gap = problem.progress, problem.clock, problem.gap
    while not progress.closed(gap):
        if clock.is_over():
            progress.status = "time_limit"
            return
        progress.cuts = len(cuts)
        outcome = maximise(
            model, flow.rows(cuts), gap=gap / 2, absolute_gap=progress.slack(gap / 2) / size,
            time_limit_s=clock.left_s(), start=flow.point(progress.orders))
        progress.rounds += 1
        progress.nodes += outcome.nodes
        progress.tighten(progress.value if outcome.status == "infeasible" else outcome.bound * size)
        violated = _integers(flow, problem, outcome)
        if outcome.status in ("time_limit", "interrupted"):
            progress.status = outcome.status
            return
        if not violated:
            return
        new = [replace(cut, vehicle=m) for cut in violated for m in range(len(problem.instance.vehicles))]
        cuts = list(dict.fromkeys([*cuts, *new]))
        problem.known.cuts.update(dict.fromkeys(new))
        _log.debug("branch: bound %.6g, value %.6g, %d cuts violated", progress.bound, progress.value, len(violated))


def _integers(flow: FlowModel, problem: Problem, outcome: MipResult) -> list[Cut]:
    """Adopt an integer solution's routes, of the base's component; the cuts that it violates."""
    if outcome.values is None:
        return []
    instance, goal, known = problem.instance, problem.goal, problem.known
    pois = frozenset(instance.pois)
    violated: list[Cut] = []
    orders, driven = [], []
    for m, own_legs in enumerate(known.legs_by_vehicle):
        violated += violated_by_integers(flow.visits(outcome.values, m), m, instance.base, pois)
        order = flow.order(outcome.values, m)
        if quickest_route(own_legs, order) is None:
            raise RuntimeError(f"the solver's route of {instance.vehicles[m].name} exceeds its fuel or limit")
        orders.append(without_idle_stops(own_legs, order, goal.rewarded()[m]))
        driven.append(order)
    adopt(problem.progress, goal, known, tuple(orders))
    if goal.driving:  # without the triangle inequality a stop without reward may be a shortcut
        adopt(problem.progress, goal, known, tuple(driven))
    return violated


def _separate(flow: FlowModel, instance: Instance, values: FloatArray) -> list[Cut]:
    pois = frozenset(instance.pois)
    return [cut for m in range(len(instance.vehicles))
            for cut in violated_by_fractions(flow.visits(values, m), m, instance.base, pois)]
