"""A good plan quickly: ruin and recreate with exact refuelling. Deterministic; proves nothing."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.solver.refuelling import Road, quickest

Orders = tuple[tuple[int, ...], ...]
"""POIs of each vehicle, in order of visit."""

_DETOUR_S = 0.5  # keeps a POI on the way from looking infinitely good
_SHORT = 8  # POIs
_BAN = 0.7  # share of the rounds in which POIs are barred from a random vehicle


def search(
    roads: Sequence[Road], weights: FloatArray, start: Orders, *, rounds: int, seed: int,
    out_of_time: Callable[[], bool],
) -> Orders:
    """Orders of POIs worth at least as much as those it starts from.

    Args:
        roads: Road of each vehicle.
        weights: Reward of a visit by vehicle m to site j, shape (M, n), not negative.
        start: Feasible orders.
        rounds: How often to ruin and recreate.
        seed: Seed of the random choices.
        out_of_time: Whether to stop.

    Source:
        Schrimpf et al. (2000), "Record breaking optimization results using the ruin and recreate principle".
    """
    rng = np.random.default_rng(seed)
    best = current = _insert(roads, weights, start, 1.0, rng, noise=0.0, ban=0.0)
    best_worth = current_worth = worth(weights, best)
    for number in range(rounds):
        if out_of_time():
            break
        ruined = _ruin(roads, current, rng)
        ban = float(rng.uniform(0, 0.5)) if rng.random() < _BAN and len(roads) > 1 else 0.0
        trial = _insert(roads, weights, ruined, float(rng.uniform(0.5, 2)), rng, noise=0.3, ban=ban)
        trial = tuple(shorten(road, order) for road, order in zip(roads, trial, strict=True))
        trial = _insert(roads, weights, trial, 1.0, rng, noise=0.0, ban=0.0)
        trial_worth = worth(weights, trial)
        if trial_worth > best_worth:
            best, best_worth = trial, trial_worth
        # Accept a little worse at first, nothing worse in the end; now and then go back to the best.
        if trial_worth >= current_worth - 0.05 * best_worth * (1 - number / rounds):
            current, current_worth = trial, trial_worth
        if number % 50 == 49:
            current, current_worth = best, best_worth
    return best


def worth(weights: FloatArray, orders: Orders) -> float:
    """Sum of the rewards."""
    return float(sum(weights[m, j] for m, order in enumerate(orders) for j in order))


def shorten(road: Road, order: tuple[int, ...]) -> tuple[int, ...]:
    """The same POIs in an order that no reversal and no move of up to three of them makes quicker.

    On a long route only such as are quicker without refuels are tried.
    """
    drive = quickest(road, order)
    if drive is None:
        raise ValueError(f"no feasible route visits {order} in this order")
    improved = True
    while improved:
        improved = False
        for candidate in _neighbours(order):
            if len(order) > _SHORT and _direct(road, candidate) >= _direct(road, order):
                continue
            other = quickest(road, candidate)
            if other is not None and other.time_s < drive.time_s - 1e-9:
                order, drive, improved = candidate, other, True
                break
    return order


def _direct(road: Road, order: tuple[int, ...]) -> float:
    """Time of the route without its refuels."""
    return sum(road.time_s[i][j] for i, j in itertools.pairwise((road.base, *order, road.base)))


def _neighbours(order: tuple[int, ...]) -> list[tuple[int, ...]]:
    n = len(order)
    found = [(*order[:i], *reversed(order[i:j]), *order[j:]) for i in range(n) for j in range(i + 2, n + 1)]
    for length in (1, 2, 3):
        for i in range(n - length + 1):
            block, rest = order[i:i + length], order[:i] + order[i + length:]
            found += [(*rest[:k], *block, *rest[k:]) for k in range(len(rest) + 1) if k != i]
    return found


def _ruin(roads: Sequence[Road], orders: Orders, rng: np.random.Generator) -> Orders:
    """The orders without some POIs: a segment of a route, those around one, or any; what is left stays feasible."""
    visited = [j for order in orders for j in order]
    if not visited:
        return orders
    count = int(rng.integers(1, max(2, int(0.6 * len(visited)) + 1)))
    kind = rng.integers(3)
    if kind == 0:
        gone = set(rng.permutation(visited)[:count].tolist())
    elif kind == 1:
        first = int(rng.integers(len(visited)))
        gone = set(visited[first:first + count])
    else:
        centre, times = int(rng.choice(visited)), roads[0].time_s
        gone = set(sorted(visited, key=lambda j: (times[centre][j], j))[:count])
    left = tuple(tuple(j for j in order if j not in gone) for order in orders)
    # Without the triangle inequality a POI may have been a shortcut.
    return tuple(order if quickest(road, order) is not None else () for road, order in zip(roads, left, strict=True))


def _insert(
    roads: Sequence[Road], weights: FloatArray, orders: Orders, power: float, rng: np.random.Generator, *,
    noise: float, ban: float,
) -> Orders:
    """Insert unvisited POIs, those of most reward for the least detour first, until none fits."""
    done, sites = [list(order) for order in orders], int(weights.shape[1])
    visited = {j for order in orders for j in order}
    pairs: list[list[int]] = np.argwhere(weights > 0).tolist()
    allowed = [(m, j) for m, j in pairs if j not in visited]
    if ban:
        barred = rng.integers(len(roads), size=(sites,))
        draw = rng.random((sites,))
        allowed = [(m, j) for m, j in allowed if not (draw[j] < ban and barred[j] == m)]
    factor = 1 + noise * (rng.random(weights.shape) - 0.5) * 2
    hopeless: set[tuple[int, int, int, int]] = set()  # with another visit nearby, only less is feasible
    while allowed:
        candidates = []
        for m, j in allowed:
            times, stops = roads[m].time_s, [roads[m].base, *done[m], roads[m].base]
            for position, (a, b) in enumerate(itertools.pairwise(stops)):
                if (m, j, a, b) not in hopeless:
                    detour = times[a][j] + times[j][b] - (times[a][b] if a != b else 0.0)
                    score = float(weights[m, j] ** power * factor[m, j]) / (max(detour, 0.0) + _DETOUR_S)
                    candidates.append((-score, m, j, position, a, b))
        candidates.sort()
        for _, m, j, position, a, b in candidates:
            order = [*done[m][:position], j, *done[m][position:]]
            if quickest(roads[m], order) is not None:
                done[m] = order
                allowed = [(v, k) for v, k in allowed if k != j]
                break
            hopeless.add((m, j, a, b))
        else:
            break
    return tuple(tuple(order) for order in done)
