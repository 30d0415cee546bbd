"""The L-shaped method: the first stage with a variable for the cost of the second, under optimality cuts.

A cut ``eta >= sum_ij c_ij y_ij`` holds for any feasible duals ``pi, pi2`` of an outcome's recourse program, with
``-c_ij = (1 - alpha_m) f_ij pi_i + pi2_ij``. ``single`` adds them up over the outcomes, as in the paper, ``multi``
keeps one variable for each outcome, and ``pareto`` takes, in place of the solver's duals, nondominated ones:
``pi_i = -max_j e_j / f_ij`` where the vehicle is unavailable, 0 where it is available.

Source:
    Section 4 of the paper; Van Slyke, Wets (1969); Magnanti, Wong (1981) on Pareto-optimal cuts.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.choices import Cuts
from sva_bench.mission.instance import Instance
from sva_bench.solver.flow.cuts import violated_by_integers
from sva_bench.solver.flow.expected import DirectedModel
from sva_bench.solver.flow.recourse import legs_out_of_pois, stacked
from sva_bench.solver.goal import Goal
from sva_bench.solver.highs import Relaxation, maximise
from sva_bench.solver.knowledge import Knowledge, adopt, without_idle_stops
from sva_bench.solver.outcomes import Outcomes
from sva_bench.solver.preprocess import Scope
from sva_bench.solver.problem import Problem
from sva_bench.solver.program import LinearModel, RowBuilder, Rows
from sva_bench.solver.routes.heuristic import VisitOrders
from sva_bench.solver.units import LARGEST

_log = logging.getLogger(__name__)

_TOLERANCE = 1e-9  # relative violation below which a cut is not added


def prove_by_lshaped(problem: Problem) -> None:
    """Prove the plan of ``problem.progress``, or a better one, within the gap, by the L-shaped method."""
    instance, goal, known, progress = problem.instance, problem.goal, problem.known, problem.progress
    clock, gap = problem.clock, problem.gap
    master = _Master(instance, problem.scopes, goal, known, problem.second_stage, problem.cuts)
    pois = frozenset(instance.pois)
    subtours = list(known.cuts)
    iteration = 0
    while not progress.closed(gap):
        if clock.is_over():
            progress.status = "time_limit"
            return
        iteration += 1
        outcome = maximise(master.model, stacked(master.rows(subtours), master.optimality_rows()), gap=gap / 2,
                           absolute_gap=progress.slack(gap / 2), time_limit_s=clock.left_s(),
                           start=master.point(progress.orders))
        progress.rounds += 1
        progress.nodes += outcome.nodes
        progress.tighten(progress.value if outcome.status == "infeasible" else outcome.bound)
        if outcome.values is not None:
            orders, violated = [], []
            for m, rewarded in enumerate(goal.rewarded()):
                violated += violated_by_integers(master.visits(outcome.values, m), m, instance.base, pois)
                orders.append(without_idle_stops(known.legs_by_vehicle[m], master.order(outcome.values, m), rewarded))
            adopt(progress, goal, known, tuple(orders))
            new = [replace(cut, vehicle=m) for cut in violated for m in range(len(instance.vehicles))]
            subtours = list(dict.fromkeys([*subtours, *new]))
            added = master.cut(outcome.values)
            progress.cuts, progress.optimality_cuts = len(subtours), len(master.optimality)
            _log.info("iteration %d: bound %.6g, value %.6g, %d optimality cuts, %d subtour cuts", iteration,
                      progress.bound, progress.value, progress.optimality_cuts, progress.cuts)
        if outcome.status in ("time_limit", "interrupted"):
            progress.status = outcome.status
            return
        if outcome.values is None or not (violated or added):
            return


class _Master(DirectedModel):
    """First stage, and ``eta``: the cost of the second, by outcome or in all."""

    def __init__(
        self, instance: Instance, scopes: Sequence[Scope], goal: Goal, known: Knowledge, recourse: Outcomes, kind: Cuts,
    ) -> None:
        super().__init__(instance, scopes, replace(goal, weights=recourse.incentives), known.legs_by_vehicle)
        self._recourse, self._kind = recourse, kind
        self._first = self.model
        outcomes = len(recourse.probability)
        etas = 1 if kind == "single" else outcomes
        cost = -np.ones(1) if etas == 1 else -recourse.probability
        self.model = LinearModel(
            objective=np.concatenate([self._first.objective, cost]),
            upper=np.concatenate([self._first.upper, np.full(etas, np.inf)]),
            integer=np.concatenate([self._first.integer, np.zeros(etas, dtype=np.bool_)]), rows=self._first.rows,
            aggregates=self._first.aggregates)
        legs = self.legs
        self._earned = recourse.incentives[legs.vehicle, legs.destination]
        self._lost = 1.0 - recourse.available[:, legs.vehicle]
        self._groups = legs_out_of_pois(self, instance, scopes)
        self._onward = np.isin(legs.origin, instance.pois)
        self.optimality: list[tuple[int, FloatArray]] = []  # number of eta, coefficients of y
        self._duals = [] if kind == "pareto" else [Relaxation(self._second()) for _ in range(outcomes)]

    def _second(self) -> LinearModel:
        """The recourse program, its bounds not yet set: rows (14), then a row of (11a) or (15a) for each leg."""
        build, count = RowBuilder(), len(self.legs.vehicle)
        for costs, used in self._groups:
            build.add(used, costs, 0.0, 0.0)
        for k in range(count):
            build.add([k], [1.0], -np.inf, 0.0)
        return LinearModel(objective=-self._earned, upper=np.full(count, np.inf),
                           integer=np.zeros(count, dtype=np.bool_), rows=build.rows())

    def optimality_rows(self) -> Rows:
        """The optimality cuts so far as rows."""
        build, first = RowBuilder(), len(self._first.objective)
        for eta, lost in self.optimality:
            used = np.flatnonzero(lost)
            build.add([first + eta, *used], [1.0, *(-lost[used])], 0.0, np.inf)
        return build.rows()

    def point(self, orders: VisitOrders) -> FloatArray | None:
        """A plan as a point, ``eta`` at the least value that the optimality cuts allow."""
        first = super().point(orders)
        if first is None:
            return None
        eta = np.zeros(len(self.model.objective) - len(first))
        for number, lost in self.optimality:
            eta[number] = max(eta[number], float(lost @ first[:len(lost)]))
        return np.concatenate([first, eta])

    def cut(self, values: FloatArray) -> int:
        """Add the optimality cuts that a first-stage solution violates; how many."""
        driven = np.rint(values[:len(self.legs.vehicle)])
        eta = values[len(self._first.objective):]
        found = [self._coefficients(outcome, driven) for outcome in range(len(self._recourse.probability))]
        if self._kind == "single":
            found = [np.einsum("o,ok->k", self._recourse.probability, np.array(found))]
        violated = [(number, lost) for number, lost in enumerate(found)
                  if float(lost @ driven) > eta[number] + _TOLERANCE * max(LARGEST, abs(float(eta[number])))]
        self.optimality += violated
        return len(violated)

    def _coefficients(self, outcome: int, driven: FloatArray) -> FloatArray:
        """Coefficients of an outcome's optimality cut, from the duals of its recourse program, shape (legs,)."""
        lost = self._lost[outcome]
        if self._kind == "pareto":
            dual = np.zeros(len(lost))
            for costs, used in self._groups:
                if lost[used[0]]:
                    dual[used] = -float(np.max(self._earned[used] / costs)) * costs
            rest = np.where(self._onward, np.maximum(-self._earned - dual, 0.0), 0.0)
            return self._by_origin(-(lost * dual + rest), lost * self._earned)
        program = self._duals[outcome]
        rows = np.concatenate([[lost[used[0]] * float(costs @ driven[used]) for costs, used in self._groups],
                               np.where(self._onward, driven, lost * driven)])
        lower = np.concatenate([rows[:len(self._groups)], np.where(self._onward, -np.inf, lost * driven)])
        program.set_row_bounds(lower, rows)
        solved = program.solve(np.inf)
        if solved.values is None:
            raise RuntimeError(f"the recourse program of outcome {outcome} is {solved.status}")
        dual = np.zeros(len(lost))
        for number, (costs, used) in enumerate(self._groups):
            dual[used] = solved.duals[number] * costs
        rest = solved.duals[len(self._groups):]
        return self._by_origin(-(lost * dual + rest), -lost * rest)

    def _by_origin(self, onward: FloatArray, refuelled: FloatArray) -> FloatArray:
        """One coefficient for legs out of POIs, another for legs out of the base and stations, shape (legs,)."""
        found: FloatArray = np.where(self._onward, onward, refuelled)
        return found
