"""The plans of a world's scenarios, and checks of given plans."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sva_bench.choices import FailureProcess, OwnPlan
from sva_bench.errors import BadInput
from sva_bench.execution.case import Case
from sva_bench.execution.executed import Executed
from sva_bench.mission.certify import certify, expected_value
from sva_bench.mission.failures import MODEL, PROCESSES, undefined_under, without_joint
from sva_bench.mission.instance import Instance
from sva_bench.mission.plan import Plan, unless_interrupted
from sva_bench.solver.outcomes import possible
from sva_bench.solver.two_stage import (
    MOST_SUBSETS,
    Knowledge,
    SolveLimits,
    knowledge_of,
    plan_deterministic,
    plan_nominal,
    plan_stochastic,
    wait_and_see,
)
from sva_bench.study.calibration import Calibrated, calibrate
from sva_bench.study.costs import instance_of, nominal_scenario
from sva_bench.study.given_plans import InfeasiblePlan
from sva_bench.study.options import Options
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import Scenario, World

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, kw_only=True)
class InformedPlans:
    """The perfect-information plans of a scenario.

    Attributes:
        plans: The plan for each set of available robots.
        expected: Their expected value: the wait-and-see value.
        bound: Upper bound on it.
    """

    plans: Mapping[frozenset[str], Plan]
    expected: float
    bound: float

    def promised(self, executed: Executed) -> Executed:
        """The informed planner's trials, with the expected value and bound of all its plans as promise."""
        stopped = [plan.status for plan in self.plans.values() if plan.status != "optimal"]
        together = replace(executed.case.plan, value=self.expected, bound=self.bound,
                           status=stopped[0] if stopped else "optimal")
        return replace(executed, case=replace(executed.case, plan=together))


@dataclass(frozen=True, eq=False, kw_only=True)
class PlansByProcess:
    """The plans of a scenario for each failure process.

    Attributes:
        instance: What they were made for.
        stochastic: The best plan under each failure process.
        deterministic: The deterministic plan.
    """

    instance: Instance
    stochastic: Mapping[FailureProcess, Plan]
    deterministic: Plan


@dataclass(frozen=True, eq=False, kw_only=True)
class Planned:
    """Both plans of a scenario, with modelled values.

    Attributes:
        instance: What they were made for.
        stochastic, deterministic: The plans.
        vss_range: Least and greatest modelled VSS over all deterministic plans that tie, under ``mission``.
        worst: The deterministic plan that ties and has that greatest VSS; ``None`` where no tie makes a difference.
        ties_proved: Whether the choice of the deterministic plan among those that tie, and that range, are proved.
        ws: Wait-and-see value under ``mission``; ``None`` if it wasn't computed.
        evpi: Expected value of perfect information.
        value_of_process: Greatest value under another failure process, the one executed if it is another, less that of
            the plan for ``mission``; ``None`` where no other is planned for or executed.
        informed: The perfect-information plans, on request.
        by_process: The plans for each failure process, where they are known.
        calibrated: The plan for calibrated costs, on request.
    """

    instance: Instance
    stochastic: Plan
    deterministic: Plan
    vss_range: tuple[float, float]
    worst: Plan | None
    ties_proved: bool
    ws: float | None
    evpi: float | None
    value_of_process: float | None
    informed: InformedPlans | None
    by_process: PlansByProcess | None
    calibrated: Calibrated | None = None

    def all_plans(self) -> list[Plan]:
        """Every plan that is executed for its own sake."""
        return [self.stochastic, self.deterministic, *(self.informed.plans.values() if self.informed else ())]


def model_is_executed(world: World) -> bool:
    """Whether failures are planned for and executed as in the two-stage model."""
    return world.plan_failure == world.execute_failure == MODEL


def plan_scenarios(
    world: World, costs: Mapping[str, FuelCosts], options: Options, progress: OnProgress
) -> dict[str, Planned]:
    """Both plans of each scenario. Scenarios share what doesn't depend on availabilities.

    Raises:
        BadInput: If the informed planner is requested under another process than ``mission``.
        KeyboardInterrupt: On Ctrl-C; an incomplete set of plans is of no use.
    """
    if options.informed and not model_is_executed(world):
        raise BadInput("the informed planner knows who is available for a mission; with failures along the route there "
                       "is no such thing: leave out --informed, or plan for and execute mission")
    known: Knowledge | None = None
    nominal: Plan | None = None
    planned: dict[str, Planned] = {}
    for number, scenario in enumerate(world.scenarios):
        progress("solving", number, len(world.scenarios))
        others = other_processes(world, assumptions=options.assumptions)
        instance = replace(instance_of(world, costs, scenario, others), failure=MODEL)
        if known is None or nominal is None:
            known = knowledge_of(instance)
            nominal = unless_interrupted(plan_nominal(instance, options.limits, known=known))
        stochastic = unless_interrupted(plan_stochastic(instance, options.limits, known=known))
        pair = plan_deterministic(instance, stochastic, options.limits, nominal=nominal, known=known)
        unless_interrupted(pair.plan)
        rp = expected_value(instance, pair.stochastic)
        foresight = wait_and_see(instance, options.limits, known, force=options.evpi)
        process = by_process = None
        if others:
            best = {name: unless_interrupted(plan_stochastic(
                replace(instance, failure=name), options.limits, pair.stochastic, known)) for name in others}
            by_process = PlansByProcess(instance=instance, deterministic=pair.plan,
                                        stochastic={MODEL: pair.stochastic, **best})
            truth = replace(instance, failure=others[0])
            process = max(expected_value(truth, best[others[0]]) - expected_value(truth, pair.stochastic), 0.0)
            pair = replace(pair, stochastic=by_process.stochastic[world.plan_failure])
        planned[scenario.name] = Planned(
            instance=replace(instance, failure=world.plan_failure), stochastic=pair.stochastic, deterministic=pair.plan,
            vss_range=(rp - pair.most, rp - pair.least), worst=pair.worst, ties_proved=pair.proved,
            ws=None if foresight is None else max(foresight, rp),
            evpi=None if foresight is None else max(foresight - rp, 0.0), value_of_process=process,
            informed=plan_informed(instance, options.limits, known, force=options.evpi) if options.informed else None,
            by_process=by_process)
        progress("solving", number + 1, len(world.scenarios))
    return planned


