"""How tight legs are under noise, by hand: four draws of one route of two legs."""

from __future__ import annotations

import numpy as np

from sva_bench.analysis.tightness import LegTightness, PlanTightness, tightness_of
from sva_bench.arrays import FloatArray
from sva_bench.execution.margins import Margins


def margins(fuel_s: FloatArray, time_s: FloatArray, leg_s: FloatArray | None = None, robot: int = 0) -> Margins:
    draws = len(fuel_s)
    return Margins(
        robot=robot, route=("base", "p1", "base"), is_poi=np.array([True, False]), fills=np.zeros(2, dtype=np.bool_),
        worth=np.array([5.0, 0.0]), leg_s=np.tile([8.0, 9.0], (draws, 1)) if leg_s is None else leg_s, fuel_s=fuel_s,
        time_s=time_s, planned_s=np.array([8.0, 9.0]))


def judged(*found: Margins, limits: tuple[float, float] = (20.0, 40.0)) -> PlanTightness:
    return tightness_of(["S1"], "stochastic", ["uv1", "uv2"], {"uv1": limits, "uv2": limits}, found)


PLENTY = np.full((4, 2), 10.0)


def legs(plan: PlanTightness) -> list[LegTightness]:
    return list(plan.legs)


def test_margins_are_quantiles_over_draws_and_shares_count_draws_below_zero() -> None:
    fuel = np.array([[6.0, 3.0], [5.0, -1.0], [4.0, 2.0], [7.0, 1.0]])
    first, second = legs(judged(margins(fuel, PLENTY)))
    assert second.fuel_margin_s is not None
    # Of four draws one in a hundred, and one in twenty, is the worst of all.
    assert (second.fuel_margin_s.q01, second.fuel_margin_s.q05) == (-1.0, -1.0)
    assert (first.dry, second.dry, second.late, second.stuck) == (0.0, 0.25, 0.0, 0.0)
    assert (first.judged, second.judged) == ("safe", "edge")
    assert judged(margins(fuel, PLENTY)).bad == 0.25


def test_little_is_a_twentieth_of_the_tank_or_of_the_limit() -> None:
    for limit, fuel, time in ((0.9, 0.9, 10.0), (1.9, 10.0, 1.9)):
        one = legs(judged(margins(np.full((4, 2), fuel), np.full((4, 2), time))))[0]
        assert one.judged == "close", limit
    assert legs(judged(margins(np.full((4, 2), 1.0), np.full((4, 2), 2.0))))[0].judged == "safe"


def test_a_draw_in_which_a_robot_never_arrives_is_wrong_and_has_no_margin() -> None:
    lost = np.array([[8.0, np.nan]] + [[8.0, 9.0]] * 3)
    nothing = np.where(np.isnan(lost), np.nan, 10.0)
    plan = judged(margins(nothing, nothing, lost))
    second = legs(plan)[1]
    assert (second.stuck, second.dry, second.judged, plan.bad) == (0.25, 0.0, "edge", 0.25)
    assert second.fuel_margin_s is not None
    assert second.fuel_margin_s.q01 is None


def test_robots_are_counted_together() -> None:
    dry = np.array([[1.0, -1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    late = np.array([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    assert judged(margins(dry, PLENTY), margins(PLENTY, late, robot=1)).bad == 0.5
    assert judged(margins(dry, PLENTY), margins(dry, PLENTY, robot=1)).bad == 0.25


def test_legs_on_a_knifes_edge_come_first_and_the_others_stay_in_order() -> None:
    dry = np.array([[1.0, -1.0]] + [[1.0, 1.0]] * 3)
    drier = np.array([[1.0, -1.0]] * 2 + [[1.0, 1.0]] * 2)
    plan = judged(margins(dry, PLENTY), margins(drier, PLENTY, robot=1))
    assert [(leg.robot, leg.leg) for leg in plan.worst_first] == [("uv2", 1), ("uv1", 1), ("uv1", 0), ("uv2", 0)]


def test_without_a_limit_there_is_no_margin_of_it() -> None:
    endless = np.full((4, 2), np.inf)
    first = legs(judged(margins(endless, PLENTY), limits=(np.inf, 40.0)))[0]
    assert first.fuel_margin_s is None
    assert first.judged == "safe"
