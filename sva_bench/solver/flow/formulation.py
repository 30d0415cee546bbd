"""The collapsed model as arrays: columns, rows and objective. Knows no solver.

Columns ``y[m,i,j]`` for every leg of use, binary but between two stations, where a leg may be driven several times.
The paper's fuel ``x[i,j]`` on arrival over a leg out of POI i is written ``(s_i + f_ij) y_ij + w_ij`` with
``0 <= w_ij <= (F - t_j - s_i - f_ij) y_ij``: Proposition 2 with one row a leg. Out of a refuel ``x = f y``, (11),
so such legs need no fuel column. The mission limit gets the same treatment, as time is a fuel that is never refilled:
(14a) alone lets half a vehicle drive twice as far. A POI's idle burn counts with the leg to it, and where charging
takes time, ``x[i,r]`` over the charge rate counts in (14a) and in the flow of time. The paper's ``z_r`` doesn't appear:
the cuts ``y(out of S) >= y(into i)`` for POIs i (``cuts.py``) imply (3) with (4). They also cut cycles of POIs alone,
so legs that cost nothing do no harm.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.goal import Goal, sizes_of
from sva_bench.solver.preprocess import SLACK_S, Scope
from sva_bench.solver.program import LinearModel, RowBuilder


@dataclass(frozen=True, eq=False, kw_only=True)
class Legs:
    """The columns ``y``: vehicle, origin and destination of each, and which columns hold its fuel and time.

    Attributes:
        vehicle: Shape (legs,).
        origin: Shape (legs,).
        destination: Shape (legs,).
        fuel_column: Column of ``w`` for fuel, or -1, shape (legs,).
        time_column: Column of ``w`` for time, or -1, shape (legs,).
        number: Column of a (vehicle, origin, destination).
        columns: Number of columns in all.
    """

    vehicle: IntArray
    origin: IntArray
    destination: IntArray
    fuel_column: IntArray
    time_column: IntArray
    number: dict[tuple[int, int, int], int]
    columns: int

    def matrix(self, values: FloatArray, vehicle: int, n: int) -> FloatArray:
        """The ``y`` of one vehicle, shape (n, n)."""
        matrix = np.zeros((n, n))
        of = np.flatnonzero(self.vehicle == vehicle)
        matrix[self.origin[of], self.destination[of]] = values[of]
        return matrix


@dataclass(frozen=True, eq=False, kw_only=True)
class Resource:
    """What a route uses up: fuel until the next refuel, or time until the base.

    Attributes:
        through: Sites at which it isn't renewed, shape (n,).
        used_s: Least use of a leg [s], shape (n, n); of time, charging adds to it.
        least_s: Least use on leaving a site [s], shape (n,).
        onward_s: Least use from a site to the end of the count [s], shape (n,).
        capacity_s: Most use [s].
    """

    through: BoolArray
    used_s: FloatArray
    least_s: FloatArray
    onward_s: FloatArray
    capacity_s: float


def resources(instance: Instance, scope: Scope) -> tuple[Resource, Resource]:
    """Fuel and time of one vehicle."""
    between_refuels = np.zeros(len(instance.sites), dtype=np.bool_)
    between_refuels[list(instance.pois)] = True
    away = np.ones(len(instance.sites), dtype=np.bool_)
    away[instance.base] = False
    time = scope.time_s
    if scope.charging.any():
        i, j = np.nonzero(scope.legs & (scope.charging > 0)[None, :])
        time = time.copy()
        time[i, j] += scope.charging[j] * (scope.since_refuel_s[i] + scope.fuel_s[i, j])
    return (Resource(through=between_refuels, used_s=scope.fuel_s, least_s=scope.since_refuel_s,
                     onward_s=scope.to_refuel_s, capacity_s=scope.capacity_s),
            Resource(through=away, used_s=time, least_s=scope.since_start_s, onward_s=scope.to_end_s,
                     capacity_s=scope.limit_s))


def formulate(instance: Instance, scopes: Sequence[Scope], goal: Goal) -> tuple[LinearModel, Legs]:
    """The collapsed model, without the connectivity cuts.

    Args:
        instance: The instance.
        scopes: What each vehicle may do.
        goal: Objective and floors.

    Source:
        Constraints (1), (2), (5), (7), (9), (11), (14a) of the paper with Propositions 1 and 2; objective (17) with
        the recourse in closed form.
    """
    legs = _legs(instance, scopes)
    build = RowBuilder()
    integer = np.zeros(legs.columns, dtype=np.bool_)
    integer[:len(legs.vehicle)] = True
    upper = np.ones(legs.columns)
    upper[len(legs.vehicle):] = np.inf
    station = np.zeros(len(instance.sites), dtype=np.bool_)
    station[list(instance.stations)] = True
    hops = station[legs.origin] & station[legs.destination]
    # Between two POIs, or a POI and the base, a leg between stations is of use once.
    upper[:len(legs.vehicle)][hops] = len(instance.pois) + 1
    objective = np.zeros(legs.columns)
    objective[:len(legs.vehicle)] = goal.weights[legs.vehicle, legs.destination]
    charging = False
    for m, scope in enumerate(scopes):
        mine = np.flatnonzero(legs.vehicle == m)
        flows = resources(instance, scope)
        charges = _charges(legs, mine, scope)
        charging |= bool(charges)
        if goal.driving:
            objective[mine] -= goal.driving * flows[1].used_s[legs.origin[mine], legs.destination[mine]]
            for column, each_s in charges.values():
                objective[column] -= goal.driving * each_s
        _route_rows(build, instance, legs, mine, flows[1], charges)
        _flow_rows(build, legs, mine, legs.fuel_column, flows[0], {})
        _flow_rows(build, legs, mine, legs.time_column, flows[1], charges)
    for poi in instance.pois:  # (5)
        entering = np.flatnonzero(legs.destination == poi)
        if len(entering):
            build.add(entering, np.ones(len(entering)), -np.inf, 1.0)
    for (weights, floor), size in zip(goal.floors, sizes_of(goal.floors), strict=True):
        values = weights[legs.vehicle, legs.destination]
        counted = np.flatnonzero(values)
        build.add(counted, values[counted] / size, floor / size, np.inf)
    return LinearModel(objective=objective, upper=upper, integer=integer, rows=build.rows(),
                       aggregates=not charging), legs


def _legs(instance: Instance, scopes: Sequence[Scope]) -> Legs:
    found = [np.argwhere(scope.legs) for scope in scopes]
    vehicle = np.concatenate([np.zeros(0, dtype=np.int64), *(np.full(len(f), m) for m, f in enumerate(found))])
    pairs = np.concatenate([np.zeros((0, 2), dtype=np.int64), *found])
    columns, carried = len(vehicle), []
    for which in range(2):  # fuel, then time
        column = np.full(len(vehicle), -1)
        for m, scope in enumerate(scopes):
            resource = resources(instance, scope)[which]
            mine = np.flatnonzero((vehicle == m) & resource.through[pairs[:, 0]] & np.isfinite(resource.capacity_s))
            column[mine] = columns + np.arange(len(mine))
            columns += len(mine)
        carried.append(column)
    number = {(int(m), int(i), int(j)): k for k, (m, (i, j)) in enumerate(zip(vehicle, pairs, strict=True))}
    return Legs(vehicle=vehicle, origin=pairs[:, 0], destination=pairs[:, 1], fuel_column=carried[0],
                time_column=carried[1], number=number, columns=columns)


Charges = dict[int, tuple[int, float]]
"""Column ``w`` for fuel, and charging time for each unit of it [s], of the legs to where charging takes time."""


def _charges(legs: Legs, mine: IntArray, scope: Scope) -> Charges:
    """The charging times of one vehicle, beside those of the least fuel of a leg."""
    size = max(scope.capacity_s, 1.0)
    return {int(k): (int(legs.fuel_column[k]), float(scope.charging[legs.destination[k]]) * size) for k in mine
            if legs.fuel_column[k] >= 0 and scope.charging[legs.destination[k]] > 0}


def _route_rows(
    build: RowBuilder, instance: Instance, legs: Legs, mine: IntArray, clock: Resource, charges: Charges,
) -> None:
    """(1), (2) and (14a) of one vehicle; a POI is visited only if the base is left."""
    origin, destination = legs.origin[mine], legs.destination[mine]
    out_of_base = mine[origin == instance.base]
    for site in range(len(instance.sites)):
        entering, leaving = mine[destination == site], mine[origin == site]
        if not len(entering) and not len(leaving):
            continue
        balance = np.concatenate([np.ones(len(entering)), -np.ones(len(leaving))])
        build.add(np.concatenate([entering, leaving]), balance, 0.0, 0.0)
        if site == instance.base:
            build.add(leaving, np.ones(len(leaving)), -np.inf, 1.0)
        elif site not in instance.stations:
            others = out_of_base[legs.destination[out_of_base] != site]
            into = entering[legs.origin[entering] != instance.base]
            build.add(np.concatenate([others, into]), np.concatenate([np.ones(len(others)), -np.ones(len(into))]),
                      0.0, np.inf)
    if np.isfinite(clock.capacity_s) and len(mine):
        size = max(clock.capacity_s, 1.0)
        build.add([*mine, *(column for column, _ in charges.values())],
                  [*(clock.used_s[origin, destination] / size), *(each_s / size for _, each_s in charges.values())],
                  -np.inf, (clock.capacity_s + SLACK_S) / size)


def _flow_rows(
    build: RowBuilder, legs: Legs, mine: IntArray, column: IntArray, resource: Resource, charges: Charges,
) -> None:
    """What is used up on the way, in units of the capacity: conserved at a site, between its bounds on a leg."""
    if not np.isfinite(resource.capacity_s):
        return
    size = max(resource.capacity_s, 1.0)
    used, least, cost = resource.used_s, resource.least_s, resource.onward_s
    for k in mine:
        i, j, w = int(legs.origin[k]), int(legs.destination[k]), int(column[k])
        if w >= 0:
            room = max(resource.capacity_s + SLACK_S - least[i] - used[i, j] - cost[j], 0.0)
            build.add([w, int(k)], [1.0, -room / size], -np.inf, 0.0)
    for site in np.flatnonzero(resource.through):
        entering, leaving = mine[legs.destination[mine] == site], mine[legs.origin[mine] == site]
        if not len(entering):
            continue
        columns, values = [int(k) for k in column[leaving]], [1.0] * len(leaving)
        for k in entering:
            i, w = int(legs.origin[k]), int(column[k])
            before = 0.0 if w < 0 else least[i]
            columns.append(int(k))
            values.append((least[site] - before - used[i, site]) / size)
            if w >= 0:
                columns.append(w)
                values.append(-1.0)
            if int(k) in charges:
                columns.append(charges[int(k)][0])
                values.append(-charges[int(k)][1] / size)
        build.add(columns, values, 0.0, 0.0)


def columns_of(instance: Instance, legs: Legs, scopes: Sequence[Scope], routes: Sequence[Sequence[int]],
               ) -> FloatArray | None:
    """A plan as a point of the model; ``None`` where it uses a leg that the model leaves out.

    Args:
        instance: The instance.
        legs: The columns.
        scopes: What each vehicle may do.
        routes: Sites of each vehicle's route, from base to base; empty for one that stays home.
    """
    point = np.zeros(legs.columns)
    for m, route in enumerate(routes):
        flows = list(zip((legs.fuel_column, legs.time_column), resources(instance, scopes[m]), strict=True))
        used, excess = [0.0, 0.0], 0.0
        for i, j in itertools.pairwise(route):
            k = legs.number.get((m, i, j))
            if k is None:
                return None
            point[k] += 1
            for which, (column, resource) in enumerate(flows):
                before = used[which] if resource.through[i] else 0.0
                charge_s = float(scopes[m].charging[j]) * excess if which else 0.0  # of fuel above its least
                excess = max(before - resource.least_s[i], 0.0)
                if column[k] >= 0:
                    point[column[k]] += excess / max(resource.capacity_s, 1.0)
                used[which] = before + float(resource.used_s[i, j]) + charge_s
    return point
