"""Random shared missions: nobody touches, nobody waits for ever, every sum adds up, and all of it repeats."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

from sva_bench.execution.case import Settings
from sva_bench.execution.executed import Executed
from sva_bench.execution.outcome import RobotFate
from sva_bench.execution.shared.execute import execute_team
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.execution.shared.truncation import cut_off
from sva_bench.mission.failures import NEVER
from tests.execution.shared.invariants import broken, fates_of, played, ways_of
from tests.execution.shared.random_missions import Ready, random_mission

FEW = (*range(16), 1219)  # worlds, with 4 missions each; in the last a robot waits for one that fails in that moment


def missions(seeds: Iterable[int], each: int) -> Iterator[tuple[int, Ready, list[tuple[tuple[RobotFate, ...], int]]]]:
    """Worlds that have room for their robots, with the fates of some missions."""
    for seed in seeds:
        ready = random_mission(seed)
        if ready is not None:
            yield seed, ready, fates_of(ready, seed, each, rollouts=2)


def broken_in(seeds: Iterable[int], each: int, *, physics: bool = False) -> tuple[int, list[str]]:
    """How many missions were played, and what didn't hold in which."""
    count, found = 0, []
    for seed, ready, fates in missions(seeds, each):
        for trial, (fate, rollout) in enumerate(fates):
            mission = played(ready, seed, fate, rollout, physics=physics)
            count += 1
            found += [f"seed {seed}, trial {trial}: {said}" for said in broken(ready, mission, physics=physics)]
    return count, found


@pytest.mark.long
def test_no_shared_mission_breaks_a_rule() -> None:
    count, found = broken_in(FEW, 4)
    assert not found
    assert count >= 50


@pytest.mark.long
@pytest.mark.parametrize("first", range(1000, 5000, 100))
def test_no_shared_mission_of_many_breaks_a_rule(first: int) -> None:
    count, found = broken_in(range(first, first + 15), 5)  # 40 times: more than 2000 in all
    assert not found
    assert count >= 50


@pytest.mark.long
@pytest.mark.parametrize("first", range(5000, 5200, 10))
def test_no_shared_mission_in_physics_breaks_a_rule(first: int) -> None:
    count, found = broken_in(range(first, first + 9), 2, physics=True)  # 20 times: more than 200 in all
    assert not found
    assert count >= 10


def test_poses_that_touch_are_found() -> None:
    # The robots of this mission meet if nobody coordinates them.
    ready = next(r for seed in range(20) if (r := random_mission(seed, interaction="uncoordinated", family="maze",
                                                                   robots=5, noisy=False)) is not None)
    mission = played(ready, 0, [RobotFate()] * 5, 0)
    assert mission.contacts
    assert any("touch" in said for said in broken(ready, mission))


def same_missions(one: TeamDriven, other: TeamDriven) -> bool:
    """Whether two missions are equal to the bit, over time too."""
    return (
        (one.robots, one.stops, one.contacts, one.detours, one.replanned)
        == (other.robots, other.stops, other.contacts, other.detours, other.replanned)
        and all(np.array_equal(mine.leg_s, its.leg_s) and (mine.waits, mine.touches) == (its.waits, its.touches)
                for mine, its in zip(one.driven, other.driven, strict=True))
        and all(np.array_equal(mine.pose, its.pose)
                for trails in zip(one.trails, other.trails, strict=True)
                for legs in zip(*trails, strict=True) for mine, its in zip(*legs, strict=True)))


def test_a_shared_mission_is_the_same_when_it_is_played_again() -> None:
    for seed, ready, fates in missions(range(20, 24), 2):
        for fate, rollout in fates:
            assert same_missions(played(ready, seed, fate, rollout), played(ready, seed, fate, rollout))


@pytest.mark.long
def test_a_mission_cut_off_at_failures_is_the_mission_played_with_them() -> None:
    cut = 0
    for seed in range(12):
        ready = random_mission(seed, process="per_leg")
        if ready is None:
            continue
        ways = ways_of(ready)
        for fates, rollout in fates_of(ready, seed, 3, rollouts=2):
            unfailed = tuple(RobotFate(0 if fate.before_poi == 0 else NEVER) for fate in fates)
            if unfailed == fates:
                continue
            shorter = cut_off(ways, ready.orders, played(ready, seed, unfailed, rollout), fates)
            if shorter is not None:
                cut += 1
                assert same_missions(shorter, played(ready, seed, fates, rollout)), f"seed {seed}"
    assert cut


def executed(ready: Ready, executor: ProcessPoolExecutor | None) -> Executed:
    settings = Settings(seed=1, trials=12, rollouts=3, fidelity="kinematic", recorded=False)
    (found,) = execute_team(ready.world, ready.costs, [ready.case], settings, executor, None, {})
    return found


def test_shared_missions_are_the_same_on_one_worker_and_two() -> None:
    ready = random_mission(17, process="per_leg")
    assert ready is not None
    alone = executed(ready, None)
    with ProcessPoolExecutor(2) as executor:
        together = executed(ready, executor)
    for name in ("incentive", "value", "end_time_s", "fuel_used_s", "waited_s", "end", "pois_reached"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(together, name))
    assert alone.meetings is not None
    assert together.meetings is not None
    np.testing.assert_array_equal(alone.meetings.waited_s, together.meetings.waited_s)
