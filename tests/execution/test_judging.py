"""A route judged under all noise draws at once, against the rules of the mission, draw by draw."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sva_bench.choices import FailureProcess
from sva_bench.execution.judging import judge_route
from sva_bench.execution.margins import margins_of
from sva_bench.execution.outcome import Assignment, Driven, Wait
from sva_bench.execution.rules import settle
from sva_bench.mission.failures import PROCESSES, Reliability, RouteProfile, process_of

ROUTE = ("base", "p1", "r1", "p2", "p3", "base")
LEGS = len(ROUTE) - 1
SURE = process_of("mission").terms([Reliability(availability=1.0)])


def orders_with(fuel_s: float, limit_s: float, idle_share: float = 0.0, loss_cost: float = 0.0) -> Assignment:
    return Assignment(
        robot="uv1", route=ROUTE, stations=frozenset({"r1"}), incentives={"p1": 1.0, "p2": 2.0, "p3": 4.0},
        stop_s={"base": 0.0, "p1": 1.0, "r1": 3.0, "p2": 0.0, "p3": 2.0}, fuel_capacity_s=fuel_s,
        mission_limit_s=limit_s, idle_share=idle_share, loss_cost=loss_cost)


def driven(leg_s: list[float], *, stuck: bool = False, capacity: float = 1.0, waits: tuple[Wait, ...] = ()) -> Driven:
    return Driven(leg_s=np.array(leg_s), stuck=stuck, capacity=capacity, waits=waits, leg_of=np.empty(0),
                  clock_s=np.empty(0), pose=np.empty((0, 3)))


@st.composite
def drives(draw: st.DrawFn) -> Driven:
    legs = draw(st.integers(1, LEGS))
    return driven(draw(st.lists(st.floats(0.5, 9.0), min_size=legs, max_size=legs)), stuck=legs < LEGS or draw(
        st.booleans()), capacity=draw(st.floats(0.6, 1.2)), waits=tuple(
            Wait(leg=leg, lasts_s=draw(st.floats(0.1, 8.0)), x_m=0.0, y_m=0.0, cause="people")
            for leg in draw(st.lists(st.integers(0, legs - 1), max_size=2))))


@given(drives(), st.floats(4.0, 30.0), st.floats(10.0, 60.0), st.sampled_from([0.0, 0.3]), st.sampled_from([0.0, 5.0]))
def test_what_comes_of_a_route_is_what_the_rules_make_of_it(
    drive: Driven, fuel_s: float, limit_s: float, idle: float, loss_cost: float
) -> None:
    orders = orders_with(fuel_s, limit_s, idle, loss_cost)
    outcome = settle(orders, drive)
    judged = judge_route(margins_of(0, orders, [drive]), SURE)
    assert bool(judged.bad[0]) == (outcome.end != "home")
    assert judged.value[0] == pytest.approx(outcome.value)


@pytest.mark.parametrize("process", PROCESSES)
@pytest.mark.parametrize("loss_cost", [0.0, 5.0])
def test_the_value_of_a_route_that_goes_well_is_that_of_its_failure_process(
    process: FailureProcess, loss_cost: float
) -> None:
    # POIs after 2, 7 and 10 s of driving, home after 14; all fits.
    reliability = Reliability(availability=0.7, mission_limit_s=100.0, loss_cost=loss_cost)
    orders = orders_with(50.0, 100.0, loss_cost=loss_cost)
    judged = judge_route(margins_of(0, orders, [driven([2.0, 2.0, 3.0, 3.0, 4.0])]),
                         process_of(process).terms([reliability]))
    exact = process_of(process).route_value(
        RouteProfile(incentives=(1.0, 2.0, 4.0), arrival_s=(2.0, 7.0, 10.0), home_s=14.0), reliability)
    assert not judged.bad[0]
    assert judged.value[0] == pytest.approx(exact)