def other_processes(world: World, *, assumptions: bool) -> list[FailureProcess]:
    """Failure processes beside the model's that plans are made for, the one that is executed first."""
    asked = [world.execute_failure, world.plan_failure, *(PROCESSES if assumptions else ())]
    others = [name for name in dict.fromkeys(asked) if name != MODEL]
    apart = [name for name in others if not _defined(world, name)]
    if apart:
        _log.warning("%s: no assumption of %s failures, under which its availabilities have no meaning (they have a "
                     "joint distribution, or robots have no mission limit)", world.name, " and ".join(apart))
    return [name for name in others if name not in apart]


def _defined(world: World, process: FailureProcess) -> bool:
    """Whether a world says all that a process has to know."""
    joint = any(scenario.joint is not None for scenario in world.scenarios)
    return not (joint and without_joint([process])) and not any(
        undefined_under([process], scenario.reliability(robot))
        for scenario in world.scenarios for robot in world.robots)


def with_calibration(
    world: World, costs: Mapping[str, FuelCosts], planned: Mapping[str, Planned], options: Options,
    executor: Executor | None, progress: OnProgress,
) -> dict[str, Planned]:
    """The plans of each scenario with the calibrated one, if it is asked for.

    Args:
        world, costs: The world and its fuel costs.
        planned: The plans for nominal costs.
        options: What is asked for, and when solves may stop.
        executor: Where drives run; ``None`` = here.
        progress: Called as costs and plans are made.

    Raises:
        KeyboardInterrupt: On Ctrl-C.
    """
    if options.calibrate is None:
        return dict(planned)
    found = calibrate(world, costs, {name: (plans.stochastic, plans.instance) for name, plans in planned.items()},
                      options.calibrate, options.limits, executor, progress)
    return {name: replace(plans, calibrated=found[name]) for name, plans in planned.items()}


def own_cases(scenario: Scenario, planned: Planned) -> list[Case]:
    """Both plans of a scenario, and the calibrated one where there is one, to be executed."""
    made: dict[OwnPlan, Plan] = {"stochastic": planned.stochastic, "deterministic": planned.deterministic}
    if planned.calibrated is not None:
        made["calibrated"] = planned.calibrated.plan
    return [Case(scenario=scenario, planner=name, plan=plan, role=name) for name, plan in made.items()]


def plan_informed(instance: Instance, limits: SolveLimits, known: Knowledge, *, force: bool) -> InformedPlans:
    """The best plan for every set of robots that can be available.

    Args:
        instance: The instance; failures are those of ``mission``.
        limits: When each solve may stop.
        known: What solves of the same instance with other availabilities found.
        force: Solve however many sets there are.

    Raises:
        BadInput: If there are more than 16, and that isn't forced.
    """
    sets = possible(instance)
    if len(sets) > MOST_SUBSETS and not force:
        raise BadInput(f"{instance.name}: {len(sets)} sets of robots can be available, and the informed planner solves "
                       f"for each; beyond {MOST_SUBSETS} it has to be told so with --evpi")
    plans = {}
    for available in sets:
        sure = replace(instance, joint=None, failure=MODEL, vehicles=tuple(
            replace(v, availability=1.0 if v.name in available else 0.0) for v in instance.vehicles))
        plans[available] = unless_interrupted(plan_stochastic(sure, limits, known=known))
    return InformedPlans(plans=plans, expected=sum(sets[s] * (plan.value or 0.0) for s, plan in plans.items()),
                         bound=sum(sets[s] * (plan.bound or 0.0) for s, plan in plans.items()))


def check_plans(
    world: World, costs: Mapping[str, FuelCosts], plans: Mapping[str, Plan], paths: Mapping[str, Path | str], *,
    allow_infeasible: bool,
) -> None:
    """Refuse given plans that are infeasible with the world's travel times.

    Args:
        world, costs: The world, and its fuel costs.
        plans, paths: The plans and their files, or what else they are called, by name.
        allow_infeasible: Warn of those that break fuel or limit alone.

    Raises:
        InfeasiblePlan: If a plan cannot be driven; or breaks fuel or limit, and that isn't allowed.
    """
    instance = instance_of(world, costs, nominal_scenario(world))
    for name, plan in plans.items():
        certificate = certify(instance, replace(plan, value=None))
        if not certificate.feasible:
            never = certify(unlimited(instance), replace(plan, value=None)).reasons
            if never or not allow_infeasible:
                raise InfeasiblePlan(paths[name], never if allow_infeasible else certificate.reasons,
                                     undrivable=bool(never))
            _log.warning("%s is infeasible, and used all the same: %s", paths[name], "; ".join(certificate.reasons))


def unlimited(instance: Instance) -> Instance:
    """The instance without limits on fuel and time."""
    return replace(instance, vehicles=tuple(
        replace(v, fuel_capacity_s=np.inf, mission_limit_s=np.inf) for v in instance.vehicles))
