"""Legs driven once and put together: what is shared, what is composed, and how near that is to whole routes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.choices import Fidelity
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Courses, Drives, RouteKey, composed, drive_all
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.noise import draw_noise
from sva_bench.execution.outcome import Driven
from sva_bench.execution.touch import Touch
from sva_bench.mission.plan import Plan
from sva_bench.robot.disturbance import Disturbance
from sva_bench.travel.fuel import fuel_costs
from sva_bench.world.model import Scenario
from sva_bench.world.noise import Noise
from tests.execution.conftest import Planned

THERE = ("base", "p1", "p4", "base")
ALSO = ("base", "p1", "p2", "base")
SURE = Scenario(name="s", availability={"uv1": 1.0, "uv2": 1.0})


def settings_of(fidelity: Fidelity, rollouts: int = 2) -> Settings:
    return Settings(seed=0, trials=rollouts, rollouts=rollouts, fidelity=fidelity)


def hop(time_s: float, *, stuck: bool = False, contacts: int = 0) -> Driven:
    touch = Touch(since_s=0.0, lasted_s=0.1, x_m=0.0, y_m=0.0)
    return Driven(leg_s=np.array([time_s]), stuck=stuck, leg_of=np.zeros(2), clock_s=np.array([time_s / 2, time_s]),
                  pose=np.full((2, 3), time_s), touches=(touch,) * contacts)


def run(planned: Planned, fidelity: Fidelity, plans: Sequence[Plan], rollouts: int = 2, drives: Drives | None = None,
        **changes: object) -> list[Executed]:
    world = replace(planned.world, **changes)  # type: ignore[arg-type]
    return execute(world, planned.costs, [Case(scenario=SURE, planner=str(k), plan=p) for k, p in enumerate(plans)],
                   settings_of(fidelity, rollouts), drives=drives)


def test_a_route_is_put_together_leg_by_leg_and_hop_by_hop() -> None:
    whole = composed([[hop(3.0, contacts=1)], [hop(2.0), hop(4.0, contacts=2)]])
    assert_array_equal(whole.leg_s, [3.0, 6.0])
    assert_array_equal(whole.contacts, [1, 2])
    assert_array_equal(whole.leg_of, [0, 0, 1, 1, 1, 1])
    assert_array_equal(whole.clock_s, [1.5, 3.0, 1.0, 2.0, 4.0, 6.0])  # since the leg began
    assert not whole.stuck


def test_a_route_ends_where_the_robot_gets_stuck() -> None:
    whole = composed([[hop(3.0)], [hop(2.0), hop(1.5, stuck=True), hop(9.0)], [hop(7.0)]])
    assert_array_equal(whole.leg_s, [3.0, 3.5])
    assert whole.stuck


def test_plans_share_hops_and_each_is_driven_once(small: Planned) -> None:
    told: list[tuple[int, int]] = []
    drives = Drives()
    cases = [Case(scenario=SURE, planner=str(k), plan=Plan(routes={"uv1": route})) for k, route in
             enumerate((THERE, ALSO))]
    execute(small.world, small.costs, cases, settings_of("rollout"), None, lambda *now: told.append(now), drives)
    chain = small.costs["turtlebot2"].chain
    hops = {ends for route in (THERE, ALSO) for leg in pairwise(route) for ends in pairwise(chain(*leg))}
    assert told[-1] == (2 * len(hops), 2 * len(hops))  # two noise draws; base to p1 is driven once for both plans
    assert {(a, b) for _, _, a, b in drives.hops} == hops
    execute(small.world, small.costs, cases, settings_of("rollout"), None, lambda *_: pytest.fail("driven again"),
            drives)


def test_robots_of_one_model_that_nothing_disturbs_share_their_legs(small: Planned) -> None:
    both, one = Drives(), Drives()
    run(small, "rollout", [Plan(routes={"uv1": THERE, "uv2": THERE})], 1, both, noise=Noise())
    run(small, "rollout", [Plan(routes={"uv1": THERE})], 1, one, noise=Noise())
    assert set(both.hops) == set(one.hops)


def test_a_leg_begins_in_its_origins_own_pose_whatever_came_before(small: Planned) -> None:
    first, second = Drives(), Drives()
    run(small, "rollout", [Plan(routes={"uv1": THERE})], 1, first)
    run(small, "rollout", [Plan(routes={"uv1": ("base", "p2", "p1", "p4", "base")})], 1, second)
    shared = set(first.hops) & set(second.hops)
    assert shared
    for key in shared:
        assert_array_equal(first.hops[key].leg_s, second.hops[key].leg_s)


def test_composed_routes_are_within_half_a_per_cent_of_whole_ones(small: Planned) -> None:
    # Measured on the shipped worlds: benchmarks/composition.py.
    plans = [Plan(routes={"uv1": THERE, "uv2": ("base", "p2", "r1", "p3", "base")})]
    (parts,), (whole,) = (run(small, fidelity, plans, 3) for fidelity in ("rollout", "physics"))
    assert_array_equal(parts.end, whole.end)
    assert_allclose(parts.fuel_used_s, whole.fuel_used_s, rtol=0.005)
    for mine, other in zip(sorted(parts.legs, key=repr), sorted(whole.legs, key=repr), strict=True):
        assert (mine.origin, mine.destination, mine.rollout) == (other.origin, other.destination, other.rollout)
        assert mine.driven_s == pytest.approx(other.driven_s, rel=0.02, abs=0.1)


def test_a_repaired_leg_is_driven_as_its_hops(small: Planned) -> None:
    # Make the direct way from p1 to p4 as dear as ten minutes: the leg runs by another site.
    times = small.costs["turtlebot2"].times
    i, j = times.sites.index("p1"), times.sites.index("p4")
    dear = times.time_ms.copy()
    dear[i, j] = 600_000
    costs = {"turtlebot2": fuel_costs(replace(times, time_ms=dear), 0.01)}
    chain = costs["turtlebot2"].chain("p1", "p4")
    assert len(chain) > 2
    drives = Drives()
    (done,) = execute(small.world, costs, [Case(scenario=SURE, planner="s", plan=Plan(routes={"uv1": THERE}))],
                      settings_of("rollout", 1), drives=drives)
    gains = draw_noise(small.world.noise, 0, 0, 0).disturbance
    parts = [float(drives.hops["turtlebot2", gains, a, b].leg_s[0]) for a, b in pairwise(chain)]
    (leg,) = [leg for leg in done.legs if (leg.origin, leg.destination) == ("p1", "p4")]
    assert leg.driven_s == pytest.approx(sum(parts), abs=1e-9)


def test_what_workers_are_handed_has_one_course_and_follows_the_number_of_the_noise_draw(small: Planned) -> None:
    def keys_of(rollouts: int) -> list[tuple[object, ...]]:
        courses = Courses(small.world, small.costs, settings_of("rollout", rollouts))
        wanted: dict[RouteKey, bool] = {("uv1", THERE, k, 0): False for k in range(rollouts)}
        return [chunk.keys for chunk in courses.chunks(wanted, Drives())]

    few, many = keys_of(8), keys_of(16)
    assert all(len(keys) == 8 for keys in (*few, *many))
    assert set(few) < set(many)  # more noise draws never change what the first are packed into


def test_what_is_traced_later_is_driven_again_with_its_poses(small: Planned) -> None:
    drives, disturbance = Drives(), draw_noise(small.world.noise, 0, 0, 0).disturbance
    courses = Courses(small.world, small.costs, settings_of("rollout", 1))
    key = ("uv1", ("base", "p1", "base"), 0, 0)
    drive_all(courses.chunks({key: False}, drives), drives, None, None)
    bare = dict(drives.hops)
    drive_all(courses.chunks({key: True}, drives), drives, None, None)
    for hop_key, driven in drives.hops.items():
        assert isinstance(hop_key[1], Disturbance)
        assert hop_key[1] == disturbance
        assert len(bare[hop_key].pose) == 0 < len(driven.pose)
        assert_array_equal(driven.leg_s, bare[hop_key].leg_s)
