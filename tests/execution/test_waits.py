"""Waits on the way: where a path crosses a passage, how often it is shut, and that nothing but the place decides it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.choices import Fidelity
from sva_bench.execution.case import Case, Settings
from sva_bench.execution.drives import Drives
from sva_bench.execution.execute import execute
from sva_bench.execution.executed import Executed
from sva_bench.execution.waits import PEOPLE, HopWait, crossings_of, waits_on
from sva_bench.mission.plan import Plan
from sva_bench.robot.follower import stretches
from sva_bench.travel.fuel import fuel_costs
from sva_bench.world.model import Scenario
from sva_bench.world.noise import Noise, Passage, People
from tests.execution.conftest import Planned

DOOR = Passage(name="d1", ends_m=(2.0, 0.0, 2.0, 1.0), blocked=0.25, wait_s=30.0)
QUIET = Noise()
AHEAD = ((0.0, 0.5), (4.0, 0.5))
THERE = ("base", "p1", "p4", "base")
SURE = Scenario(name="s", availability={"uv1": 1.0, "uv2": 1.0})
# Across the small room's middle wall and the gap above it.
GAP = Passage(name="gap", ends_m=(3.0, 2.6, 3.0, 6.0), blocked=0.5, wait_s=7.0)


def crossed(*path: tuple[float, float], passage: Passage = DOOR) -> list[float]:
    return crossings_of(np.array(path), passage)


@pytest.mark.parametrize(("path", "at"), [
    (((0.0, 0.5), (4.0, 0.5)), [2.0]),
    (((4.0, 0.5), (0.0, 0.5)), [2.0]),  # either way
    (((0.0, 0.0), (4.0, 0.0)), [2.0]),  # by one end of it
    (((0.0, 1.0), (4.0, 1.0)), [2.0]),  # by the other
    (((0.0, 1.1), (4.0, 1.1)), []), (((0.0, -0.1), (4.0, -0.1)), []),  # past it
    (((0.0, 0.5), (1.9, 0.5)), []),  # not as far
    (((0.0, 0.5), (2.0, 0.5)), []), (((2.0, 0.5), (4.0, 0.5)), [0.0]),  # touching counts at one end alone
    (((0.0, 0.5), (2.0, 0.5), (4.0, 0.5)), [2.0]),  # a vertex on it is one crossing
    (((0.0, 0.5), (2.0, 0.5), (0.0, 0.6)), []),  # to it and back is none
    (((2.0, -1.0), (2.0, 2.0)), []),  # along it
    (((0.0, 0.2), (2.0, 0.2), (2.0, 0.8), (4.0, 0.8)), [2.6]),  # to it, along it, and through
    (((0.0, 0.2), (2.0, 0.2), (2.0, 0.8), (0.0, 0.8)), []),  # to it, along it, and back
    (((0.0, 0.2), (4.0, 0.2), (4.0, 0.8), (0.0, 0.8)), [2.0, 6.6]),  # there and back
    (((0.0, 0.2), (4.0, 0.2), (4.0, 2.0), (0.0, 2.0), (0.0, 0.5), (4.0, 0.5)), [2.0, 13.3])])
def test_crossings_by_cases(path: Sequence[tuple[float, float]], at: list[float]) -> None:
    assert_allclose(crossed(*path), at, atol=1e-12)


def test_a_slanting_passage_is_crossed_where_the_lines_meet() -> None:
    # From (1, 1) to (3, -1): y = 2 - x meets y = 0.5 at x = 1.5.
    slant = replace(DOOR, ends_m=(1.0, 1.0, 3.0, -1.0))
    assert_allclose(crossed(*AHEAD, passage=slant), [1.5])


def met(noise: Noise = QUIET, passages: Sequence[Passage] = (DOOR,), *, rollout: int = 0, robot: int = 0,
        path: Sequence[tuple[float, float]] = AHEAD, ends: tuple[str, str] = ("a", "b")) -> tuple[HopWait, ...]:
    return waits_on(stretches(np.array(path), 0.0), ends, noise, passages, 5, rollout, robot, 0.5)


def test_a_robot_waits_before_the_passage_and_not_in_it() -> None:
    assert met(passages=[replace(DOOR, blocked=1.0)]) == (HopWait(1.5, 30.0, 1.5, 0.5, "d1"),)
    near = met(passages=[replace(DOOR, blocked=1.0)], path=((1.8, 0.5), (4.0, 0.5)))
    assert near == (HopWait(0.0, 30.0, 1.8, 0.5, "d1"),)  # where it starts, if there is no room


def test_a_passage_is_found_shut_as_often_as_its_probability_says() -> None:
    # Over 4000 rollouts and two crossings each, independent: the mean of 8000 has a standard error of 0.005.
    there_and_back = ((0.0, 0.2), (4.0, 0.2), (4.0, 0.8), (0.0, 0.8))
    counts = np.array([len(met(rollout=k, path=there_and_back)) for k in range(4000)])
    assert counts.mean() / 2 == pytest.approx(0.25, abs=0.02)
    assert (counts == 2).mean() == pytest.approx(0.0625, abs=0.015)


def test_people_are_met_as_often_as_the_way_is_long_and_anywhere_on_it() -> None:
    # 4 m at 0.25 a metre: one on average, Poisson, so with a variance of 1 too; places uniform.
    waits = [met(Noise(people=People(per_m=0.25, stop_s=4.0)), (), rollout=k) for k in range(4000)]
    counts = np.array([len(found) for found in waits])
    assert counts.mean() == pytest.approx(1.0, abs=0.06)
    assert counts.var() == pytest.approx(1.0, abs=0.1)
    places = np.array([wait.along_m for found in waits for wait in found])
    assert np.histogram(places, 4, (0, 4))[0] / len(places) == pytest.approx(0.25, abs=0.03)
    assert {(wait.lasts_s, wait.cause, wait.y_m) for found in waits for wait in found} == {(4.0, PEOPLE, 0.5)}
    assert all(list(found) == sorted(found) for found in waits)


def test_what_a_robot_meets_depends_on_rollout_robot_place_and_passage_alone() -> None:
    half = replace(DOOR, blocked=0.5)
    other = replace(half, name="d2", ends_m=(3.0, 0.0, 3.0, 1.0))

    def shut(name: str, passages: Sequence[Passage], noise: Noise = QUIET, **key: int | tuple[str, str]
             ) -> list[bool]:
        return [name in {w.cause for w in met(noise, passages, rollout=k, **key)} for k in range(200)]  # type: ignore[arg-type]

    alone = shut("d1", [half])
    # Neither other passages, nor their order, nor people, nor other noise change it.
    assert shut("d1", [half, other]) == shut("d1", [other, half]) == alone
    assert shut("d1", [half], Noise(people=People(per_m=1.0, stop_s=1.0), wheel_gain_sd=0.1)) == alone
    # Another passage, robot, direction or pair of sites is drawn by itself.
    for apart in (shut("d2", [half, other]), shut("d1", [half], robot=1), shut("d1", [half], ends=("b", "a")),
                  shut("d1", [half], ends=("a", "c"))):
        assert 0.35 < np.mean(np.array(apart) == np.array(alone)) < 0.65


def test_a_more_likely_passage_is_shut_whenever_a_less_likely_one_is() -> None:
    # So sweeps over ``blocked`` meet the same luck.
    for k in range(200):
        assert len(met(rollout=k)) <= len(met(passages=[replace(DOOR, blocked=0.6)], rollout=k))


def test_a_passage_that_makes_nobody_wait_is_no_wait() -> None:
    assert met(passages=[replace(DOOR, blocked=1.0, wait_s=0.0)]) == ()


# In missions


def run(planned: Planned, plans: Sequence[Plan], fidelity: Fidelity = "kinematic", rollouts: int = 8,
        drives: Drives | None = None, **changes: object) -> list[Executed]:
    world = replace(planned.world, passages=(GAP,), **changes)  # type: ignore[arg-type]
    return execute(world, planned.costs, [Case(scenario=SURE, planner=str(k), plan=p) for k, p in enumerate(plans)],
                   Settings(seed=0, trials=rollouts, rollouts=rollouts, fidelity=fidelity), drives=drives)


def waits_by_leg(run: Executed, robot: str) -> dict[tuple[int, str, str], float]:
    return {(leg.rollout, leg.origin, leg.destination): leg.waited_s for leg in run.legs if leg.robot == robot}


def test_waits_are_those_of_the_place_whatever_the_plan_and_the_order(small: Planned) -> None:
    one, two = run(small, [Plan(routes={"uv1": THERE}), Plan(routes={"uv1": ("base", "p4", "base", "p1", "p4", "base")
                                                                      })])
    first, second = waits_by_leg(one, "uv1"), waits_by_leg(two, "uv1")
    shared = set(first) & set(second)
    assert shared
    assert any(first[key] > 0 for key in shared)
    assert all(first[key] == second[key] for key in shared)


def test_every_fidelity_has_the_same_waits_and_they_are_no_driving(small: Planned) -> None:
    plan, quiet = Plan(routes={"uv1": THERE, "uv2": THERE}), Noise()
    runs = [run(small, [plan], fidelity, 3, noise=quiet)[0] for fidelity in ("kinematic", "rollout", "physics")]
    assert runs[0].waited_s.sum() > 0
    for other in runs[1:]:
        assert_array_equal(other.waited_s, runs[0].waited_s)
    for one in runs:
        without = replace(GAP, wait_s=0.0)
        (free,) = execute(replace(small.world, passages=(without,), noise=quiet), small.costs,
                          [Case(scenario=SURE, planner="0", plan=plan)],
                          Settings(seed=0, trials=3, rollouts=3, fidelity="kinematic"))
        if one is runs[0]:
            assert_array_equal(one.fuel_used_s, free.fuel_used_s)  # tanks don't empty while a robot stands
            assert_allclose(one.end_time_s, free.end_time_s + one.waited_s, atol=1e-9)


def test_the_waits_of_a_repaired_leg_are_those_of_its_hops(small: Planned) -> None:
    # The direct way from p1 to p4 as dear as ten minutes: the leg runs by another site.
    times = small.costs["turtlebot2"].times
    i, j = times.sites.index("p1"), times.sites.index("p4")
    dear = times.time_ms.copy()
    dear[i, j] = 600_000
    costs = {"turtlebot2": fuel_costs(replace(times, time_ms=dear), 0.01)}
    hops = list(pairwise(costs["turtlebot2"].chain("p1", "p4")))
    assert len(hops) > 1
    crowded = replace(small.world, passages=(replace(GAP, blocked=1.0),),
                      noise=Noise(people=People(per_m=0.3, stop_s=2.0)))
    (done,) = execute(crowded, costs, [Case(scenario=SURE, planner="s", plan=Plan(routes={"uv1": THERE}))],
                      Settings(seed=0, trials=4, rollouts=4, fidelity="kinematic"))
    radius = small.world.robots[0].model.radius_m
    for rollout in range(4):
        expected = sum(wait.lasts_s for a, b in hops for wait in waits_on(
            times.course(a, b), (a, b), crowded.noise, crowded.passages, 0, rollout, 0, radius + 0.3))
        found = waits_by_leg(done, "uv1")[rollout, "p1", "p4"]
        assert found == pytest.approx(expected, abs=1e-9)
        assert found > 0
