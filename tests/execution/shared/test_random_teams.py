"""Random missions of two to four robots in the open: whatever noise they have, they keep apart and all come home."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from sva_bench.execution.shared.driver import Member
from sva_bench.execution.shared.team_bullet import TeamBullet
from sva_bench.execution.shared.team_twin import TeamTwin
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.disturbance import Disturbance, ErrorField
from tests.execution.shared.teams import Mission, Tour, members_of, planned

HALF_M, FIELD_SD_M = 6.0, 0.05
ROOM = Obstacles(bounds_m=np.array([-8.0, -8.0, 8.0, 8.0]), boxes=np.empty((0, 5)), cylinders=np.empty((0, 3)))


def tours_of(seed: int, robots: int, legs: int = 6) -> list[Tour]:
    """From berths in a row through random places above it, and home."""
    rng = np.random.default_rng(seed)
    tours: list[Tour] = []
    for robot in range(robots):
        berth = (1.2 * robot - HALF_M + 1, -HALF_M + 1)
        places = [(float(x), float(y)) for x, y in rng.uniform(2.5 - HALF_M, HALF_M - 1, (legs - 1, 2))]
        stops = [berth, *places, berth]
        tours.append([[a, ((a[0] + b[0]) / 2 + rng.uniform(-1, 1), (a[1] + b[1]) / 2 + rng.uniform(0, 1)), b]
                      for a, b in pairwise(stops)])
    return tours


def disturbed(seed: int, robots: int, *, lost: bool) -> list[Disturbance]:
    """Robots at 0.5 to 1.2 of their speed, which draw to one side, obey late and, if lost, err about their place."""
    rng = np.random.default_rng([seed, 1])
    return [Disturbance(wheel_gains=(factor * float(rng.normal(1, 0.003)), factor), delay_s=float(rng.uniform(0, 0.12)),
                        track_gain=float(rng.normal(1, 0.02)), field=ErrorField(
                            sd_m=FIELD_SD_M, sd_rad=0.035, length_m=0.5, seed=(seed, robot)) if lost else None)
            for robot, factor in enumerate(rng.uniform(0.5, 1.2, robots).tolist())]


def team(seed: int, robots: int, *, lost: bool, draws: int) -> tuple[list[Tour], list[list[Member]], float]:
    """Tours, robots under some draws of noise, and the gap between hulls to plan with [m]."""
    tours = tours_of(seed, robots)
    members = [members_of(tours, disturbed(100 * seed + draw, robots, lost=lost)) for draw in range(draws)]
    return tours, members, 0.2 + 3 * math.sqrt(2) * FIELD_SD_M * lost


@pytest.mark.parametrize("lost", [False, True], ids=["gains and delays", "localisation too"])
@pytest.mark.parametrize("robots", [2, 3, 4])
def test_by_the_twin_robots_keep_apart_and_all_come_home(robots: int, lost: bool) -> None:
    for seed in range(3):
        tours, teams, gap_m = team(seed, robots, lost=lost, draws=8)
        order = planned(tours, 2.0, gap_m)
        for members in teams:
            mission = Mission(TeamTwin(members), order.lanes, stop_s=2.0)
            mission.begin(order)
            assert mission.go_on().kind == "idle"  # no touch, no deadlock
            assert [len(legs) for legs in mission.legs.values()] == [6] * robots


@pytest.mark.spread(1)
@pytest.mark.parametrize("robots", [2, 3, 4])
def test_in_physics_robots_keep_apart_and_all_come_home(robots: int) -> None:
    tours, teams, gap_m = team(7, robots, lost=True, draws=2)
    order = planned(tours, 2.0, gap_m)
    for members in teams:
        with TeamBullet(ROOM, members) as driver:
            mission = Mission(driver, order.lanes, stop_s=2.0)
            mission.begin(order)
            assert mission.go_on().kind == "idle"
            assert [len(legs) for legs in mission.legs.values()] == [6] * robots
            assert not any(leg.touches for legs in mission.legs.values() for leg in legs)
