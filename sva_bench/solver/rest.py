"""The rest of a mission planned: what reactions decide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sva_bench.mission.failures import process_of
from sva_bench.mission.instance import Instance
from sva_bench.mission.rest import Afield, Rest, instance_of_rest
from sva_bench.solver.goal import Goal
from sva_bench.solver.knowledge import SolveLimits, knowledge_of
from sva_bench.solver.routes.refuelling import VehicleLegs, quickest_home, quickest_route, vehicle_legs
from sva_bench.solver.solve import solve
from sva_bench.solver.units import in_own_units

MOST_POIS = 30
"""Open POIs up to which the rest is solved exactly; beyond, by the heuristic alone."""


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
    whole = rest.instance
    home = {v.name: _way_home(whole, v) for v in rest.vehicles}
    safe = tuple(v for v in rest.vehicles if home[v.name] is not None)
    kept = {site for v in rest.vehicles if home[v.name] is None for site in v.orders}
    rest = replace(rest, vehicles=safe, open_pois=rest.open_pois - kept)
    orders = home | (_solved(rest) if safe and rest.open_pois else {})
    return {name: route if route else home[name] for name, route in orders.items()}


def _way_home(whole: Instance, afield: Afield) -> tuple[str, ...] | None:
    """The quickest safe way home; nothing from the base itself."""
    vehicle = whole.vehicle(afield.name)
    site = whole.sites.index(afield.site)
    if site == whole.base:
        return ()
    found = quickest_home(vehicle_legs(whole, vehicle), site, afield.burnt_s, vehicle.mission_limit_s - afield.ready_s)
    return None if found is None else tuple(whole.sites[k] for k in found.route[1:])


def _solved(rest: Rest) -> dict[str, tuple[str, ...] | None]:
    """The best orders of vehicles that all have a safe way home; empty for those that do best to go home."""
    instance = instance_of_rest(rest)
    known = knowledge_of(instance)
    known.orders[_visits(instance, rest, known.legs_by_vehicle)] = None
    own, _ = in_own_units(instance)
    limits = SolveLimits()
    exact = len(rest.open_pois) <= MOST_POIS
    solution = solve(own, _goal(own), known, limits.clock(), limits.gap if exact else math.inf)
    return {v.name: tuple(instance.sites[k] for k in route[1:])
            for v, route in zip(instance.vehicles, solution.routes, strict=True)}


def _goal(own: Instance) -> Goal:
    terms = process_of(own.failure).terms([vehicle.reliability for vehicle in own.vehicles])
    weights = np.array([vehicle.incentives for vehicle in own.vehicles]) * terms.share[:, None]
    return Goal(weights=weights, survival=terms.survival)


def _visits(instance: Instance, rest: Rest, legs: Sequence[VehicleLegs]) -> tuple[tuple[int, ...], ...]:
    """The POIs of the old orders that are still open, of vehicles that can visit them: a plan to start from."""
    visits, taken = [], {instance.base, *instance.stations}
    for afield, own_legs in zip(rest.vehicles, legs, strict=True):
        order = tuple(instance.sites.index(site) for site in afield.orders if site in instance.sites)
        order = tuple(k for k in order if k not in taken)
        visits.append(order if quickest_route(own_legs, order) is not None else ())
        taken.update(visits[-1])
    return tuple(visits)
