"""An order that may switch: whoever waits for one that is late goes first, and nobody touches or waits for good."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sva_bench.execution.noise import draw_noise
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.shared.drive import TeamRun, drive_team
from sva_bench.execution.shared.driver import Happening, Hold
from sva_bench.execution.shared.lanes import Order
from sva_bench.execution.shared.planning import first_order
from sva_bench.execution.shared.switching import ASK_S, Standing, Switching
from sva_bench.execution.shared.team_bullet import TeamBullet
from sva_bench.execution.shared.team_twin import TeamTwin
from sva_bench.execution.shared.truncation import cut_off
from sva_bench.robot.disturbance import Disturbance
from sva_bench.world.noise import People
from tests.execution.shared.crowds import itinerary
from tests.execution.shared.invariants import broken, played, ways_of
from tests.execution.shared.random_missions import random_mission
from tests.execution.shared.teams import CORRIDOR, CROSSING, DOOR, Mission, Tour, geared, members_of, planned
from tests.execution.shared.test_random_teams import ROOM
from tests.execution.shared.test_space_time import assert_cells_are_ordered_once

TOURS: Mapping[str, Sequence[Tour]] = {"corridor": CORRIDOR, "door": DOOR, "crossing": CROSSING}
ORDERS = {name: planned(tours, 3.0) for name, tours in TOURS.items()}
CROWDS = {name: [itinerary(*(list(leg) for leg in tour)) for tour in tours] for name, tours in TOURS.items()}


@dataclass
class Switched(Mission):
    """A mission whose robots ask, with all that must hold looked at after each switch."""

    order: Order | None = None
    name: str = ""
    switched: int = 0
    switching: Switching | None = field(default=None)

    def begin(self, order: Order | None, holds: Mapping[int, Sequence[Hold]] | None = None) -> None:
        assert order is not None
        self.order, self.switching = order, Switching(order.crossings, range(len(self.lanes)))
        self.driver.ask(ASK_S)
        super().begin(order, holds)

    def go_on(self, until_s: float = math.inf) -> Happening:
        while (happening := super().go_on(until_s)).kind == "waits":
            self.ask(happening.robot)
        return happening

    def ask(self, robot: int) -> None:
        assert self.switching is not None
        assert self.order is not None
        robots = range(len(self.lanes))
        turned = self.switching.ask(robot, self.driver.standing, [False for _ in robots])
        self.switched += bool(turned)
        for number in turned:
            self.driver.regate(number, self.switching.needs(number, len(self.lanes)))
        if turned:
            assert turned[0] == robot
            needs = tuple(tuple(self.switching.needs(number, len(self.lanes))) for number in robots)
            assert_cells_are_ordered_once(replace(self.order, needs=needs), CROWDS[self.name])
            for i in robots:
                for j in robots:
                    # Robots that drive faster than they know may stand a little beyond a gate.
                    assert i == j or self.driver.cell(j) >= needs[i][j][max(self.driver.cell(i) - 1, 0)]


def mission_of(name: str, *, switched: bool, factors: Sequence[float] = (), delay_s: float = 0.0) -> Mission:
    disturbances = [replace(geared(factor), delay_s=delay_s) for factor in factors] or None
    driver = TeamTwin(members_of(TOURS[name], disturbances))
    return Switched(driver, ORDERS[name].lanes, stop_s=3.0, name=name) if switched else Mission(
        driver, ORDERS[name].lanes, stop_s=3.0)


def test_whoever_waits_for_one_at_a_shut_door_goes_first() -> None:
    late = 0 if ORDERS["crossing"].needs[1][0].any() else 1
    ends = []
    for switched in (False, True):
        mission = mission_of("crossing", switched=switched)
        mission.begin(ORDERS["crossing"], {late: [Hold(along_m=1.0, lasts_s=40.0, cause="door")]})
        assert mission.go_on().kind == "idle"
        ends.append(mission.ends_s)
    fixed, free = ends
    assert isinstance(mission, Switched)
    assert mission.switched > 0
    assert free[1 - late] < fixed[1 - late] - 20
    assert sum(free) < sum(fixed) - 20


def test_an_order_that_is_kept_to_is_not_switched() -> None:
    for name in TOURS:
        mission = mission_of(name, switched=True)
        mission.begin(ORDERS[name])
        assert mission.go_on().kind == "idle"
        assert isinstance(mission, Switched)
        assert mission.switched == 0
        assert mission.ends_s == pytest.approx(ORDERS[name].ends_s - 3.0, abs=3.0)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(TOURS)), st.lists(st.floats(0.5, 1.2), min_size=4, max_size=4), st.floats(0.0, 0.15),
       st.lists(st.tuples(st.floats(0, 8), st.floats(1, 40)), min_size=4, max_size=4), st.integers(1, 15))
def test_however_late_robots_are_switches_let_nobody_touch_and_everybody_end(
        name: str, factors: list[float], delay_s: float, holds: list[tuple[float, float]], held: int) -> None:
    count = len(TOURS[name])
    mission = mission_of(name, switched=True, factors=factors[:count], delay_s=delay_s)
    mission.begin(ORDERS[name], {k: [Hold(along_m=at, lasts_s=lasts, cause="people")]
                                 for k, (at, lasts) in enumerate(holds[:count]) if held >> k & 1})
    assert mission.go_on().kind == "idle"
    assert {happening.kind for happening in mission.happened} <= {"arrived", "idle", "waits"}
    assert [len(legs) for legs in mission.legs.values()] == [len(lane.cuts) for lane in ORDERS[name].lanes]


@pytest.mark.long
def test_in_physics_switches_let_nobody_touch_and_everybody_end() -> None:
    switched = 0
    for seed in range(9):
        rng, name = np.random.default_rng(seed), list(TOURS)[seed % 3]
        tours, order = TOURS[name], ORDERS[name]
        disturbances = [Disturbance(wheel_gains=tuple(rng.normal(1, 0.02, 2).tolist()), delay_s=0.08) for _ in tours]
        holds = {k: [Hold(along_m=float(rng.uniform(0, 4)), lasts_s=float(rng.uniform(5, 40)), cause="door")]
                 for k in range(len(tours)) if rng.random() < 0.6}
        with TeamBullet(replace(ROOM, bounds_m=np.array([-20.0, -20.0, 20.0, 20.0])),
                        members_of(tours, disturbances)) as driver:
            mission = Switched(driver, order.lanes, stop_s=3.0, name=name)
            mission.begin(order, holds)
            assert mission.go_on().kind == "idle"
            assert not any(leg.touches for legs in mission.legs.values() for leg in legs)
            switched += mission.switched
    assert switched > 0


def head_on() -> tuple[Order, int, int]:
    """Two robots that meet at one group, who is first there, and the group's first cell on its lane."""
    order = planned([[[(0.0, 0.0), (8.0, 0.0)]], [[(4.0, 4.0), (4.0, -4.0)]]], 0.0)
    assert len(order.crossings) == 1
    first = 1 - int(order.crossings.second[0])
    return order, first, int(order.crossings.begins[0, first])


