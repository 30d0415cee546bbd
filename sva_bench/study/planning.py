"""What is planned for a world: fuel costs, instances and plans of each scenario; plans from elsewhere are read here."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sva_bench.analysis.reach import reached
from sva_bench.analysis.summaries import Reach
from sva_bench.choices import FailureProcess, PathPlanner
from sva_bench.errors import BadInput, ExitCode, SvaBenchError
from sva_bench.execution.execute import Case
from sva_bench.mission.certify import certify, expected_value
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.mission.plan import Plan, unless_interrupted
from sva_bench.mission.plan_file import read_plan
from sva_bench.solver.outcomes import possible
from sva_bench.solver.routes.refuelling import quickest
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
from sva_bench.study.options import Options
from sva_bench.travel.fuel import FuelCosts, fuel_costs
from sva_bench.travel.times import plan_travel_times
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import Scenario, World

_log = logging.getLogger(__name__)

NOMINAL = "nominal"
"""The scenario of the availabilities under ``robots:``."""


@dataclass(frozen=True, eq=False, kw_only=True)
class InformedPlans:
    """What somebody would plan who knew beforehand who is available.

    Attributes:
        plans: The plan for each set of available robots.
        expected: Their expected value.
    """

    plans: Mapping[frozenset[str], Plan]
    expected: float


@dataclass(frozen=True, eq=False, kw_only=True)
class PlansByProcess:
    """The plans of a scenario for each failure process.

    Attributes:
        instance: What they were made for.
        stochastic: The best plan under each failure process.
        deterministic: The plan that knows no failures.
    """

    instance: Instance
    stochastic: Mapping[FailureProcess, Plan]
    deterministic: Plan


@dataclass(frozen=True, eq=False, kw_only=True)
class Planned:
    """Both plans of a scenario, with what the model says of them.

    Attributes:
        instance: What they were made for.
        stochastic, deterministic: The plans.
        vss_range: Least and greatest modelled VSS over all deterministic plans that tie, under ``mission``.
        worst: The deterministic plan that ties and has that greatest VSS; ``None`` where no tie makes a difference.
        ws: Expected value of knowing beforehand who is available, under ``mission``; ``None`` if it wasn't worked out.
        evpi: What that is worth beyond the stochastic plan.
        value_of_process: Greatest value under failures along the route less that of the plan for ``mission``; ``None``
            where such failures are neither planned for nor executed.
        informed: What somebody would plan who knew beforehand who is available, on request.
        by_process: The plans for both failure processes, where they are known.
    """

    instance: Instance
    stochastic: Plan
    deterministic: Plan
    vss_range: tuple[float, float]
    worst: Plan | None
    ws: float | None
    evpi: float | None
    value_of_process: float | None
    informed: InformedPlans | None
    by_process: PlansByProcess | None

    def all_plans(self) -> list[Plan]:
        """Every plan that is executed for its own sake."""
        return [self.stochastic, self.deterministic, *(self.informed.plans.values() if self.informed else ())]


def model_is_executed(world: World) -> bool:
    """Whether failures are planned for and executed as in the two-stage model."""
    return world.plan_failure == world.execute_failure == "mission"


def plan_scenarios(
    world: World, costs: Mapping[str, FuelCosts], options: Options, progress: OnProgress
) -> dict[str, Planned]:
    """Both plans of each scenario. Scenarios share what doesn't depend on availabilities.

    Raises:
        BadInput: If the informed planner is asked for where nothing can be known beforehand.
        KeyboardInterrupt: On Ctrl-C; there is no use for some of the plans.
    """
    if options.informed and not model_is_executed(world):
        raise BadInput("the informed planner knows who is available for a mission; with failures along the route there "
                       "is no such thing: leave out --informed, or plan for and execute mission")
    known: Knowledge | None = None
    nominal: Plan | None = None
    planned: dict[str, Planned] = {}
    for number, scenario in enumerate(world.scenarios):
        progress("solving", number, len(world.scenarios))
        instance = replace(instance_of(world, costs, scenario), failure="mission")
        if known is None or nominal is None:
            known = knowledge_of(instance)
            nominal = unless_interrupted(plan_nominal(instance, options.limits, known=known))
        stochastic = unless_interrupted(plan_stochastic(instance, options.limits, known=known))
        pair = plan_deterministic(instance, stochastic, options.limits, nominal=nominal, known=known)
        unless_interrupted(pair.plan)
        rp = expected_value(instance, pair.stochastic)
        foresight = wait_and_see(instance, options.limits, known, force=options.evpi)
        process = by_process = None
        if options.assumptions or "per_leg" in (world.plan_failure, world.execute_failure):
            along = replace(instance, failure="per_leg")
            best = unless_interrupted(plan_stochastic(along, options.limits, pair.stochastic, known))
            by_process = PlansByProcess(instance=instance, deterministic=pair.plan,
                                        stochastic={"mission": pair.stochastic, "per_leg": best})
            process = max(expected_value(along, best) - expected_value(along, pair.stochastic), 0.0)
            if world.plan_failure == "per_leg":
                pair = replace(pair, stochastic=best)
        planned[scenario.name] = Planned(
            instance=instance, stochastic=pair.stochastic, deterministic=pair.plan,
            vss_range=(rp - pair.most, rp - pair.least), worst=pair.worst,
            ws=None if foresight is None else max(foresight, rp),
            evpi=None if foresight is None else max(foresight - rp, 0.0), value_of_process=process,
            informed=plan_informed(instance, options.limits, known, force=options.evpi) if options.informed else None,
            by_process=by_process)
        progress("solving", number + 1, len(world.scenarios))
    return planned


def two_cases(scenario: Scenario, planned: Planned) -> list[Case]:
    """Both plans of a scenario, to be executed."""
    return [Case(scenario=scenario, planner="stochastic", plan=planned.stochastic, role="stochastic"),
            Case(scenario=scenario, planner="deterministic", plan=planned.deterministic, role="deterministic")]


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
        sure = replace(instance, joint=None, failure="mission", vehicles=tuple(
            replace(v, availability=1.0 if v.name in available else 0.0) for v in instance.vehicles))
        plans[available] = unless_interrupted(plan_stochastic(sure, limits, known=known))
    return InformedPlans(plans=plans, expected=sum(sets[s] * (plan.value or 0.0) for s, plan in plans.items()))


def plan_costs(world: World, planner: PathPlanner, progress: OnProgress) -> dict[str, FuelCosts]:
    """Fuel costs of each robot model in the world, by its name."""
    models = {robot.model.name: robot.model for robot in world.robots}
    costs = {}
    for number, (name, model) in enumerate(models.items()):
        progress("planning paths", number, len(models))
        costs[name] = fuel_costs(plan_travel_times(world, model, planner), world.margin)
        progress("planning paths", number + 1, len(models))
    return costs


def instance_of(world: World, costs: Mapping[str, FuelCosts], scenario: Scenario) -> Instance:
    """The instance of one scenario: all that a solver needs, and no world."""
    sites = tuple(site.name for site in world.sites)
    return Instance(
        name=world.name if scenario.name == NOMINAL else f"{world.name}-{scenario.name}", sites=sites, base=0,
        stations=tuple(sites.index(site.name) for site in world.stations),
        stop_s=np.array([site.stop_s for site in world.sites]), failure=world.plan_failure, joint=scenario.joint,
        vehicles=tuple(Vehicle(
            name=robot.name, fuel_capacity_s=robot.fuel_capacity_s, mission_limit_s=robot.mission_limit_s,
            availability=scenario.availability[robot.name], fuel_s=costs[robot.model.name].cost_s,
            incentives=np.array([robot.incentives.get(site, 0.0) for site in sites])) for robot in world.robots),
    )


def nominal_scenario(world: World) -> Scenario:
    """The availabilities as they stand under ``robots:``."""
    return Scenario(name=NOMINAL, availability={robot.name: robot.availability for robot in world.robots})


def out_of_reach(world: World, costs: Mapping[str, FuelCosts]) -> dict[str, list[str]]:
    """POIs that a robot cannot visit and come home from, even alone and refuelling at will; by robot."""
    instance = instance_of(world, costs, nominal_scenario(world))
    lost = {}
    for vehicle, road in zip(instance.vehicles, knowledge_of(instance).roads, strict=True):
        pois = [instance.sites[poi] for poi in instance.pois if quickest(road, (poi,)) is None]
        if pois:
            lost[vehicle.name] = pois
    return lost


def reach_of(world: World, costs: Mapping[str, FuelCosts]) -> Reach:
    """What robots cannot reach within fuel and limit, as every summary says it."""
    return reached(out_of_reach(world, costs), [robot.name for robot in world.robots],
                   [poi.name for poi in world.pois])


def read_plans(
    world: World, costs: Mapping[str, FuelCosts], paths: Mapping[str, Path], *, allow_infeasible: bool,
) -> dict[str, Plan]:
    """Read plan files for a world, by the names that they go by.

    Raises:
        BadFile: If a file is no plan, or names robots or sites that the world doesn't have.
        InfeasiblePlan: If a plan cannot be driven; or breaks fuel or limit, and that isn't allowed.
    """
    instance = instance_of(world, costs, nominal_scenario(world))
    names = {instance.name, *(instance_of(world, costs, scenario).name for scenario in world.scenarios)}
    plans = {}
    for name, path in paths.items():
        plan = read_plan(path, instance)
        if plan.instance is not None and plan.instance not in names:
            _log.warning("%s was made for %s, not for %s", path, plan.instance, world.name)
        certificate = certify(instance, replace(plan, value=None))
        if not certificate.feasible:
            never = certify(unlimited(instance), replace(plan, value=None)).reasons if allow_infeasible else ()
            if never or not allow_infeasible:
                raise InfeasiblePlan(path, never or certificate.reasons)
            _log.warning("%s is infeasible, and used all the same: %s", path, "; ".join(certificate.reasons))
        plans[name] = plan
    return plans


def unlimited(instance: Instance) -> Instance:
    """The instance with all the fuel and time in the world."""
    return replace(instance, vehicles=tuple(
        replace(v, fuel_capacity_s=np.inf, mission_limit_s=np.inf) for v in instance.vehicles))


class InfeasiblePlan(SvaBenchError):
    """A plan that its certificate refuses."""

    exit_code = ExitCode.INFEASIBLE_PLAN

    def __init__(self, path: Path, reasons: Sequence[str]) -> None:
        super().__init__(path, reasons)
        self.path, self.reasons = path, reasons

    def __str__(self) -> str:
        return f"{self.path}: the plan is infeasible:\n  " + "\n  ".join(self.reasons)
