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
        fuel_s: Fuel of a leg [s], shape (n, n).
        capacity_s: Fuel capacity, tolerance included [s].
        limit_s: Mission limit, tolerance included [s]; finite.
        discount: The vehicle's discount.
        survival: Probability to survive a leg, of use or not, shape (n, n).
        arrival: Greatest probability to get to a site, of the base: back to it, shape (n,).
        most_visits: Upper bound on the visits of POIs of a route, repeated ones included.
        least_survival: Least probability to survive a whole route.
        driving: Least share of driving in the time of a leg, half the stops at its ends included.
        symmetric: Whether costs are symmetric and rewards independent of the way to them.
        metric: Whether no detour is quicker, or burns less, than a direct leg.
    """

    base: int
    bit: IntArray
    legs: BoolArray
    time_s: FloatArray
    fuel_s: FloatArray
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
    fuel = scope.fuel_s if binding else np.zeros((n, n))
    drive = scope.time_s - instance.stop_s[None, :]
    time = drive + (instance.stop_s[:, None] + instance.stop_s[None, :]) / 2
    legs = scope.legs
    # Without a mission limit this is an upper bound on a route: each POI once, all stations between any two.
    limit = scope.limit_s if math.isfinite(scope.limit_s) else \
        float(time[legs].max(initial=0.0)) * (len(instance.pois) + 1) * (len(instance.stations) + 1)
    symmetric = discount.is_plain and np.array_equal(legs, legs.T) and np.array_equal(time[legs], time.T[legs]) \
        and np.array_equal(fuel[legs], fuel.T[legs])
    survival = leg_survival(scope.driven_s, bit >= 0, discount)
    arrival = np.ones(n) if discount.is_plain else greatest_survival(np.where(legs, survival, 0.0), instance.base)
    shortest = float(time[:, bit >= 0][legs[:, bit >= 0]].min(initial=np.inf))
    visits = int(limit / max(shortest, limit / _MOST_VISITS)) + 1
    return Graph(base=instance.base, bit=bit, legs=legs, time_s=np.where(legs, time, 0.0),
                 fuel_s=np.where(legs, fuel, 0.0), capacity_s=scope.capacity_s + _WITHIN * SLACK_S,
                 limit_s=limit + _WITHIN * SLACK_S, discount=discount, survival=survival,
                 arrival=arrival,
                 most_visits=visits, least_survival=discount.chance(visits, limit),
                 driving=float((drive[legs] / np.maximum(time[legs], 1e-300)).min(initial=1.0)),
                 symmetric=bool(symmetric),
                 metric=is_metric(scope.fuel_s, instance.base, tolerance_s=0.0))


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