@pytest.mark.parametrize(("before", "stops_m", "drives", "switched"), [
    (20, 0.5, True, True), (1, 0.0, False, True),  # far away, or at a stop
    (0, 0.0, False, False), (-3, 0.0, True, False),  # in the group
    (4, 0.5, True, False), (7, 0.5, True, True)])  # it can't brake before it, or just so
def test_a_group_is_given_away_only_by_one_that_can_stop_before_it(
        before: int, stops_m: float, drives: bool, switched: bool) -> None:
    order, first, begins = head_on()
    gate = int(np.argmax(order.needs[1 - first][first] > 0))
    standing = {first: Standing(cell=begins - before, free_s=60.0, drives=drives, stops_m=stops_m),
                1 - first: Standing(cell=gate - 1, free_s=10.0, drives=True, stops_m=0.0)}
    switching = Switching(order.crossings, (0, 1))
    assert bool(switching.ask(1 - first, standing.__getitem__, [False, False])) == switched
    assert (switching.needs(first, 2)[1 - first].max() > 0) == switched
    assert (switching.needs(1 - first, 2)[first].max() == 0) == switched


def test_a_switch_that_saves_nothing_or_makes_a_circle_is_refused() -> None:
    order, first, begins = head_on()
    gate = int(np.argmax(order.needs[1 - first][first] > 0))
    soon = {first: Standing(cell=begins - 3, free_s=10.0, drives=True, stops_m=0.0),
            1 - first: Standing(cell=gate - 1, free_s=10.0, drives=True, stops_m=0.0)}
    assert Switching(order.crossings, (0, 1)).ask(1 - first, soon.__getitem__, [False, False]) == ()
    # Head-on in a corridor: the second can't go first, for the one that stands at its end has no other way out.
    order = planned([[[(0.0, 0.0), (8.0, 0.0)]], [[(6.0, 0.0), (6.0, 4.0)]]], 0.0)
    assert order.needs[0][1].any()
    gate = int(np.argmax(order.needs[0][1] > 0))
    stands = [Standing(cell=gate - 1, free_s=10.0, drives=True, stops_m=0.0),
              Standing(cell=0, free_s=300.0, drives=False, stops_m=0.0)]
    assert Switching(order.crossings, (0, 1)).ask(0, stands.__getitem__, [False, False]) == ()


