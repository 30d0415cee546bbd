"""Teams for tests: lanes through given places, missions that hand out leg after leg, and teams that react."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sva_bench.choices import News
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.known_legs import KnownLegs
from sva_bench.execution.known_team import Team
from sva_bench.execution.noise import draw_noise
from sva_bench.execution.orders import orders_of, planned_legs
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.policies.policy import Orders, Policy, TeamState
from sva_bench.execution.shared.drive import TeamRun, drive_team
from sva_bench.execution.shared.driver import Happening, Hold, LegSoFar, Member, TeamDriver
from sva_bench.execution.shared.lanes import Cut, Itinerary, Lane, Order, cut
from sva_bench.execution.shared.own_ways import Ways
from sva_bench.execution.shared.planning import first_order
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.execution.shared.space_time import plan_order
from sva_bench.execution.team_outcome import TeamOutcome
from sva_bench.mission.plan import Plan
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance
from sva_bench.robot.follower import stretches
from sva_bench.robot.model import BUILT_IN, RobotModel
from sva_bench.study.costs import plan_costs
from sva_bench.travel.fuel import FuelCosts
from sva_bench.world.model import World

MODEL = BUILT_IN["turtlebot2"]
SURE, ABSENT = RobotFate(), RobotFate(before_poi=0)
Place = tuple[float, float]
Tour = Sequence[Sequence[Place]]
"""Paths of the legs; each begins where the one before ends."""


def cuts_of(tour: Tour, model: RobotModel = MODEL, heading: float = 0.0) -> tuple[Cut, ...]:
    """The legs of a tour, each of one hop, which ends in ``heading``."""
    pose, cuts = (*tour[0][0], heading), []
    for path in tour:
        cuts.append(cut(model, (stretches(np.array(path), heading),), pose))
        pose = (*path[-1], heading)
    return tuple(cuts)


def lane_of(cuts: Sequence[Cut]) -> Lane:
    """A lane of a robot that has the world for itself."""
    begins = np.cumsum([0.0, *(each.lasts_s for each in cuts)])
    return Lane(cuts=tuple(cuts), first_cell=np.cumsum([0, *(len(each.enter_s) for each in cuts)]),
                enter_s=np.concatenate([each.enter_s + at for each, at in zip(cuts, begins[:-1], strict=True)]),
                place_m=np.concatenate([each.place_m for each in cuts]))


def planned(tours: Sequence[Tour], stop_s: float, gap_m: float = 0.2) -> Order:
    """The order in which robots drive tours."""
    order = plan_order([Itinerary(radius_m=MODEL.radius_m, legs=tuple((each,) for each in cuts_of(tour)),
                                  stop_s=(stop_s,) * len(tour), ready_s=0.0, place_m=tour[0][0]) for tour in tours],
                       gap_m)
    assert order is not None
    return order


def members_of(tours: Sequence[Tour], disturbances: Sequence[Disturbance] | None = None) -> list[Member]:
    """Robots at the starts of tours, where they believe to be there."""
    members = []
    for tour, disturbance in zip(tours, disturbances or [UNDISTURBED] * len(tours), strict=True):
        x, y, yaw = disturbance.start((*tour[0][0], 0.0)).tolist()
        members.append(Member(model=MODEL, start=(x, y, yaw), disturbance=disturbance))
    return members


def geared(factor: float) -> Disturbance:
    """A robot that drives faster or slower than commanded."""
    return Disturbance(wheel_gains=(factor, factor))


@dataclass
class Mission:
    """Hands out leg after leg, and keeps what happened.

    Attributes:
        driver: The team.
        stop_s: How long robots stay at the end of each leg.
        legs: What came of each robot's legs.
        happened: All that happened, in order.
    """

    driver: TeamDriver
    lanes: Sequence[Lane]
    stop_s: float = 0.0
    legs: dict[int, list[LegSoFar]] = field(default_factory=dict)
    happened: list[Happening] = field(default_factory=list)

    def begin(self, order: Order | None, holds: Mapping[int, Sequence[Hold]] | None = None) -> None:
        """Assign lanes, with the gates of an order or without any, and start the first legs."""
        for robot, lane in enumerate(self.lanes):
            self.driver.assign(robot, lane, None if order is None else order.needs[robot])
            self.legs[robot] = []
        for robot in range(len(self.lanes)):
            self.driver.start_leg(robot, 0.0, math.inf, (holds or {}).get(robot, ()))

    def go_on(self, until_s: float = math.inf) -> Happening:
        """Drive until something else happens than arrivals, or an arrival after a time."""
        while True:
            happening = self.driver.run()
            self.happened.append(happening)
            if happening.kind != "arrived":
                return happening
            robot = happening.robot
            self.legs[robot].append(self.driver.leg(robot))
            if len(self.legs[robot]) < len(self.lanes[robot].cuts):
                self.driver.start_leg(robot, happening.clock_s + self.stop_s, math.inf, ())
            if happening.clock_s > until_s:
                return happening

    @property
    def ends_s(self) -> list[float]:
        """When each robot's last leg ended."""
        return [legs[-1].clock_s for legs in self.legs.values()]


