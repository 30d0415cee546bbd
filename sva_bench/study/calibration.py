"""Calibrated plans: costs raised until missions go wrong as seldom as was asked for, or until they are worth most.

Plans are chosen under one set of noise draws and reported under another: the best of many on the draws that it was
chosen by would look better than it is.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from sva_bench.analysis.calibration import (
    Calibration,
    PlanJudged,
    Target,
    Tried,
    draws_for,
)
from sva_bench.analysis.proof import most_bad, proves, share_of
from sva_bench.arrays import FloatArray
from sva_bench.execution.twin_draws import TwinDraws, as_planned
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.plan import Plan, unless_interrupted
from sva_bench.solver.two_stage import Knowledge, SolveLimits, knowledge_of, plan_stochastic
from sva_bench.travel.fuel import FuelCosts
from sva_bench.travel.leg_costs import MEDIAN, NOMINAL_RUNG, LegCosts, LegSamples, Rung, costs_at, typical_excess
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import Scenario, World

_log = logging.getLogger(__name__)

QUANTILES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995)
_FACTORS = (1.05, 1.1, 1.15, 1.2, 1.3, 1.4, 1.5, 1.75, 2.0, 2.5, 3.0)
_BEYOND = 1.02  # a factor on the median is tried where it goes beyond the last quantile by so much
_LEG_DRAWS = 100  # by which costs are made; what plans of these costs come to is judged on others
_STEPS = (50, 100, 200, 400, 700)  # draws after which a plan that certainly fails is left
_FOR_COSTS, _FOR_CHOICE, _FOR_REPORT = 0, 1, 2
"""Sets of noise draws; each plan that is reported has the next one from the third on."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibrated:
    """A scenario's calibrated plan.

    Attributes:
        plan: The plan, chosen of ``result.curve``.
        instance: What it was made for.
        result: What it comes to.
        proved: Whether all plans of the curve are proved optimal.
    """

    plan: Plan
    instance: Instance
    result: Calibration
    proved: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class _Made:
    """A plan of the curve, before it is chosen or not."""

    rung: Rung
    plan: Plan
    instance: Instance


@dataclass(frozen=True, eq=False, kw_only=True)
class _Judging:
    """How plans of a world are judged.

    Attributes:
        world, costs: The world and its fuel costs.
        target: What is asked for.
        draws: Noise draws of each plan, as far as it is not left before.
        executor: Where drives run.
        sets: Sets of noise draws by their numbers; all scenarios share them, and so the drives of equal routes.
    """

    world: World
    costs: Mapping[str, FuelCosts]
    target: Target
    draws: int
    executor: Executor | None
    sets: dict[int, TwinDraws]

    def drive(self, number: int, scenario: Scenario, plan: Plan, draws: int) -> tuple[int, FloatArray]:
        """Number of bad draws of a set, and the value under each."""
        if number not in self.sets:
            self.sets[number] = TwinDraws(self.world, self.costs, number, self.executor)
        bad, value = self.sets[number].judge(scenario, plan, draws)
        return int(bad.sum()), value

    def tried(self, scenario: Scenario, made: _Made) -> Tried:
        """A plan on the draws of the choice; it is left as soon as it has too many bad ones to prove the share."""
        allowed = self.draws if self.target == "best" else most_bad(self.draws, self.target)
        for draws in (*(step for step in _STEPS if step < self.draws), self.draws):
            bad, value = self.drive(_FOR_CHOICE, scenario, made.plan, draws)
            if bad > allowed:
                break
        judged = self._judged(made.plan, bad, value)
        return Tried(**vars(judged), quantile=made.rung.quantile, factor=made.rung.factor, draws=draws)

    def reported(self, number: int, scenario: Scenario, plan: Plan) -> PlanJudged:
        """A plan on draws that it was not chosen by."""
        return self._judged(plan, *self.drive(number, scenario, plan, self.draws))

    def _judged(self, plan: Plan, bad: int, value: FloatArray) -> PlanJudged:
        return PlanJudged(promised=plan.value or 0.0, executed=float(np.mean(value)) + 0.0,
                          bad=share_of(bad, len(value), varies=self.world.noisy))


@dataclass(eq=False, kw_only=True)
class _Ladder:
    """The rungs of a world, and the plans made on them.

    Attributes:
        world, limits: The world, and when solves may stop.
        rungs: From the nominal costs up.
        costs: Costs of each robot on each rung; of none on the first.
        known: What solves on each rung found, which scenarios share.
    """

    world: World
    limits: SolveLimits
    rungs: Sequence[Rung]
    costs: Sequence[Mapping[str, LegCosts]]
    known: dict[int, Knowledge]

    def plan(self, number: int, nominal: Plan, instance: Instance) -> _Made:
        """The stochastic plan of a scenario on a rung.

        Args:
            number: Of the rung.
            nominal: The scenario's plan for nominal costs.
            instance: What that was made for.
        """
        rung = self.rungs[number]
        if rung == NOMINAL_RUNG:
            return _Made(rung=rung, plan=nominal, instance=instance)
        dearer = replace(instance, vehicles=tuple(
            _dearer(vehicle, self.costs[number][vehicle.name]) for vehicle in instance.vehicles))
        if number not in self.known:
            self.known[number] = knowledge_of(dearer)
        plan = unless_interrupted(plan_stochastic(dearer, self.limits, known=self.known[number]))
        told = {"quantile": rung.quantile, "factor": rung.factor}
        return _Made(rung=rung, plan=replace(plan, details={**plan.details, "calibrated": told}), instance=dearer)


