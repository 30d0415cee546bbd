"""The rules where robots wait, tanks hold less, standing burns fuel and stations take their time.

base -10-> p1 -8-> r1 -6-> p2 -12-> base, stops of 1 s at p1, 4 s at r1, 2 s at p2; p1 earns 5, p2 earns 7.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.choices import ENDS, NEWS, News
from sva_bench.execution.chance import Drawn
from sva_bench.execution.margins import margins_of
from sva_bench.execution.outcome import Assignment, Driven, Outcome, RobotFate, Wait, trace_of
from sva_bench.execution.policies.none import none
from sva_bench.execution.rules import LegDriven, legs_of, settle
from sva_bench.execution.settling import FIGURES, settle_alike
from sva_bench.execution.team import Team, play
from sva_bench.mission.failures import NEVER

ROUTE = ("base", "p1", "r1", "p2", "base")
LEGS = (10.0, 8.0, 6.0, 12.0)
START = (0.0, 0.0, 0.0)


def orders(*, fuel: float = 20.0, limit: float = 500.0, idle: float = 0.0, charge: Mapping[str, float] | None = None,
           robot: str = "uv1") -> Assignment:
    return Assignment(robot=robot, route=ROUTE, stations=frozenset({"r1"}), incentives={"p1": 5.0, "p2": 7.0},
                      stop_s={"base": 0.0, "p1": 1.0, "r1": 4.0, "p2": 2.0}, fuel_capacity_s=fuel,
                      mission_limit_s=limit, loss_cost=3.0, planned_s=LEGS, idle_share=idle,
                      charge_rate=dict(charge or {}))


def driven(waits: Sequence[tuple[int, float]] = (), *, legs: Sequence[float] = LEGS, capacity: float = 1.0,
           stuck: bool = False, per_leg: int = 0) -> Driven:
    """A drive with waits of so long on some legs, half-way; x is how far it is along its way [s of driving]."""
    share = np.tile(np.arange(1, per_leg + 1) / max(per_leg, 1), len(legs))
    leg_of = np.repeat(np.arange(len(legs), dtype=np.float64), per_leg)
    clock = share * np.repeat(legs, per_leg)
    begun = np.concatenate([[0.0], np.cumsum(legs)])
    x = clock + np.repeat(begun[:-1], per_leg)
    return Driven(leg_s=np.array(legs), stuck=stuck, leg_of=leg_of, clock_s=clock,
                  pose=np.column_stack([x, 0 * x, 0 * x]), capacity=capacity,
                  waits=tuple(Wait(leg=leg, lasts_s=lasts, x_m=float(begun[leg] + legs[leg] / 2), y_m=0.0, cause="d1")
                              for leg, lasts in waits if leg < len(legs)))


def told(outcome: Outcome) -> tuple[object, ...]:
    return (outcome.end, outcome.end_time_s, outcome.fuel_used_s, outcome.waited_s, outcome.stops_reached,
            outcome.incentive)


def test_a_wait_takes_mission_clock_and_no_fuel() -> None:
    # Home at 43 s without it; fuel 36.
    assert told(settle(orders(), driven([(1, 30.0)]))) == ("home", 73.0, 36.0, 30.0, 4, 12.0)


def test_a_wait_makes_late_what_had_come_in_time() -> None:
    # p2 served at 31 s, and at 61 s after a wait of 30 s on the way to r1; home at 73 s.
    for limit, end, incentive in ((73.0, "home", 12.0), (72.9, "late", 12.0), (60.9, "late", 5.0)):
        outcome = settle(orders(limit=limit), driven([(1, 30.0)]))
        assert (outcome.end, outcome.incentive, outcome.lost) == (end, incentive, False)
    assert settle(orders(limit=43.0), driven()).end == "home"


def test_standing_burns_its_share_at_pois_and_while_waiting_and_not_at_stations() -> None:
    # A quarter: 10 + 1/4 at p1, 8 + 30/4 waiting, filled at r1; then 6 + 2/4 and 12: 36.75 + 7.5 in all.
    outcome = settle(orders(fuel=30.0, idle=0.25), driven([(1, 30.0)]))
    assert told(outcome) == ("home", 73.0, 44.25, 30.0, 4, 12.0)


def test_it_runs_dry_while_it_waits() -> None:
    # 20 - 10 - 0.25 = 9.75 left on leaving p1 at 11 s; at a quarter it lasts 39 s of waiting.
    outcome = settle(orders(idle=0.25), driven([(1, 40.0)]))
    assert told(outcome)[:3] == ("out_of_fuel", 50.0, 20.0)
    assert (outcome.stops_reached, outcome.lost, outcome.incentive, outcome.driven_s) == (1, True, 5.0, 10.0)
    # 30 s of waiting leave 2.25 for a leg of 8.
    outcome = settle(orders(idle=0.25), driven([(1, 30.0)]))
    assert told(outcome)[:3] == ("out_of_fuel", 11.0 + 30.0 + 2.25, 20.0)


def test_it_runs_dry_during_a_stop_before_it_has_collected() -> None:
    # Half: 0.2 left on arrival at p1 lasts 0.4 s of a stop of 1 s.
    outcome = settle(orders(fuel=10.2, idle=0.5), driven())
    assert told(outcome) == ("out_of_fuel", pytest.approx(10.4), pytest.approx(10.2), 0.0, 1, 0.0)
    assert outcome.lost
    assert outcome.pois_reached == 0


def test_at_home_nothing_is_burnt_any_more() -> None:
    # Exactly 18.5 s from the station home: 6 + 2/4 + 12.
    assert settle(orders(fuel=20.0, idle=0.25), driven()).end == "home"
    home = replace(orders(fuel=18.5, idle=0.25), stop_s={"base": 60.0, "p1": 1.0, "r1": 4.0, "p2": 2.0})
    assert settle(home, driven()).end == "home"


def test_a_tank_that_holds_less_runs_dry_sooner_and_is_no_shorter_limit() -> None:
    # 90 % of 20 is 18: just enough for 10 + 8 and 6 + 12; 89 % is not.
    assert told(settle(orders(), driven(capacity=0.9))) == ("home", 43.0, 36.0, 0.0, 4, 12.0)
    outcome = settle(orders(), driven(capacity=0.89))
    assert told(outcome)[:3] == ("out_of_fuel", pytest.approx(11 + 7.8), pytest.approx(17.8))
    # One that holds more goes further.
    assert settle(orders(fuel=17.0), driven()).end == "out_of_fuel"
    assert settle(orders(fuel=17.0), driven(capacity=1.06)).end == "home"


def test_a_station_that_takes_its_time_takes_it_by_what_was_burnt() -> None:
    # 18 s burnt at 3 s of driving a second: 6 s beside the stop of 4 s; 43 + 6.
    assert told(settle(orders(charge={"r1": 3.0}), driven()))[:3] == ("home", 49.0, 36.0)
    # What was burnt standing is filled too: (18 + 0.25 + 7.5) / 3.
    found = settle(orders(fuel=30.0, idle=0.25, charge={"r1": 3.0}), driven([(1, 30.0)]))
    assert found.end_time_s == pytest.approx(73 + 25.75 / 3)
    # It is full then, whatever it holds.
    assert settle(orders(charge={"r1": 3.0}), driven(capacity=0.9)).end == "home"


def test_charging_may_make_it_late() -> None:
    # r1 left at 29 s in place of 23: p2 is served at 37 s, home at 49.
    assert settle(orders(limit=49.0, charge={"r1": 3.0}), driven()).end == "home"
    outcome = settle(orders(limit=36.0, charge={"r1": 3.0}), driven())
    assert (outcome.end, outcome.incentive) == ("late", 5.0)


def test_waiting_ages_nobody_and_a_lifetime_ends_on_the_leg_after_the_wait() -> None:
    # 12 s of driving: 2 s into the second leg, which has a wait of 30 s; p1 is left at 11 s.
    outcome = settle(orders(), driven([(1, 30.0)]), RobotFate(lifetime_s=12.0))
    assert told(outcome) == ("failed", 43.0, 12.0, 30.0, 1, 5.0)
    # Dry while it waits, before its lifetime is over.
    outcome = settle(orders(idle=0.25), driven([(1, 40.0)]), RobotFate(lifetime_s=10.5))
    assert (outcome.end, outcome.available) == ("out_of_fuel", True)
    # A lifetime that is over on arrival: it fails as it drives on, and waits before that.
    outcome = settle(orders(), driven([(1, 30.0)]), RobotFate(lifetime_s=10.0))
    assert told(outcome)[:3] == ("failed", 41.0, 10.0)


def test_a_stuck_robot_waits_first_and_runs_dry_before_it_gives_up() -> None:
    legs = (10.0, 9.0)
    assert told(settle(orders(), driven([(1, 5.0)], legs=legs, stuck=True)))[:3] == ("stuck", 25.0, 19.0)
    outcome = settle(orders(idle=0.5), driven([(1, 5.0)], legs=legs, stuck=True))
    assert told(outcome)[:3] == ("out_of_fuel", 11 + 5 + 7.0, 20.0)


# Laws, under random everything

times = st.sampled_from([0.0, 0.1, 0.3, 1.7, 10.0])
waits = st.lists(st.tuples(st.integers(0, 3), st.sampled_from([0.0, 0.5, 3.0, 30.0])), max_size=4)
idles = st.sampled_from([0.0, 0.1, 0.25, 1.0])
rates = st.sampled_from([{}, {"r1": 0.7}, {"r1": 3.0}])
capacities = st.floats(0.4, 1.2)


@given(st.tuples(times, times, times, times), waits, capacities, st.floats(0.5, 40), st.floats(0, 90), idles, rates,
       st.booleans(), st.integers(1, 4), st.sampled_from([0, 1, 2, 3, NEVER]),
       st.lists(st.floats(0, 40) | st.just(np.inf), max_size=12))
def test_trials_settled_at_once_are_those_settled_one_by_one(
        legs: tuple[float, ...], found_shut: list[tuple[int, float]], capacity: float, fuel: float, limit: float,
        idle: float, charge: dict[str, float], stuck: bool, reached: int, before_poi: int, lifetimes: list[float]
) -> None:
    mine = orders(fuel=fuel, limit=limit, idle=idle, charge=charge)
    drive = driven(found_shut, legs=legs[:reached] if stuck else legs, capacity=capacity, stuck=stuck)
    at_stops = [0.0, *np.cumsum(legs).tolist(), settle(mine, drive).driven_s]  # the edges, to the bit
    lifetime = np.array(lifetimes + at_stops)
    found = settle_alike(mine, drive, before_poi, lifetime)
    alone = [settle(mine, drive, RobotFate(before_poi, float(one))) for one in lifetime]
    assert_array_equal(found["end"], [ENDS.index(outcome.end) for outcome in alone])
    for name in FIGURES:
        # Times differ by the order of adding alone.
        assert_allclose(found[name], [getattr(outcome, name) for outcome in alone], rtol=1e-12, atol=1e-9, err_msg=name)
    for name in ("available", "incentive", "lost", "value", "pois_reached", "stops_reached", "waited_s"):
        assert_array_equal(found[name], [getattr(outcome, name) for outcome in alone], err_msg=name)


@given(st.tuples(times, times, times, times), waits, capacities, st.floats(0.5, 40), st.floats(0, 90), idles, rates)
def test_margins_say_what_settling_says(
        legs: tuple[float, ...], found_shut: list[tuple[int, float]], capacity: float, fuel: float, limit: float,
        idle: float, charge: dict[str, float]) -> None:
    mine, drive = orders(fuel=fuel, limit=limit, idle=idle, charge=charge), driven(found_shut, legs=legs,
                                                                                   capacity=capacity)
    margins, outcome = margins_of(0, mine, [drive]), settle(mine, drive)
    assume(np.abs(margins.fuel_s).min() > 1e-5)  # within a tolerance of the edge either may be said
    assume(np.abs(margins.time_s).min() > 1e-5)
    dry = bool((margins.fuel_s < 0).any())
    assert dry == (outcome.end == "out_of_fuel")
    if dry:
        # It ran dry on the leg to the first stop with a negative margin, or while it stood there.
        first = int(np.flatnonzero(margins.fuel_s[0] < 0)[0])
        assert outcome.stops_reached in (first, first + 1)
    else:
        assert bool((margins.time_s < 0).any()) == (outcome.end == "late")
        assert mine.mission_limit_s - margins.time_s[0, -1] == pytest.approx(outcome.end_time_s)


@given(st.tuples(times, times, times, times), waits, capacities, st.floats(0.5, 40), st.sampled_from([25.0, 1000.0]),
       idles, rates, st.sampled_from(NEWS),
       st.sampled_from([RobotFate(), RobotFate(0), RobotFate(1), RobotFate(2), RobotFate(lifetime_s=11.0)]))
def test_a_team_that_keeps_its_plan_fares_as_its_robots_do_alone(
        legs: tuple[float, ...], found_shut: list[tuple[int, float]], capacity: float, fuel: float, limit: float,
        idle: float, charge: dict[str, float], news: News, fate: RobotFate) -> None:
    drives = [driven(found_shut, legs=legs, capacity=capacity), driven([(0, 3.0)])]
    own = [orders(fuel=fuel, limit=limit, idle=idle, charge=charge), orders(robot="uv2", idle=idle)]
    known = [legs_of(drive) for drive in drives]

    def leg(robot: int, stops: tuple[str, ...]) -> LegDriven:
        return known[robot][len(stops) - 2]

    team = Team(orders=tuple(own), base="base", pois=frozenset({"p1", "p2"}), policy=none, news=news,
                scheduled_s=lambda robot, origin, destination: 9.0)  # noqa: ARG005
    together = play(team, Drawn([fate, RobotFate()]), leg)
    for robot, (mine, drive, one) in enumerate(zip(own, drives, (fate, RobotFate()), strict=True)):
        assert told(together.robots[robot]) == told(settle(mine, drive, one))
        assert together.robots[robot].events == settle(mine, drive, one).events


# Traces

STEPS = 20


def test_a_trace_pauses_where_the_wait_is() -> None:
    # Half-way to r1, at x = 14, from 11 + 4 s on, for 30 s; the steps of a leg of 8 s are 0.4 s apart.
    mine, drive = orders(), driven([(1, 30.0)], per_leg=STEPS)
    trace = trace_of(mine, drive, settle(mine, drive), START, np.empty((0, 2)))
    gap = int(np.diff(trace.time_s).argmax())
    assert (trace.time_s[gap], trace.time_s[gap + 1]) == (pytest.approx(15.0), pytest.approx(45.0))
    assert trace.pose[gap, 0] == trace.pose[gap + 1, 0] == pytest.approx(14.0)
    assert trace.fuel_s[gap] == trace.fuel_s[gap + 1]


@given(waits, capacities, st.floats(0.5, 60), idles, rates,
       st.sampled_from([RobotFate(), RobotFate(0), RobotFate(1), RobotFate(2), RobotFate(lifetime_s=11.0)]))
def test_time_and_fuel_of_a_trace_are_those_of_the_mission(
        found_shut: list[tuple[int, float]], capacity: float, fuel: float, idle: float, charge: dict[str, float],
        fate: RobotFate) -> None:
    mine = replace(orders(fuel=fuel, idle=idle, charge=charge),
                   stop_s={"base": 3.0, "p1": 1.0, "r1": 4.0, "p2": 2.0})
    drive = driven(found_shut, capacity=capacity, per_leg=STEPS)
    outcome = settle(mine, drive, fate)
    trace = trace_of(mine, drive, outcome, START, np.empty((0, 2)))
    assert np.all(np.diff(trace.time_s) >= 0)
    assert trace.time_s[-1] == pytest.approx(outcome.end_time_s, abs=1e-5)
    assert np.all(trace.fuel_s <= fuel)
    assert np.all(trace.fuel_s >= -1e-6)
    # Fuel rises, by more than rounding, at the station alone, where it is full again.
    rises = np.flatnonzero(np.diff(trace.fuel_s) > 1e-9)
    assert len(rises) == sum(event.kind == "refuelled" for event in outcome.events)
    assert_allclose(trace.fuel_s[rises + 1], fuel)
    if outcome.end == "home" and len(rises):
        # From the station home: two legs, the stop at p2 and the waits of these legs, from a tank of such a capacity.
        burnt = LEGS[2] + LEGS[3] + idle * (2.0 + sum(lasts for leg, lasts in found_shut if leg >= 2))
        assert trace.fuel_s[-1] == pytest.approx(fuel - burnt / capacity)
    assert math.isfinite(trace.pose.sum())