def begun(driver: TeamDriver, order: Order, stop_s: float = 0.0) -> Mission:
    """A mission whose robots have set off on the lanes of an order, and heed its gates."""
    mission = Mission(driver, order.lanes, stop_s=stop_s)
    mission.begin(order)
    return mission


def there_and_back(path: Sequence[Place]) -> Tour:
    """A leg to the end of a path and one back."""
    return [path, list(reversed(path))]


CORRIDOR: tuple[Tour, ...] = (  # all go into the same dead end, one by one
    there_and_back([(0.0, 0.0), (2.0, 1.5), (8.0, 1.5)]),
    there_and_back([(0.0, 1.5), (2.0, 1.5), (7.0, 1.5)]),
    there_and_back([(0.0, 3.0), (2.0, 1.5), (6.0, 1.5)]))
DOOR: tuple[Tour, ...] = tuple(  # from four berths through one door to four places, and back
    there_and_back([(0.0, 1.2 * k), (3.0, 1.8), (4.0, 1.8), (7.0, 3.6 - 1.2 * k)]) for k in range(4))
CROSSING: tuple[Tour, ...] = (
    [*there_and_back([(-4.0, -4.0), (4.0, 4.0)]), *there_and_back([(-4.0, -4.0), (3.0, 3.1)])],
    [*there_and_back([(-4.0, 4.0), (4.0, -4.0)]), *there_and_back([(-4.0, 4.0), (3.0, -3.1)])])


class Asked:
    """A policy that gives the orders it is told to, and keeps what it was asked."""

    def __init__(self, answer: Callable[[TeamState], Orders] = lambda state: {}) -> None:  # noqa: ARG005
        self.states: list[TeamState] = []
        self._answer = answer

    def __call__(self, state: TeamState) -> Orders:
        self.states.append(state)
        return self._answer(state)


class Stage:
    """A world of two robots in which missions are played by hand."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.costs: Mapping[str, FuelCosts] = plan_costs(world, "prmstar", lambda *_: None)
        self.ways = Ways(world, self.costs)

    def play(self, routes: Mapping[str, tuple[str, ...]], fates: tuple[RobotFate, ...], news: News,
             policy: Policy) -> TeamDriven:
        """A mission of a team that reacts."""
        case = Case(scenario=self.world.scenarios[0], planner="given", plan=Plan(routes=routes))
        orders = tuple(orders_of(self.world, case, planned_legs(self.world, self.costs, [case])))
        settings = Settings(seed=0, trials=1, rollouts=1, fidelity="kinematic")
        team = Team(orders=orders, base="base", pois=frozenset(site.name for site in self.world.pois), policy=policy,
                    news=news, scheduled_s=KnownLegs(self.world, self.costs, settings).scheduled_s)
        leaves = [bool(own.route) and fate.before_poi > 0 for own, fate in zip(orders, fates, strict=True)]
        return drive_team(TeamRun(
            world=self.world, ways=self.ways, orders=orders, fates=fates, noise_index=(0, 0), team=team,
            drawn=[draw_noise(self.world.noise, 0, 0, number) for number in range(len(orders))],
            order=first_order(self.ways, orders, leaves) if self.world.interaction == "shared" else None),
            "kinematic", traced=False)

    def told(self, routes: Mapping[str, tuple[str, ...]], fates: tuple[RobotFate, ...], news: News,
             policy: Policy) -> TeamOutcome:
        """The same, of which nobody touches another."""
        driven = self.play(routes, fates, news, policy)
        assert driven.contacts == 0
        assert driven.told is not None
        return driven.told
