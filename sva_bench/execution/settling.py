"""Trials settled at once: those that share a drive differ in their lifetimes alone, and end alike on each leg."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.choices import ENDS
from sva_bench.execution.outcome import Assignment, Driven, Outcome, RobotFate
from sva_bench.execution.rules import settle
from sva_bench.mission.failures import NEVER

FIGURES = ("available", "incentive", "lost", "value", "pois_reached", "stops_reached", "end_time_s", "fuel_used_s",
           "driven_s", "waited_s", "contacts")


def settle_alike(orders: Assignment, driven: Driven, before_poi: int, lifetime_s: FloatArray) -> dict[str, FloatArray]:
    """What comes of trials of one robot and one drive, which differ in lifetimes alone.

    A lifetime decides on which leg the robot fails; what comes of that is the same for all lifetimes that end on that
    leg, but for the time driven on it. So one of each leg is settled, whatever the number of trials.

    Args:
        orders: Route and rules.
        driven: Driving time of its legs.
        before_poi: As in ``RobotFate``, of all trials.
        lifetime_s: Lifetime in each trial [s], shape (trials,).

    Returns:
        Figures of the outcomes by name, each of shape (trials,).
    """
    whole = settle(orders, driven, RobotFate(before_poi))
    # Driven time on arrival at each stop, and where the mission ends if no lifetime does before.
    until_s = np.append(np.cumsum(driven.leg_s[: whole.stops_reached]), whole.driven_s)
    fails_on = np.searchsorted(until_s, lifetime_s, side="right")
    legs, kind = np.unique(np.where(lifetime_s >= whole.driven_s, len(until_s), fails_on), return_inverse=True)
    # A robot whose lifetime is over on arrival fails as it sets off again.
    kinds = [whole if leg == len(until_s) else settle(orders, driven, RobotFate(
        before_poi, float(until_s[leg - 1]) if leg else 0.0)) for leg in legs.tolist()]
    figures = {name: values[kind] for name, values in figures_of(kinds).items()}
    driven_s = np.where(lifetime_s < whole.driven_s, lifetime_s, figures["driven_s"])
    further_s = driven_s - figures["driven_s"]  # than its like, on the same leg
    figures["end_time_s"] = figures["end_time_s"] + further_s
    figures["fuel_used_s"] = figures["fuel_used_s"] + further_s
    return {**figures, "driven_s": driven_s}


def figures_of(outcomes: Sequence[Outcome]) -> dict[str, FloatArray]:
    """Outcomes as columns, each of shape (outcomes,); counts are below 2^53."""
    return {"end": np.array([ENDS.index(o.end) for o in outcomes], dtype=np.float64),
            **{name: np.array([getattr(o, name) for o in outcomes], dtype=np.float64) for name in FIGURES}}


def left_by_draws(orders: Assignment, fails: IntArray, lifetime_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """What each trial's draw leaves of a route's value if each leg takes its planned time and nothing else goes wrong.

    Args:
        orders: Route and rules, with planned times where there are lifetimes.
        fails: Number of the POI before which it fails, shape (trials,).
        lifetime_s: Its lifetime [s], shape (trials,).

    Returns:
        The value, and whether the robot fails, both of shape (trials,).
    """
    visited = [site for site in orders.route if orders.is_poi(site)]
    collected = np.concatenate([[0.0], np.cumsum([orders.incentives.get(site, 0.0) for site in visited])])
    reached = np.where(fails == NEVER, len(visited), np.maximum(fails - 1, 0))
    failed = fails <= len(visited)
    leaves = fails > 0
    if np.isfinite(lifetime_s).any() and orders.route:
        until_s = np.cumsum(orders.planned_s)
        at_poi = until_s[[k for k, site in enumerate(orders.route[1:]) if orders.is_poi(site)]]
        reached = np.minimum(reached, np.searchsorted(at_poi, lifetime_s, side="right"))
        failed = failed | (lifetime_s < until_s[-1])
    value: FloatArray = collected[reached]
    if not orders.route:
        return value, np.zeros(len(fails), dtype=np.bool_)
    return value - np.where(failed & leaves, orders.loss_cost, 0.0), failed
