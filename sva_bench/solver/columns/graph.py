"""The graph that pricing works on, and its ng-sets: the POIs that each site remembers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sva_bench.arrays import BoolArray, FloatArray, IntArray
from sva_bench.mission.instance import Instance
from sva_bench.solver.discounts import NO_DISCOUNT, Discount, greatest_survival, leg_survival
from sva_bench.solver.preprocess import SLACK_S, Scope, is_metric

NG_START, NG_MOST = 7, 14  # POIs that a site remembers at first, and at most
_MOST_VISITS = 1_000_000  # counted on a route whose legs may take no time
_WITHIN = 0.9  # share of the feasibility tolerance used here: sums in another order differ by rounding


@dataclass(frozen=True, eq=False, kw_only=True)
class Graph:
    """The graph of one vehicle, for pricing.

    Attributes:
        base: The base.
        bit: Number of each POI, -1 for base and stations, shape (n,).
        legs: Whether a leg is of use, shape (n, n).
        time_s: Time of a leg with half the stops at its ends [s], shape (n, n).
        fuel_s: Fuel of a leg with half that of the stops at its ends [s], shape (n, n).
        charging: Time that a stop takes for each second of fuel burnt since the last refuel, shape (n,).
        capacity_s: Fuel capacity, tolerance included [s].
        limit_s: Mission limit, tolerance included [s]; finite.
        discount: The vehicle's discount.
        survival: Probability to survive a leg, of use or not, shape (n, n).
        arrival: Greatest probability to get to a site, of the base: back to it, shape (n,).
        most_visits: Upper bound on the visits of POIs of a route, repeated ones included.
        least_survival: Lower bound on the probability to survive a whole route.
        driving: Least share of driving in the time of a leg, half the stops at its ends and charging included.
        symmetric: Whether costs are symmetric, charging takes no time, and rewards independent of the way to them.
        metric: Whether no detour is quicker, or burns less, than a direct leg.
    """

    base: int
    bit: IntArray
    legs: BoolArray
    time_s: FloatArray
    fuel_s: FloatArray
    charging: FloatArray
    capacity_s: float
    limit_s: float
    discount: Discount
    survival: FloatArray
    arrival: FloatArray
    most_visits: int
    least_survival: float
    driving: float
    symmetric: bool
    metric: bool

    @property
    def is_plain(self) -> bool:
        """Whether rewards don't depend on the way to them."""
        return self.discount.is_plain


def graph_of(instance: Instance, scope: Scope, discount: Discount = NO_DISCOUNT) -> Graph:
    """The pricing graph of a vehicle.

    Args:
        instance: The instance.
        scope: The vehicle's legs and bounds.
        discount: Its discount.
    """
    n = len(instance.sites)
    bit = np.full(n, -1, dtype=np.int64)
    bit[list(instance.pois)] = np.arange(len(instance.pois))
    binding = math.isfinite(scope.capacity_s)
    fuel = _fuel_of_legs(scope) if binding else np.zeros((n, n))
    drive = scope.time_s - instance.stop_s[None, :]
    time = drive + (instance.stop_s[:, None] + instance.stop_s[None, :]) / 2
    legs = scope.legs
    charging = np.where(legs.any(axis=0), scope.charging, 0.0)
    slowest = time + fuel * charging.max() if charging.any() else time
    # Without a mission limit this is an upper bound on a route: each POI once, all stations between any two.
    limit = scope.limit_s if math.isfinite(scope.limit_s) else \
        float(slowest[legs].max(initial=0.0)) * (len(instance.pois) + 1) * (len(instance.stations) + 1)
    symmetric = discount.is_plain and np.array_equal(legs, legs.T) and np.array_equal(time[legs], time.T[legs]) \
        and np.array_equal(fuel[legs], fuel.T[legs]) and not charging.any()
    survival = leg_survival(scope.driven_s, bit >= 0, discount)
    arrival = np.ones(n) if discount.is_plain else greatest_survival(np.where(legs, survival, 0.0), instance.base)
    shortest = float(time[:, bit >= 0][legs[:, bit >= 0]].min(initial=np.inf))
    visits = int(limit / max(shortest, limit / _MOST_VISITS)) + 1
    longest_s, least_share = _driving(scope, legs, drive, time, slowest, limit)
    return Graph(base=instance.base, bit=bit, legs=legs, time_s=np.where(legs, time, 0.0),
                 fuel_s=np.where(legs, fuel, 0.0), charging=charging, capacity_s=scope.capacity_s + _WITHIN * SLACK_S,
                 limit_s=limit + _WITHIN * SLACK_S, discount=discount, survival=survival,
                 arrival=arrival,
                 most_visits=visits, least_survival=discount.chance(visits, longest_s), driving=least_share,
                 symmetric=bool(symmetric), metric=_is_metric(scope, instance.base))


