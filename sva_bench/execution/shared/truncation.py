"""Failures that touch nobody else: the mission without them, cut off, is the mission with them to the bit."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from sva_bench.execution.outcome import Assignment, Outcome, RobotFate
from sva_bench.execution.rules import settle
from sva_bench.execution.shared.own_ways import Disc, Ways
from sva_bench.execution.shared.players import TeamDriven
from sva_bench.robot.follower import CONTROL_HZ

_T = TypeVar("_T")
_STEP_S = 1.0 / CONTROL_HZ  # clocks of drivers go by it
_SETTLES_M = 0.01  # by which physics may move a robot that stands at a stop


def cut_off(ways: Ways, orders: Sequence[Assignment], whole: TeamDriven, fates: Sequence[RobotFate]
            ) -> TeamDriven | None:
    """A mission with failures from the one without.

    A robot that fails at a stop stands there, and nobody waits for it any more. So nothing changes for another one if
    it waits for that robot no more anyway, and none of its ways comes near.

    Args:
        ways: The ways of the robots.
        orders: Their orders.
        whole: The mission in which nobody fails on its way.
        fates: When each robot fails.

    Returns:
        The mission; ``None`` if a failure may touch another robot, or where it happens isn't known.
    """
    if whole.replanned:
        return None
    outcomes = [settle(own, driven, fate) if own.route else known
                for own, driven, fate, known in zip(orders, whole.driven, fates, whole.robots, strict=True)]
    cut = whole
    for number, (own, outcome, fate) in enumerate(zip(orders, outcomes, fates, strict=True)):
        if outcome.end != "failed" or fate.before_poi == 0:
            continue
        if outcome.driven_s >= fate.lifetime_s or whole.asked_s >= outcome.end_time_s - _STEP_S:
            return None  # without it another answer might have been given
        trail = whole.trails[number][:outcome.stops_reached]
        x, y, _ = trail[-1][-1].at if trail else whole.starts[number]
        disc = Disc(x_m=x, y_m=y, radius_m=ways.model(number).radius_m, name=own.robot)
        if any(_touched(ways, j, whole, outcome.end_time_s, disc) for j in range(len(orders)) if j != number):
            return None
        cut = _without_the_rest(cut, number, outcome)
    return cut


def _without_the_rest(mission: TeamDriven, number: int, outcome: Outcome) -> TeamDriven:
    """A mission without the legs of a robot after the stop at which it fails."""
    legs, driven = outcome.stops_reached, mission.driven[number]
    driven = replace(driven, leg_s=driven.leg_s[:legs], stuck=False, fault=None,
                     waits=tuple(wait for wait in driven.waits if wait.leg < legs),
                     touches=tuple(touch for touch in driven.touches if touch.leg < legs))
    return replace(
        mission, replanned=True, robots=_put(mission.robots, number, outcome),
        driven=_put(mission.driven, number, driven),
        stops=_put(mission.stops, number, mission.stops[number][:legs + 1]),
        trails=_put(mission.trails, number, mission.trails[number][:legs]),
        led_round=_put(mission.led_round, number, mission.led_round[number][:legs]))


def _put(values: tuple[_T, ...], number: int, value: _T) -> tuple[_T, ...]:
    """The same with another value at one place."""
    return (*values[:number], value, *values[number + 1:])


def _touched(ways: Ways, robot: int, whole: TeamDriven, since_s: float, disc: Disc) -> bool:
    """Whether a robot that stands from some time on makes a difference to another."""
    begun = _legs_done(whole.robots[robot], since_s)
    return any(wait.leg >= begun and wait.cause == disc.name for wait in whole.driven[robot].waits) or any(
        ways.blocked(robot, way, [disc], more_m=_SETTLES_M) is not None for way in whole.cuts[robot][begun:])


def _legs_done(outcome: Outcome, by_s: float) -> int:
    """Legs that were over by then."""
    if outcome.end_time_s <= by_s - _STEP_S and outcome.end != "failed":
        return sys.maxsize  # it drives no more
    return sum(event.kind == "arrived" and event.time_s < by_s - _STEP_S for event in outcome.events)
