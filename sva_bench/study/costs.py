"""Fuel costs of a world, its instances, and unreachable POIs.

Apart from ``planning``, since a check of a world needs neither solvers nor physics, which take a second to import.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.analysis.reach import reached
from sva_bench.analysis.summaries import Reach
from sva_bench.choices import FailureProcess, PathPlanner
from sva_bench.mission.failures import Reliability, fails_by_driving, mtbf_s
from sva_bench.mission.instance import Instance, Vehicle
from sva_bench.robot.model import RobotModel
from sva_bench.solver.routes.refuelling import quickest_route, vehicle_legs
from sva_bench.study.given_plans import instance_name
from sva_bench.travel.berths import own_world, place_berths
from sva_bench.travel.fuel import FuelCosts, fuel_costs
from sva_bench.travel.times import TravelTimes, plan_travel_times
from sva_bench.workers.progress import OnProgress
from sva_bench.world.model import NOMINAL, Scenario, World, nominal_of


@dataclass(frozen=True, eq=False, kw_only=True)
class Ground:
    """What the travel times of a kind of robot depend on: its model, and the world as it is to it."""

    world: World
    model: RobotModel


def grounds_of(world: World) -> dict[str, Ground]:
    """The ground of each kind of robot, by ``World.kind_of``.

    Robots that meet leave from berths of their own, and the berths of the others stand in their way.

    Raises:
        NoRoomForBerths, NoRoomForSlots: If they don't fit about the base, or about a station.
    """
    if not world.meets:
        return {robot.model.name: Ground(world=world, model=robot.model) for robot in world.robots}
    berths = place_berths(world)
    return {robot.name: Ground(world=own_world(world, berths, number), model=robot.model)
            for number, robot in enumerate(world.robots)}


def plan_times(world: World, planner: PathPlanner, progress: OnProgress) -> dict[str, TravelTimes]:
    """Travel times of each kind of robot in the world, by ``World.kind_of``."""
    grounds = grounds_of(world)
    times = {}
    for number, (kind, ground) in enumerate(grounds.items()):
        progress("planning paths", number, len(grounds))
        times[kind] = plan_travel_times(ground.world, ground.model, planner)
        progress("planning paths", number + 1, len(grounds))
    return times


def plan_costs(world: World, planner: PathPlanner, progress: OnProgress) -> dict[str, FuelCosts]:
    """Fuel costs of each kind of robot in the world, by ``World.kind_of``."""
    return {name: fuel_costs(times, world.margin) for name, times in plan_times(world, planner, progress).items()}


def instance_of(
    world: World, costs: Mapping[str, FuelCosts], scenario: Scenario, processes: Iterable[FailureProcess] = ()
) -> Instance:
    """The optimisation instance of one scenario of a world.

    Args:
        world, costs: The world, and its fuel costs.
        scenario: The scenario.
        processes: Failure processes beside the world's that values are computed under.
    """
    wanted = (world.plan_failure, world.execute_failure, *processes)
    charges = any(site.charge_rate is not None for site in world.sites)
    sites = tuple(site.name for site in world.sites)
    return Instance(
        name=instance_name(world, None if scenario.name == NOMINAL else scenario.name), sites=sites, base=0,
        stations=tuple(sites.index(site.name) for site in world.stations),
        stop_s=np.array([site.stop_s for site in world.sites]),
        charge_rate=np.array([np.inf if site.charge_rate is None else site.charge_rate for site in world.sites])
        if charges else None, failure=world.plan_failure, joint=scenario.joint,
        vehicles=tuple(Vehicle(
            name=robot.name, fuel_capacity_s=robot.fuel_capacity_s, mission_limit_s=robot.mission_limit_s,
            availability=scenario.availability[robot.name], loss_cost=robot.loss_cost,
            idle_share=robot.idle_share, fuel_s=costs[world.kind_of(robot)].cost_s,
            mtbf_s=_planning_mtbf_s(world, scenario.reliability(robot), wanted),
            incentives=np.array([robot.incentives.get(site, 0.0) for site in sites])) for robot in world.robots),
    )


def _planning_mtbf_s(world: World, reliability: Reliability, processes: Sequence[FailureProcess]) -> float | None:
    """Mean time to failure in seconds of the planning costs; ``None`` where no process needs it and it isn't given.

    Robots fail by the time that they drive, which is predicted without the margin that planning costs hold. Costs and
    mean both times (1 + margin) give the same probabilities to survive.
    """
    if reliability.mtbf_s is None and not any(fails_by_driving(name, reliability) for name in processes):
        return None
    return mtbf_s(reliability) * (1 + world.margin)


def nominal_scenario(world: World) -> Scenario:
    """The scenario of the availabilities under ``robots:``."""
    return nominal_of(world.robots)


def out_of_reach(world: World, costs: Mapping[str, FuelCosts]) -> dict[str, list[str]]:
    """POIs that a robot cannot visit and return from within fuel and limit, even as the only POI; by robot."""
    instance = instance_of(world, costs, nominal_scenario(world))
    lost = {}
    for vehicle in instance.vehicles:
        own_legs = vehicle_legs(instance, vehicle)
        pois = [instance.sites[poi] for poi in instance.pois if quickest_route(own_legs, (poi,)) is None]
        if pois:
            lost[vehicle.name] = pois
    return lost


def reach_of(world: World, costs: Mapping[str, FuelCosts]) -> Reach:
    """The section ``reach`` of summaries: POIs that would earn robots something beyond their fuel and limit."""
    return reached(out_of_reach(world, costs), [robot.name for robot in world.robots],
                   [poi.name for poi in world.pois],
                   {robot.name: [poi for poi, worth in robot.incentives.items() if worth > 0]
                    for robot in world.robots})
