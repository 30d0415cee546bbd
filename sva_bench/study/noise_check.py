"""What noise leaves of the margins of a world's plans, driven by the twin under many draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from sva_bench.analysis.tightness import NoiseCheck, PlanTightness, tightness_of
from sva_bench.errors import BadInput
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives, drive_all
from sva_bench.execution.execute import drives_ahead
from sva_bench.execution.margins import Margins, margins_of_team
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.shared.execute import Wanted, ground_of, play_all
from sva_bench.execution.shared.players import MissionKey, TeamDriven
from sva_bench.execution.shared.unfailed import margins_of_missions, unfailed_keys
from sva_bench.mission.plan import Plan, unless_interrupted
from sva_bench.report.drawing import draw_world
from sva_bench.report.overlays import JudgedLeg, Kind, Overlays
from sva_bench.solver.two_stage import Knowledge, knowledge_of, plan_stochastic
from sva_bench.study.costs import instance_of
from sva_bench.study.pictures import routes_of
from sva_bench.travel.fuel import FuelCosts
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import World


@dataclass(frozen=True, eq=False, kw_only=True)
class CheckedPlans:
    """Plans checked under noise, and what was found, in the same order."""

    plans: tuple[Plan, ...]
    found: NoiseCheck


def refuse_without_noise(world: World) -> None:
    """Refuse a world in which all rollouts are equal.

    Raises:
        BadInput: If this is one.
    """
    if not world.noisy:
        raise BadInput(f"--noise: {world.name} has no noise, so its plans are driven as they are planned; give it some "
                       "(noise: realistic), or leave out --noise")


def check_noise(
    world: World, costs: Mapping[str, FuelCosts], given: Mapping[str, Plan], *, draws: int, seed: int,
    progress: OnProgress,
) -> CheckedPlans:
    """Drive plans by the twin under many noise draws.

    Args:
        world: The world; it has noise.
        costs: Its fuel costs by robot model.
        given: Plans to be driven, by name; none: the stochastic plan of each scenario.
        draws: Number of noise draws; they are the first of those that a run with this seed has.
        seed: Root seed.
        progress: Progress callback.
    """
    plans = {(tuple(s.name for s in world.scenarios), name): plan for name, plan in given.items()} if given else \
        _stochastic(world, costs, progress)
    settings = Settings(seed=seed, trials=draws, rollouts=draws, fidelity="kinematic", recorded=False)
    robots = [robot.name for robot in world.robots]
    limits = {robot.name: (robot.fuel_capacity_s, robot.mission_limit_s) for robot in world.robots}
    found: list[PlanTightness] = []
    for number, ((scenarios, name), plan) in enumerate(plans.items()):
        # A robot that may leave in one of its scenarios drives its route.
        cases = [Case(scenario=world.scenario(scenario), planner=name, plan=plan) for scenario in scenarios]
        margins = (_of_missions if world.meets else _of_routes)(
            world, costs, cases, settings, lambda done, of, k=number: progress(  # type: ignore[misc]
                "driving routes", k * of + done, len(plans) * of))
        found.append(tightness_of(scenarios, name, robots, limits, margins))
    return CheckedPlans(plans=tuple(plans.values()),
                        found=NoiseCheck(world=world.name, seed=seed, draws=draws, plans=tuple(found)))


def _of_routes(world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], settings: Settings,
               progress: Callable[[int, int], None]) -> tuple[Margins, ...]:
    """Margins of routes that robots drive each by itself."""
    ahead, drives = drives_ahead(world, costs, cases, settings), Drives()
    drive_all(ahead.chunks, drives, None, progress)
    ahead.courses.compose(ahead.wanted, drives)
    return margins_of_team(orders_of(world, cases[0], planned_legs(world, costs, cases)), drives.routes)


def _of_missions(world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case], settings: Settings,
                 progress: Callable[[int, int], None]) -> tuple[Margins, ...]:
    """Margins of routes of robots that meet, from missions in which every robot leaves that may."""
    orders = orders_of(world, cases[0], planned_legs(world, costs, cases))
    keys = unfailed_keys(world, cases, orders, settings.rollouts)
    played: dict[MissionKey, TeamDriven] = {}
    play_all(world, ground_of(world, costs), settings, [Wanted(orders, key) for key in keys], None, progress, played)
    return margins_of_missions(orders, played.items())


def _stochastic(world: World, costs: Mapping[str, FuelCosts], progress: OnProgress
                ) -> dict[tuple[tuple[str, ...], str], Plan]:
    """The stochastic plan of each scenario; those with the same routes are one."""
    alike: dict[tuple[tuple[str, tuple[str, ...]], ...], tuple[list[str], Plan]] = {}
    known: Knowledge | None = None  # scenarios share what doesn't depend on availabilities
    for number, scenario in enumerate(world.scenarios):
        progress("solving", number, len(world.scenarios))
        instance = instance_of(world, costs, scenario)
        known = known or knowledge_of(instance)
        plan = unless_interrupted(plan_stochastic(instance, known=known))
        routes = tuple((robot.name, tuple(plan.route(robot.name))) for robot in world.robots)
        alike.setdefault(routes, ([], plan))[0].append(scenario.name)
    progress("solving", len(world.scenarios), len(world.scenarios))
    return {(tuple(names), "stochastic"): plan for names, plan in alike.values()}


def worst_of(checked: CheckedPlans) -> int:
    """Number of the plan that noise upsets most often."""
    return max(range(len(checked.plans)), key=lambda number: checked.found.plans[number].bad)


def picture_of_margins(world: World, costs: Mapping[str, FuelCosts], plan: Plan, told: PlanTightness, kind: Kind
                       ) -> bytes:
    """A picture of a plan's legs, coloured by what noise leaves of their margins."""
    routes = routes_of(world, costs, plan)
    legs = sorted(told.legs, key=lambda leg: ("safe", "close", "edge").index(leg.judged))
    return draw_world(world, kind, Overlays(judged=[
        JudgedLeg(path=routes[leg.robot][leg.leg].path, judged=leg.judged) for leg in legs]))