def test_a_robot_that_the_order_does_not_know_is_not_let_go_first() -> None:
    order, _, _ = head_on()
    switching = Switching(order.crossings, (0, 2))
    assert switching.ask(1, lambda _: Standing(0, 0.0, drives=False, stops_m=0.0), [False] * 3) == ()
    assert not switching.needs(0, 3)[1].any()


def test_a_mission_is_not_cut_off_where_a_robot_asked_after_the_failure() -> None:
    # Without the robot that failed, the answer might have been another one.
    for seed in range(6):
        ready = random_mission(seed, noisy=False)
        if ready is None:
            continue
        ways, sure = ways_of(ready), [RobotFate() for _ in ready.orders]
        whole = replace(played(ready, seed, sure, 0), asked_s=-math.inf)
        for number, own in enumerate(ready.orders):
            fates = [*sure[:number], RobotFate(sum(own.is_poi(site) for site in own.route)), *sure[number + 1:]]
            cut = cut_off(ways, ready.orders, whole, fates)
            if cut is None or cut.robots[number].end != "failed" or cut.robots[number].end_time_s < 2.0:
                continue
            failed_s = cut.robots[number].end_time_s
            assert cut_off(ways, ready.orders, replace(whole, asked_s=failed_s + 1.0), fates) is None
            assert cut_off(ways, ready.orders, replace(whole, asked_s=failed_s - 1.0), fates) is not None
            return
    pytest.fail("nothing to cut off")


@pytest.mark.long
def test_whole_missions_wait_less_with_an_order_that_may_switch_and_keep_all_laws() -> None:
    waited_s, switched = {False: 0.0, True: 0.0}, 0
    for seed in (4, 9, 11, 19):
        ready = random_mission(seed, noisy=True)
        assert ready is not None
        world = replace(ready.world, noise=replace(ready.world.noise, people=People(per_m=0.05, stop_s=10.0)))
        ready = replace(ready, world=world)
        ways, fates = ways_of(ready), tuple(RobotFate() for _ in ready.orders)
        order = first_order(ways, ready.orders, [bool(own.route) for own in ready.orders])
        for rollout in range(3):
            mission = played(ready, seed, fates, rollout)
            assert not broken(ready, mission)
            for switches in (False, True):
                drawn = [draw_noise(world.noise, seed, rollout, number) for number in range(len(fates))]
                run = TeamRun(world=world, ways=ways, orders=ready.orders, fates=fates, drawn=drawn, order=order,
                              noise_index=(seed, rollout), switches=switches)
                driven = drive_team(run, "kinematic", traced=False)
                waited_s[switches] += driven.waited_s
                switched += driven.switched
            assert mission.waited_s == driven.waited_s  # it is what missions are played with
    assert switched > 0
    assert waited_s[True] < waited_s[False]
