"""The rest of a mission planned: what reactions decide."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sva_bench.mission.failures import process_of
from sva_bench.mission.instance import Instance
from sva_bench.mission.rest import Afield, Rest, instance_of_rest
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import SolveLimits, knowledge_of
from sva_bench.solver.routes.refuelling import VehicleLegs, quickest_route, vehicle_legs
from sva_bench.solver.routes.ways import way_home
from sva_bench.solver.solve import solve
from sva_bench.solver.two_stage import discounts_of
from sva_bench.solver.units import in_own_units, in_unit

MOST_POIS = 30
"""Open POIs up to which the rest is solved exactly; beyond, by the heuristic alone."""

_Way = tuple[float, tuple[str, ...]]
"""Driving time of a way home [s], and its sites; none from the base itself."""


def plan_rest(rest: Rest) -> dict[str, tuple[str, ...] | None]:
    """The orders of greatest expected value for what is left of a mission.

    A vehicle without a safe way home, by fuel or within its limit, keeps its orders and its POIs. The same rest, the
    same orders: the size of the problem alone decides how it is solved.

    Args:
        rest: The rest.

    Returns:
        Sites of each vehicle from where it is, the base last; empty if it stays at the base; ``None`` without a safe
        way home.
    """
    home = {v.name: way for v in rest.vehicles if (way := _way_home(rest.instance, v)) is not None}
    kept = {site for v in rest.vehicles if v.name not in home for site in v.orders}
    safe = replace(rest, vehicles=tuple(v for v in rest.vehicles if v.name in home), open_pois=rest.open_pois - kept)
    routes = _solved(safe, home) if home and safe.open_pois else {}
    return {v.name: routes.get(v.name) or home[v.name][1] if v.name in home else None for v in rest.vehicles}


def _way_home(whole: Instance, afield: Afield) -> _Way | None:
    """The safe way home of least driving."""
    vehicle, site = whole.vehicle(afield.name), whole.sites.index(afield.site)
    if site == whole.base:
        return 0.0, ()
    found = way_home(vehicle_legs(whole, vehicle), site, afield.burnt_s, vehicle.mission_limit_s - afield.ready_s)
    return None if found is None else (found[0], tuple(whole.sites[k] for k in found[1]))


def _solved(rest: Rest, home: Mapping[str, _Way]) -> dict[str, tuple[str, ...]]:
    """The best orders of vehicles that all have a safe way home; empty for those that do best to go home."""
    instance = instance_of_rest(rest)
    known = knowledge_of(instance)
    known.orders[_visits(instance, rest, known.legs_by_vehicle)] = None
    own, unit = in_own_units(instance)
    limits = SolveLimits()
    goal, clock = _goal(own, rest, home, unit), limits.clock()
    # What is proved anyway, and small, needs one start of the heuristic; beyond that size it is all there is.
    solution = solve(own, goal, known, clock, limits.gap, starts=1) if len(rest.open_pois) <= MOST_POIS else \
        solve(own, goal, known, clock, math.inf)
    return {v.name: tuple(instance.sites[k] for k in route[1:])
            for v, route in zip(instance.vehicles, solution.routes, strict=True)}


def _goal(own: Instance, rest: Rest, home: Mapping[str, _Way], unit: float) -> Goal:
    """The expected value of the rest, but for what vehicles that go straight home lose by failures on the way."""
    terms = process_of(own.failure).terms([vehicle.reliability for vehicle in own.vehicles])
    weights = np.array([vehicle.incentives for vehicle in own.vehicles]) * terms.share[:, None]
    discounts = discounts_of(terms)
    if discounts is not None:
        # A vehicle afield is lost on its way home too: leaving costs what going straight home would save.
        driven = np.array([afield.burnt_s + home[afield.name][0] for afield in rest.vehicles])
        straight = np.where(np.isinf(discounts.rate), 1.0, np.exp(-np.where(
            np.isinf(discounts.rate), 0.0, discounts.rate) * driven))
        discounts = replace(discounts, departure=in_unit(discounts.home * straight, unit),
                            home=in_unit(discounts.home, unit))
    return Goal(weights=weights, discounts=discounts)


def _visits(instance: Instance, rest: Rest, legs: Sequence[VehicleLegs]) -> tuple[tuple[int, ...], ...]:
    """The POIs of the old orders that are still open, of vehicles that can visit them: a plan to start from."""
    visits, taken = [], {instance.base, *instance.stations}
    for afield, own_legs in zip(rest.vehicles, legs, strict=True):
        order = tuple(instance.sites.index(site) for site in afield.orders if site in instance.sites)
        order = tuple(k for k in order if k not in taken)
        visits.append(order if quickest_route(own_legs, order) is not None else ())
        taken.update(visits[-1])
    return tuple(visits)
