"""The rules of a mission, by hand: a route of four legs of 10, 8, 6 and 12 s.

base -10-> p1 -8-> r1 -6-> p2 -12-> base, stops of 1 s at p1, 4 s at r1, 2 s at p2; p1 earns 5, p2 earns 7.
On the clock: p1 reached at 10, left at 11; r1 at 19, left at 23; p2 at 29, left at 31; home at 43.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sva_bench.arrays import FloatArray
from sva_bench.execution.outcome import Assignment, Driven, Event, Outcome, RobotFate, trace_of
from sva_bench.execution.rules import settle
from sva_bench.mission.failures import NEVER

LEGS = (10.0, 8.0, 6.0, 12.0)
ROUTE = ("base", "p1", "r1", "p2", "base")
START = (1.0, 2.0, 0.5)


def orders(*, fuel: float = 20.0, limit: float = 50.0, route: tuple[str, ...] = ROUTE) -> Assignment:
    return Assignment(robot="uv1", route=route, stations=frozenset({"r1"}), incentives={"p1": 5.0, "p2": 7.0},
                      stop_s={"base": 0.0, "p1": 1.0, "r1": 4.0, "p2": 2.0}, fuel_capacity_s=fuel,
                      mission_limit_s=limit)


def driven(legs: tuple[float, ...] = LEGS, *, stuck: bool = False, per_leg: int = 20) -> Driven:
    """A drive with so many poses a leg; x counts them, y is the leg."""
    leg_of = np.repeat(np.arange(len(legs), dtype=np.float64), per_leg)
    share = np.tile(np.arange(1, per_leg + 1) / per_leg, len(legs))
    x = np.arange(1.0, len(leg_of) + 1)
    return Driven(leg_s=np.array(legs), stuck=stuck, leg_of=leg_of, clock_s=share * np.repeat(legs, per_leg),
                  pose=np.column_stack([x, leg_of, 0 * x]))


def told(outcome: Outcome) -> tuple[object, ...]:
    return (outcome.end, outcome.end_time_s, outcome.fuel_used_s, outcome.incentive, outcome.pois_reached,
            outcome.stops_reached)


def test_a_whole_mission_earns_everything_and_ends_home() -> None:
    # 10 + 8 <= 20 to the station, 6 + 12 <= 20 from it; 36 s of driving and 7 s of stops.
    outcome = settle(orders(), driven())
    assert told(outcome) == ("home", 43.0, 36.0, 12.0, 2, 4)
    assert outcome.available
    assert [(e.time_s, e.kind, e.site) for e in outcome.events] == [
        (0, "departed", "base"), (10, "arrived", "p1"), (11, "collected", "p1"), (19, "arrived", "r1"),
        (23, "refuelled", "r1"), (29, "arrived", "p2"), (31, "collected", "p2"), (43, "arrived", "base"),
        (43, "home", "base")]
    assert outcome.events[2] == Event(time_s=11, kind="collected", site="p1", incentive=5)


def test_a_robot_that_fails_at_the_base_never_leaves() -> None:
    outcome = settle(orders(), driven(), RobotFate(0))
    assert told(outcome) == ("failed", 0.0, 0.0, 0.0, 0, 0)
    assert not outcome.available
    # It needs no drive for that.
    nothing = Driven(leg_s=np.empty(0), stuck=False, leg_of=np.empty(0), clock_s=np.empty(0), pose=np.empty((0, 3)))
    assert told(settle(orders(), nothing, RobotFate(0))) == told(outcome)


def test_a_robot_that_fails_before_its_first_poi_stands_at_the_base() -> None:
    assert told(settle(orders(), driven(), RobotFate(1))) == ("failed", 0.0, 0.0, 0.0, 0, 0)


def test_a_robot_that_fails_before_its_second_poi_keeps_the_first_and_has_refuelled() -> None:
    # No draw for the leg to the station: it fails on leaving r1, at 23 s, with 18 s driven.
    outcome = settle(orders(), driven(), RobotFate(2))
    assert told(outcome) == ("failed", 23.0, 18.0, 5.0, 1, 2)
    assert outcome.events[-2:] == (Event(time_s=23, kind="refuelled", site="r1"),
                                   Event(time_s=23, kind="failed", site="r1"))


def test_a_failure_before_a_poi_that_is_not_on_the_route_changes_nothing_but_the_draw() -> None:
    outcome = settle(orders(), driven(), RobotFate(3))
    assert told(outcome) == told(settle(orders(), driven()))


def test_a_robot_runs_out_of_fuel_in_the_middle_of_a_leg() -> None:
    # 15 s of fuel: 10 to p1, and 5 of the 8 to r1; the stop at p1 burns none. The clock stands at 10 + 1 + 5.
    outcome = settle(orders(fuel=15), driven())
    assert told(outcome) == ("out_of_fuel", 16.0, 15.0, 5.0, 1, 1)
    assert outcome.events[-1] == Event(time_s=16, kind="out_of_fuel", site="r1")
    assert outcome.available


def test_a_robot_may_run_out_after_a_refuel_too() -> None:
    # 18 s reach the station exactly; from it 6 + 12 = 18 s would, 6 + 12.5 don't: 0.5 s are missing.
    assert settle(orders(fuel=18), driven()).end == "home"
    outcome = settle(orders(fuel=18), driven((10.0, 8.0, 6.0, 12.5)))
    assert told(outcome) == ("out_of_fuel", 43.0, 36.0, 12.0, 2, 3)


def test_fuel_that_is_missing_by_less_than_the_tolerance_is_enough() -> None:
    assert settle(orders(fuel=18 - 9e-7), driven()).end == "home"
    assert settle(orders(fuel=18 - 2e-6), driven()).end == "out_of_fuel"


def test_without_any_fuel_it_goes_nowhere() -> None:
    assert told(settle(orders(fuel=0), driven())) == ("out_of_fuel", 0.0, 0.0, 0.0, 0, 0)


def test_a_late_robot_earns_nothing_more_and_ends_late_when_home() -> None:
    # p2's stop is over at 31 s: with a limit of 30 s it earns nothing, though it was reached at 29.
    outcome = settle(orders(limit=30), driven())
    assert told(outcome) == ("late", 43.0, 36.0, 5.0, 2, 4)
    assert [(e.time_s, e.kind) for e in outcome.events if e.kind in ("late", "collected")] == [
        (11, "collected"), (31, "late"), (43, "late")]  # told when it passes the limit, and as its end
    assert settle(orders(limit=31), driven()).incentive == 12  # on the very second it does; it is late home, though
    assert settle(orders(limit=31), driven()).end == "late"
    assert settle(orders(limit=43), driven()).end == "home"
    assert settle(orders(limit=43 - 9e-7), driven()).end == "home"
    assert settle(orders(limit=43 - 2e-6), driven()).end == "late"


def test_a_late_robot_that_runs_dry_or_fails_does_not_end_late() -> None:
    assert settle(orders(limit=5, fuel=15), driven()).end == "out_of_fuel"
    assert settle(orders(limit=5), driven(), RobotFate(2)).end == "failed"


def test_a_robot_that_gets_stuck_keeps_what_it_has() -> None:
    # It gives up 9 s into the third leg: 10 + 1 + 8 + 4 + 9 on the clock, 27 s driven.
    outcome = settle(orders(), driven((10.0, 8.0, 9.0), stuck=True))
    assert told(outcome) == ("stuck", 32.0, 27.0, 5.0, 1, 2)
    assert settle(orders(), driven((10.0, 8.0, 25.0), stuck=True)).end == "out_of_fuel"  # its wheels turned till dry


def test_a_robot_fails_before_it_would_get_stuck() -> None:
    assert settle(orders(), driven((10.0, 8.0, 9.0), stuck=True), RobotFate(2)).end == "failed"


def test_stops_burn_no_fuel_but_count_to_the_clock() -> None:
    slow = Assignment(robot="uv1", route=ROUTE, stations=frozenset({"r1"}), incentives={},
                      stop_s={"base": 100.0, "p1": 1000.0, "r1": 0.0, "p2": 0.0}, fuel_capacity_s=18.0,
                      mission_limit_s=math.inf)
    # The robot waits 1000 s at p1; the stop at the base at the end is served too, none before it leaves.
    assert told(settle(slow, driven())) == ("home", 1136.0, 36.0, 0.0, 2, 4)


@pytest.mark.parametrize("fails", [0, 1, 5, NEVER])
def test_an_empty_route_ends_home_whatever_the_draw(fails: int) -> None:
    outcome = settle(orders(route=()), driven(()), RobotFate(fails))
    assert told(outcome) == ("home", 0.0, 0.0, 0.0, 0, 0)
    assert outcome.available == (fails == NEVER)


durations = st.floats(0.001, 30)


@given(st.tuples(durations, durations, durations, durations), st.floats(0, 60), st.floats(0, 120),
       st.sampled_from([0, 1, 2, 3, NEVER]), st.booleans(), st.integers(1, 4))
def test_laws_of_every_outcome(legs: tuple[float, ...], fuel: float, limit: float, fails: int, stuck: bool, reached: int
                               ) -> None:
    mine, drive = orders(fuel=fuel, limit=limit), driven(legs[:reached] if stuck else legs, stuck=stuck)
    outcome = settle(mine, drive, RobotFate(fails))
    assert 0 <= outcome.fuel_used_s <= min(sum(legs), 2 * fuel) + 2e-6  # two fillings at most
    assert outcome.fuel_used_s <= outcome.end_time_s + 1e-9
    assert 0 <= outcome.incentive <= 12
    assert outcome.incentive == sum(e.incentive for e in outcome.events)
    times = [e.time_s for e in outcome.events]
    assert times == sorted(times)
    assert outcome.events[-1].kind == outcome.end
    assert outcome.events[-1].time_s == outcome.end_time_s
    assert (outcome.end == "home") <= (outcome.end_time_s <= limit + 1e-6)
    # More of everything is never worse.
    assert settle(orders(fuel=fuel + 5, limit=limit + 5), drive, RobotFate(fails)).incentive >= outcome.incentive
    assert settle(mine, drive, RobotFate(NEVER)).incentive >= outcome.incentive


# Traces


def traced(mine: Assignment, drive: Driven, fails: int = NEVER) -> tuple[Outcome, FloatArray, FloatArray, FloatArray]:
    outcome = settle(mine, drive, RobotFate(fails))
    trace = trace_of(mine, drive, outcome, START, np.empty((0, 2)))
    return outcome, trace.time_s, trace.pose, trace.fuel_s


def test_a_trace_runs_from_the_start_to_home_with_the_stops_put_in() -> None:
    # Two poses a leg, at half time and at its end; a pose more at the end of each stop.
    _, time, pose, fuel = traced(orders(), driven(per_leg=2))
    assert_allclose(time, [0, 5, 10, 11, 15, 19, 23, 26, 29, 31, 37, 43])
    assert_allclose(pose[:, 0], [1, 1, 2, 2, 3, 4, 4, 5, 6, 6, 7, 8])
    assert_allclose(fuel, [20, 15, 10, 10, 6, 2, 20, 17, 14, 14, 8, 2])
    assert_array_equal(pose[0], START)


@pytest.mark.parametrize(("fuel", "limit", "fails"), [
    (20, 50, NEVER), (20, 30, NEVER), (15, 50, NEVER), (20, 50, 2), (20, 50, 1), (20, 50, 0), (math.inf, 50, 2)])
def test_a_trace_ascends_and_is_cut_off_where_the_mission_ends(fuel: float, limit: float, fails: int) -> None:
    outcome, time, pose, left = traced(orders(fuel=fuel, limit=limit), driven(), fails)
    assert np.all(np.diff(time) > 0)
    assert time[0] == 0
    assert time[-1] == pytest.approx(outcome.end_time_s, abs=1e-6)
    assert len(time) == len(pose) == len(left)
    assert np.all(left >= -1e-6)
    assert np.all(np.isinf(left)) == math.isinf(fuel)


def test_the_last_pose_is_that_of_the_drive_and_of_the_cut() -> None:
    drive = driven()
    assert_array_equal(traced(orders(), drive)[2][-1], drive.pose[-1])
    # Fails on leaving r1: the last pose of the second leg.
    assert_array_equal(traced(orders(), drive, 2)[2][-1], drive.pose[39])
    # Out of fuel after 5 of 8 s of the second leg: its poses are 0.4 s apart, so the last is that at 4.8 s.
    assert_array_equal(traced(orders(fuel=15), drive)[2][-1], drive.pose[20 + 11])
    assert_array_equal(traced(orders(), drive, 0)[2], [START])


def test_a_trace_that_runs_dry_ends_with_an_empty_tank() -> None:
    assert traced(orders(fuel=15), driven())[3][-1] == pytest.approx(0.0, abs=1e-9)


def test_the_trace_of_a_robot_that_stays_home_is_its_start() -> None:
    _, time, pose, _ = traced(orders(route=()), driven(()))
    assert_array_equal(time, [0])
    assert_array_equal(pose, [START])


def test_arrays_of_a_drive_must_fit_each_other_and_hold_no_nan() -> None:
    with pytest.raises(ValueError, match="shape"):
        Driven(leg_s=np.zeros(1), stuck=False, leg_of=np.zeros(2), clock_s=np.zeros(2), pose=np.zeros((3, 3)))
    with pytest.raises(ValueError, match="NaN"):
        Driven(leg_s=np.array([np.nan]), stuck=False, leg_of=np.zeros(0), clock_s=np.zeros(0), pose=np.zeros((0, 3)))
    drive = driven()
    with pytest.raises(ValueError, match="read-only"):
        drive.leg_s[0] = 1.0
