"""What robots are told to do: their routes, the rules that they drive under, and what each leg takes as planned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from sva_bench.execution.case import Case
from sva_bench.execution.outcome import Assignment
from sva_bench.mission.plan import Route
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import Robot, World

PlannedLegs = Mapping[tuple[str, Route], tuple[float, ...]]
"""Driving time of each leg as planned [s], without margin, by robot and route."""


def planned_legs(world: World, costs: Mapping[str, FuelCosts], cases: Sequence[Case]) -> PlannedLegs:
    """Planned driving times of every route of some cases."""
    planned: dict[tuple[str, Route], tuple[float, ...]] = {}
    for robot in world.robots:
        fuel = costs[world.kind_of(robot)]
        number = {site: k for k, site in enumerate(fuel.times.sites)}
        for route in {case.plan.route(robot.name) for case in cases}:
            planned[robot.name, route] = tuple(
                int(fuel.repaired_ms[number[a], number[b]]) / 1000 for a, b in pairwise(route))
    return planned


def orders_of(world: World, case: Case, planned: PlannedLegs) -> list[Assignment]:
    """What each robot is told to do, and the rules it drives under."""
    routes = [(robot, case.plan.route(robot.name)) for robot in world.robots]
    return [_orders(world, robot, route, planned[robot.name, route]) for robot, route in routes]


def _orders(world: World, robot: Robot, route: Route, planned_s: tuple[float, ...]) -> Assignment:
    return Assignment(
        loss_cost=robot.loss_cost, planned_s=planned_s, idle_share=robot.idle_share,
        charge_rate={s.name: s.charge_rate for s in world.stations if s.charge_rate is not None},
        robot=robot.name, route=route, stations=frozenset(s.name for s in world.stations),
        incentives=robot.incentives, stop_s={s.name: s.stop_s for s in world.sites},
        fuel_capacity_s=robot.fuel_capacity_s, mission_limit_s=robot.mission_limit_s)
