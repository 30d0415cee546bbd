"""Failures that touch nobody else: the mission without them, cut off, is the mission with them to the bit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from sva_bench.execution.outcome import Assignment, Driven, Outcome, RobotFate
from sva_bench.execution.rules import settle
from sva_bench.execution.shared.own_ways import Disc, Ways
from sva_bench.execution.shared.players import TeamDriven


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
    for number, (own, outcome, known, fate) in enumerate(zip(orders, outcomes, whole.robots, fates, strict=True)):
        if outcome.end_time_s == known.end_time_s and outcome.end == known.end:
            continue
        if fate.before_poi == 0:
            continue
        if outcome.end != "failed" or outcome.driven_s >= fate.lifetime_s:
            return None
        x, y, _ = ways.pose(number, own.route[outcome.stops_reached])
        disc = Disc(x_m=x, y_m=y, radius_m=ways.model(number).radius_m, name=own.robot)
        if any(_touched(ways, j, whole, outcome.end_time_s, disc) for j in range(len(orders)) if j != number):
            return None
    legs = [outcome.stops_reached if outcome.end == "failed" != known.end else len(driven.leg_s)
            for outcome, known, driven in zip(outcomes, whole.robots, whole.driven, strict=True)]
    return replace(
        whole, robots=tuple(outcomes), driven=tuple(map(_first_legs, whole.driven, legs)),
        stops=tuple(stops[:count + 1] if count < len(driven.leg_s) else stops
                    for stops, driven, count in zip(whole.stops, whole.driven, legs, strict=True)),
        trails=tuple(trail[:count] for trail, count in zip(whole.trails, legs, strict=True)))


def _first_legs(driven: Driven, count: int) -> Driven:
    """What a robot drove until it failed at a stop."""
    if count == len(driven.leg_s):
        return driven
    return replace(driven, leg_s=driven.leg_s[:count], stuck=False,
                   touches=tuple(touch for touch in driven.touches if touch.leg < count),
                   waits=tuple(wait for wait in driven.waits if wait.leg < count))


def _touched(ways: Ways, robot: int, whole: TeamDriven, since_s: float, disc: Disc) -> bool:
    """Whether a robot that stands from some time on makes a difference to another."""
    begun = _legs_done(whole.robots[robot], since_s)
    return any(wait.leg >= begun and wait.cause == disc.name for wait in whole.driven[robot].waits) or any(
        ways.blocked(robot, way, [disc]) is not None for way in whole.cuts[robot][begun:])


def _legs_done(outcome: Outcome, by_s: float) -> int:
    """Legs that were over by then."""
    if outcome.end_time_s <= by_s - 1.0 / 60.0 and outcome.end != "failed":
        return math.floor(1e9)
    return sum(event.kind == "arrived" and event.time_s < by_s - 1.0 / 60.0 for event in outcome.events)