def calibrate(
    world: World, costs: Mapping[str, FuelCosts], plans: Mapping[str, tuple[Plan, Instance]], target: Target,
    limits: SolveLimits, executor: Executor | None, progress: OnProgress,
) -> dict[str, Calibrated]:
    """The calibrated plan of each scenario. It doesn't depend on any seed.

    Args:
        world, costs: The world and its fuel costs.
        plans: The stochastic plan for nominal costs and what it was made for, by scenario.
        target: The share of bad missions asked for, or the greatest value.
        limits: When each solve may stop.
        executor: Where drives run; ``None`` = here.
        progress: Called as costs and plans are made.

    Raises:
        KeyboardInterrupt: On Ctrl-C.
    """
    ladder = _ladder_of(world, costs, target, limits, executor, progress)
    judging = _Judging(world=world, costs=costs, target=target, executor=executor, sets={},
                       draws=draws_for(target) if world.noisy else 1)
    found = {}
    for number, scenario in enumerate(world.scenarios):
        progress("calibrating", number, len(world.scenarios))
        nominal, instance = plans[scenario.name]
        found[scenario.name] = _calibrated(scenario, nominal, instance, ladder, judging)
        progress("calibrating", number + 1, len(world.scenarios))
    return found


def _ladder_of(
    world: World, costs: Mapping[str, FuelCosts], target: Target, limits: SolveLimits, executor: Executor | None,
    progress: OnProgress,
) -> _Ladder:
    """The nominal costs; then quantiles; and for a share, or where robots meet, factors on the median beyond them."""
    if as_planned(world):
        return _Ladder(world=world, limits=limits, rungs=[NOMINAL_RUNG], costs=[{}], known={})
    draws = TwinDraws(world, costs, _FOR_COSTS, executor)
    first = {world.kind_of(robot): robot.name for robot in reversed(world.robots)}
    samples: dict[str, LegSamples] = {}
    for number, (kind, robot) in enumerate(first.items()):
        progress("sampling legs", number, len(first))
        samples[kind] = draws.legs(robot, tuple(site.name for site in world.sites),
                                    _LEG_DRAWS if world.noisy else 1)
        progress("sampling legs", number + 1, len(first))
    # Where robots meet and nothing is drawn, all quantiles are one.
    rungs = [Rung(quantile=quantile) for quantile in (QUANTILES if world.noisy or not world.meets else (MEDIAN,))]
    if target != "best" or world.meets:  # no leg by itself tells of waits for others
        beyond = _BEYOND * max(typical_excess(each, QUANTILES[-1]) for each in samples.values())
        rungs += [Rung(quantile=MEDIAN, factor=factor) for factor in _FACTORS if factor > beyond]
    return _Ladder(
        world=world, limits=limits, rungs=[NOMINAL_RUNG, *rungs], known={},
        costs=[{}, *({robot.name: costs_at(samples[world.kind_of(robot)], rung, world.margin, robot.idle_share)
                      for robot in world.robots} for rung in rungs)])


def _dearer(vehicle: Vehicle, costs: LegCosts) -> Vehicle:
    """A vehicle at other costs; with a clock of its own only where it has one."""
    time_s = None if np.array_equal(costs.time_s, costs.fuel_s) else costs.time_s
    return replace(vehicle, fuel_s=costs.fuel_s, time_s=time_s)


def _calibrated(
    scenario: Scenario, nominal: Plan, instance: Instance, ladder: _Ladder, judging: _Judging
) -> Calibrated:
    """Climb the ladder until a plan proves the share, or to its end."""
    target = judging.target
    made: list[_Made] = []
    curve: list[Tried] = []
    chosen: tuple[int, PlanJudged] | None = None
    fresh = count(_FOR_REPORT)
    used = _FOR_REPORT
    for number in range(len(ladder.rungs)):
        made.append(ladder.plan(number, nominal, instance))
        same = next((k for k, other in enumerate(made[:-1]) if other.plan.drives_like(made[-1].plan)), None)
        curve.append(judging.tried(scenario, made[-1]) if same is None else replace(
            curve[same], quantile=made[-1].rung.quantile, factor=made[-1].rung.factor,
            promised=made[-1].plan.value or 0.0))
        if number and not any(made[-1].plan.routes.values()):
            break  # nobody leaves the base, nor will anybody at greater costs
        if target == "best" or same is not None or not proves(curve[-1].bad, target):
            continue
        used = next(fresh)
        found = judging.reported(used, scenario, made[-1].plan)
        if proves(found.bad, target):
            chosen = number, found
            break
    if chosen is None:
        best = _best_of(curve, target)
        chosen = best, judging.reported(used, scenario, made[best].plan)
    number, found = chosen
    return _result(target, made, curve, number, found, judging.reported(used, scenario, nominal), judging)


def _best_of(curve: Sequence[Tried], target: Target) -> int:
    """Of equals the first: the plan of greatest executed value, or that which goes wrong most seldom."""
    if target == "best":
        return max(range(len(curve)), key=lambda k: (curve[k].executed, -k))
    leaving = [k for k, tried in enumerate(curve) if not tried.nobody_leaves] or [0]
    return min(leaving, key=lambda k: (curve[k].bad.share, -curve[k].executed, k))


def _result(
    target: Target, made: Sequence[_Made], curve: Sequence[Tried], number: int, found: PlanJudged, nominal: PlanJudged,
    judging: _Judging,
) -> Calibrated:
    plan, rung = made[number].plan, made[number].rung
    share = None if isinstance(target, str) else target
    result = Calibration(
        share=share, quantile=rung.quantile, factor=rung.factor, **vars(found), nominal=nominal, curve=tuple(curve),
        reached=share is None or proves(found.bad, share), draws=judging.draws)
    return Calibrated(plan=plan, instance=made[number].instance, result=result,
                      proved=all(each.plan.status == "optimal" for each in made))
