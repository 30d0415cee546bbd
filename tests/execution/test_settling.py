"""Trials that differ in lifetimes alone, settled at once; and the means of settled trials against closed forms."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from sva_bench.choices import ENDS
from sva_bench.execution.outcome import Assignment, Driven, RobotFate
from sva_bench.execution.rules import settle
from sva_bench.execution.settling import FIGURES, left_by_draws, settle_alike
from sva_bench.mission.failures import NEVER, Reliability, RouteProfile, process_of

ROUTE = ("base", "p1", "r1", "p2", "base")
LEGS = (10.0, 8.0, 6.0, 12.0)
MTBF_S = 25.0


def orders(*, fuel: float = 20.0, limit: float = 50.0, cost: float = 3.0) -> Assignment:
    return Assignment(robot="uv1", route=ROUTE, stations=frozenset({"r1"}), incentives={"p1": 5.0, "p2": 7.0},
                      stop_s={"base": 0.0, "p1": 1.0, "r1": 4.0, "p2": 2.0}, fuel_capacity_s=fuel,
                      mission_limit_s=limit, loss_cost=cost, planned_s=LEGS)


def driven(legs: tuple[float, ...] = LEGS, *, stuck: bool = False) -> Driven:
    return Driven(leg_s=np.array(legs), stuck=stuck, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))


legs = st.tuples(*[st.sampled_from([0.0, 0.1, 0.2, 0.3, 1.7, 10.0])] * 4)
edges = [sum(LEGS[:k]) for k in range(5)]


@given(legs, st.floats(0, 25), st.floats(0, 60), st.booleans(), st.integers(1, 4),
       st.sampled_from([0, 1, 2, 3, NEVER]), st.lists(st.floats(0, 40) | st.just(np.inf), max_size=12))
def test_trials_settled_at_once_are_those_settled_one_by_one(
        times: tuple[float, ...], fuel: float, limit: float, stuck: bool, reached: int, before_poi: int,
        lifetimes: list[float]) -> None:
    mine = orders(fuel=fuel, limit=limit)
    drive = driven(times[:reached] if stuck else times, stuck=stuck)
    at_stops = [0.0, *np.cumsum(times).tolist(), settle(mine, drive).fuel_used_s]  # the edges, to the bit
    lifetime = np.array(lifetimes + at_stops)
    found = settle_alike(mine, drive, before_poi, lifetime)
    alone = [settle(mine, drive, RobotFate(before_poi, float(one))) for one in lifetime]
    assert_array_equal(found["end"], [ENDS.index(outcome.end) for outcome in alone])
    for name in FIGURES:
        assert_array_equal(found[name], [getattr(outcome, name) for outcome in alone], err_msg=name)


def test_the_mean_over_all_lifetimes_is_the_closed_form_of_hazard() -> None:
    # Lifetimes at the midpoints of a million equal shares of probability: the sum is exact to a share.
    shares = 1_000_000
    lifetime = -MTBF_S * np.log1p(-(np.arange(shares) + 0.5) / shares)
    found = settle_alike(orders(), driven(), NEVER, lifetime)
    arrival = (10.0, 24.0)
    expected = process_of("hazard").route_value(
        RouteProfile(incentives=(5.0, 7.0), arrival_s=arrival, home_s=36.0),
        Reliability(availability=0.5, mtbf_s=MTBF_S, loss_cost=3.0))
    assert found["value"].mean() == pytest.approx(expected, abs=20 / shares)
    assert found["lost"].mean() == pytest.approx(1 - np.exp(-36.0 / MTBF_S), abs=2 / shares)
    drawn, failed = left_by_draws(orders(), np.full(shares, NEVER), lifetime)
    assert_array_equal(drawn, found["value"])  # driven as planned
    assert_array_equal(failed, found["lost"])


def test_the_mean_over_all_failures_is_the_closed_form_of_per_leg() -> None:
    s = 0.7
    share = {1: 1 - s, 2: s * (1 - s), NEVER: s * s}
    mean = sum(p * settle(orders(), driven(), RobotFate(k)).value for k, p in share.items())
    profile = RouteProfile(incentives=(5.0, 7.0))
    assert mean == pytest.approx(process_of("per_leg").route_value(profile, Reliability(availability=s, loss_cost=3.0)))


@given(st.lists(st.floats(0, 40), min_size=1, max_size=20), st.sampled_from([0, 1, 2, NEVER]))
def test_what_the_draws_leave_is_what_a_mission_as_planned_is_worth(lifetimes: list[float], before_poi: int) -> None:
    lifetime = np.array(lifetimes)
    left, failed = left_by_draws(orders(), np.full(len(lifetime), before_poi), lifetime)
    alone = [settle(orders(), driven(), RobotFate(before_poi, one)) for one in lifetimes]
    assert_array_equal(left, [outcome.value for outcome in alone])
    assert_array_equal(failed, [outcome.end == "failed" for outcome in alone])


def test_a_robot_that_stays_home_has_nothing_to_lose() -> None:
    idle = replace(orders(), route=(), planned_s=())
    left, failed = left_by_draws(idle, np.array([0, 1, NEVER]), np.array([0.0, 1.0, np.inf]))
    assert left.tolist() == [0.0, 0.0, 0.0]
    assert not failed.any()
    found = settle_alike(idle, driven(()), NEVER, np.array([0.0, 5.0]))
    assert found["value"].tolist() == [0.0, 0.0]
    assert found["end"].tolist() == [ENDS.index("home")] * 2


def test_a_stop_takes_no_lifetime() -> None:
    assert [b - a for a, b in pairwise(edges)] == list(LEGS)
    found = settle_alike(orders(), driven(), NEVER, np.array([10.5]))
    assert found["end_time_s"].tolist() == [11.5]  # 10 s to p1, a stop of 1 s, and half a second
