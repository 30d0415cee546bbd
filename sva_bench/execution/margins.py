"""How far a robot's route stayed, draw by draw, from what ends a mission badly: pure functions of driven times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, frozen
from sva_bench.execution.outcome import Assignment, Driven


@dataclass(frozen=True, eq=False, kw_only=True)
class Margins:
    """A route's stops, and what was left of fuel and time at each under each noise draw.

    Attributes:
        robot: The robot's position in its team.
        route: Site names from base to base.
        is_poi: Whether a stop is a POI, shape (stops,).
        fills: Whether the tank is filled there, shape (stops,).
        worth: Incentive of each stop, shape (stops,).
        loss_cost: Cost of the robot if it doesn't come home [incentive].
        planned_s: Driving time of the leg to each stop as planned [s], without margin, shape (stops,); of none where
            unknown.
        leg_s: Driving time of the leg to each stop [s], shape (draws, stops); NaN from a leg on that it got stuck on.
        fuel_s: Fuel left on arrival, or after the stop where standing burns fuel [s of driving], shape (draws, stops);
            negative: it ran dry before.
        time_s: What was left of the mission limit when the stop was over [s], shape (draws, stops).
    """

    robot: int
    route: tuple[str, ...]
    is_poi: BoolArray
    fills: BoolArray
    worth: FloatArray
    leg_s: FloatArray
    fuel_s: FloatArray
    time_s: FloatArray
    loss_cost: float = 0.0
    planned_s: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        draws, stops = self.leg_s.shape
        object.__setattr__(self, "worth", frozen(self.worth, (stops,)))
        object.__setattr__(self, "planned_s", frozen(self.planned_s, (None,)))
        for name in ("leg_s", "fuel_s", "time_s"):
            values: FloatArray = getattr(self, name)
            if values.shape != (draws, stops):
                raise ValueError(f"{name}: expected the shape {(draws, stops)}, got {values.shape}")
            values.setflags(write=False)

    @property
    def collected(self) -> FloatArray:
        """Incentive of the first k POIs, for k from 0 to all of them, shape (POIs + 1,)."""
        earned: FloatArray = np.concatenate([[0.0], np.cumsum(self.worth[self.is_poi])])
        return earned


def margins_of(robot: int, orders: Assignment, drives: Sequence[Driven]) -> Margins:
    """Margins of a robot's route.

    Args:
        robot: The robot's position in its team.
        orders: Its route and the rules it drives under.
        drives: The route driven under each noise draw; there may be none.
    """
    stops = orders.route[1:]
    leg = np.full((len(drives), len(stops)), np.nan)
    waited = np.zeros_like(leg)
    capacity_s = np.array([orders.fuel_capacity_s * driven.capacity for driven in drives])
    for row, driven in enumerate(drives):
        done = len(driven.leg_s) - driven.stuck
        leg[row, :done], waited[row, :done] = driven.leg_s[:done], driven.waited_s[:done]
    fuel, time = np.empty_like(leg), np.empty_like(leg)
    burnt, clock = np.zeros(len(drives)), np.array([driven.start_s for driven in drives])
    for column, (_, site) in enumerate(pairwise(orders.route)):
        burnt = burnt + leg[:, column] + orders.idle_share * waited[:, column]
        clock = clock + leg[:, column] + waited[:, column] + orders.stop_s[site]
        if site in orders.stations:
            clock = clock + burnt / orders.charge_rate.get(site, np.inf)
        elif column < len(stops) - 1:
            burnt = burnt + orders.idle_share * orders.stop_s[site]
        fuel[:, column] = capacity_s - burnt
        time[:, column] = orders.mission_limit_s - clock
        if site in orders.stations:
            burnt = np.zeros(len(drives))
    is_poi = np.array([orders.is_poi(site) for site in stops], dtype=np.bool_)
    return Margins(
        robot=robot, route=orders.route, is_poi=is_poi, leg_s=leg, fuel_s=fuel, time_s=time,
        loss_cost=orders.loss_cost, planned_s=np.array(orders.planned_s, dtype=np.float64),
        fills=np.array([site in orders.stations for site in stops], dtype=np.bool_),
        worth=np.array([orders.incentives.get(site, 0.0) if poi else 0.0
                        for site, poi in zip(stops, is_poi, strict=True)]))


def margins_of_team(orders: Sequence[Assignment], drives: Mapping[tuple[str, tuple[str, ...], int, int], Driven]
                    ) -> tuple[Margins, ...]:
    """Margins of each robot's route; none of robots that stay home.

    Args:
        orders: Orders of the robots.
        drives: Drives by robot, stops driven, noise draw and trial; those of a whole route count, once for each draw.
    """
    whole: dict[tuple[str, tuple[str, ...]], dict[int, Driven]] = {(o.robot, o.route): {} for o in orders if o.route}
    for (robot, route, rollout, _), driven in drives.items():
        if (robot, route) in whole:
            whole[robot, route][rollout] = driven
    return tuple(margins_of(number, order, [driven for _, driven in sorted(whole[order.robot, order.route].items(),
                                                                            key=lambda item: item[0])])
                 for number, order in enumerate(orders) if order.route)