def _fuel_of_legs(scope: Scope) -> FloatArray:
    """Fuel of a leg with half that of the stops at its ends [s], shape (n, n): so that it may be symmetric."""
    if not scope.idle_s.any():
        return scope.fuel_s
    halves = (scope.idle_s[:, None] + scope.idle_s[None, :]) / 2
    return np.where(np.isfinite(scope.fuel_s), scope.driven_s + halves, np.inf)


def _driving(
    scope: Scope, legs: BoolArray, drive: FloatArray, time: FloatArray, slowest: FloatArray, limit: float,
) -> tuple[float, float]:
    """Upper bound on the driving time of a route [s], and least share of driving in the time of a leg."""
    longest_s = limit
    if not np.array_equal(scope.leg_time_s[legs], scope.driven_s[legs]):
        drive = scope.driven_s
        longest_s *= float((drive[legs] / np.maximum(time[legs], 1e-100)).max(initial=1.0))
    return longest_s, float((drive[legs] / np.maximum(slowest[legs], 1e-300)).min(initial=1.0))


def _is_metric(scope: Scope, base: int) -> bool:
    """Whether no detour is quicker, or burns less, or is driven for less time, than a direct leg."""
    driven_s = np.where(np.isfinite(scope.fuel_s), scope.driven_s, np.inf)
    return is_metric(driven_s, base, tolerance_s=0.0) and (
        np.array_equal(scope.leg_time_s, driven_s) or is_metric(scope.leg_time_s, base, tolerance_s=0.0))


def neighbours(graph: Graph, pois: Sequence[int]) -> NDArray[np.uint64]:
    """Initial ng-sets: the nearest POIs of each site as bits, shape (n, words).

    Source:
        Baldacci, Mingozzi, Roberti (2011), "New route relaxation and pricing strategies for the vehicle routing
        problem".
    """
    n, words = len(graph.bit), max(1, -(-len(pois) // 64))
    memory = np.zeros((n, words), dtype=np.uint64)
    far = np.where(graph.legs, graph.time_s, np.inf)
    far = np.minimum(far, far.T)
    np.fill_diagonal(far, 0.0)
    for i in range(n):
        for j in sorted(pois, key=lambda j: (far[i, j], j))[:NG_START if graph.bit[i] >= 0 else 2 * NG_START]:
            memory[i, graph.bit[j] >> 6] |= np.uint64(1) << np.uint64(graph.bit[j] & 63)
    return memory


def allowed(route: tuple[int, ...], graph: Graph, memory: NDArray[np.uint64]) -> bool:
    """Whether a route is an ng-route: it visits no POI again that its sites still remember."""
    mask = 0
    for j in route[1:-1]:
        b = int(graph.bit[j])
        if b >= 0 and mask >> b & 1:
            return False
        mask &= sum(int(word) << 64 * k for k, word in enumerate(memory[j]))
        if b >= 0:
            mask |= 1 << b
    return True
