"""Waits and touches as events: at the time that they happen, and none that comes after a mission's end.

The route of ``test_outcome``: base -10-> p1 -8-> r1 -6-> p2 -12-> base, with a stop of 1 s at p1.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sva_bench.execution.outcome import Driven, RobotFate, Wait, met_on_leg, trace_of
from sva_bench.execution.rules import legs_of, settle
from sva_bench.execution.touch import Touch
from sva_bench.robot.disturbance import ErrorField
from tests.execution.test_outcome import START, driven, orders

DOOR = Wait(leg=1, lasts_s=5.0, x_m=26.0, y_m=1.0, cause="d1", since_s=2.0)
POST = Touch(since_s=4.0, lasted_s=0.5, x_m=3.0, y_m=4.0, solid="box 2", leg=1)


def met(**changes: object) -> Driven:
    return replace(driven(), waits=(DOOR,), touches=(POST,), **changes)  # type: ignore[arg-type]


def test_what_is_met_is_told_in_order_of_time_and_later_by_waits_before() -> None:
    late = replace(DOOR, since_s=6.0, cause="d2")
    events = met_on_leg("r1", 100.0, [late, DOOR], [POST], math.inf)
    assert [(e.time_s, e.kind, e.what, e.lasts_s) for e in events] == [
        (102, "waits", "d1", 5), (109, "touches", "box 2", 0.5), (111, "waits", "d2", 5)]
    assert events[1].at_m == (3.0, 4.0)


def test_a_mission_tells_of_waits_and_touches_on_the_way() -> None:
    # p1 is left at 11 s: the door at 13, the post after 5 s of waiting and 2 more of driving, r1 at 11 + 8 + 5.
    events = settle(orders(), met()).events
    assert [(e.time_s, e.kind, e.site) for e in events[3:6]] == [
        (13, "waits", "r1"), (20, "touches", "r1"), (24, "arrived", "r1")]


@pytest.mark.parametrize(("fuel", "told"), [(13.0, ["waits"]), (11.0, []), (15.0, ["waits", "touches"])])
def test_what_would_have_come_after_a_robot_ran_dry_is_not_told(fuel: float, told: list[str]) -> None:
    # 10 s to p1, so 3, 1 or 5 s of driving are left for the leg.
    outcome = settle(orders(fuel=fuel), met())
    assert outcome.end == "out_of_fuel"
    assert [e.kind for e in outcome.events if e.kind in ("waits", "touches")] == told
    assert outcome.events[-1].kind == "out_of_fuel"


def test_what_would_have_come_after_a_lifetime_is_not_told() -> None:
    outcome = settle(orders(), met(), RobotFate(lifetime_s=13.0))  # 3 s on the leg
    assert [e.kind for e in outcome.events[-2:]] == ["waits", "failed"]


def test_a_trace_tells_of_a_wait_when_the_robot_stands_there() -> None:
    # Pose k of the second leg is at x = 20 + k, after 0.4 k seconds; the door's place, x = 26, is the sixth.
    outcome = settle(orders(), met())
    trace = trace_of(orders(), met(), outcome, START, np.empty((0, 2)))
    (wait,) = [e for e in trace.outcome.events if e.kind == "waits"]
    assert wait.time_s == pytest.approx(11 + 2.4)
    standing = (trace.time_s >= wait.time_s - 1e-9) & (trace.time_s <= wait.time_s + wait.lasts_s + 1e-9)
    assert set(trace.pose[standing, 0]) == {26.0}
    assert [e.kind for e in trace.outcome.events] == [e.kind for e in outcome.events]
    times = [e.time_s for e in trace.outcome.events]
    assert times == sorted(times)


def test_a_robot_that_runs_dry_before_a_door_does_not_drive_on_to_it_in_its_trace() -> None:
    # 1 s of fuel on the leg, and the wait of 5 s counts all the same: it stands where the fuel is out.
    outcome = settle(orders(fuel=11.0), met())
    trace = trace_of(orders(fuel=11.0), met(), outcome, START, np.empty((0, 2)))
    assert trace.pose[-1, 0] <= 20 + 3  # 1 s of 8 is 2.5 of 20 poses


@pytest.mark.parametrize(("changes", "what"), [
    ({}, "box 2"), ({"fault": "tipped over"}, "tipped over"),
    ({"fault": "physics failed"}, "physics failed"),
    ({"touches": (replace(POST, leg=1, since_s=1.0), replace(POST, leg=0))}, "")])
def test_a_stuck_robot_says_what_holds_it(changes: dict[str, object], what: str) -> None:
    # It gives up 8 s or 20 s into the leg; contact 10 s before that is no reason.
    legs = (10.0, 20.0 if "touches" in changes else 8.0)
    stuck = replace(driven(legs, stuck=True), touches=(POST,))
    stuck = replace(stuck, **changes)  # type: ignore[arg-type]
    assert stuck.held_by == what
    assert settle(orders(fuel=100.0), stuck).events[-1].what == what
    assert [leg.held_by for leg in legs_of(stuck)] == ["", what]


def test_a_robot_that_gets_through_is_held_by_nothing() -> None:
    assert met().held_by == ""


def test_a_trace_says_where_a_lost_robot_believes_to_be() -> None:
    waves = ErrorField(sd_m=0.05, sd_rad=0.0, length_m=0.5, seed=(1, 2)).waves()
    outcome = settle(orders(), driven())
    trace = trace_of(orders(), driven(), outcome, START, np.empty((0, 2)), waves=waves)
    assert trace.believed.shape == (len(trace.time_s), 2)
    off = trace.believed - trace.pose[:, :2]
    assert 0 < np.abs(off).max() < 0.4
    assert_allclose(off[trace.pose[:, 0] == 26.0][0], off[trace.pose[:, 0] == 26.0][-1])  # by place, not by time
    assert not len(trace_of(orders(), driven(), outcome, START, np.empty((0, 2))).believed)
