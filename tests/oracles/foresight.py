"""What a tiny team would earn on average if it knew all failures before it plans."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

from tests.oracles.rest import NOWHERE, Ground

Worth = Callable[[int], float]
"""What one robot can earn over POIs of a mask, its fate given."""


class Reached(NamedTuple):
    """POIs that a robot can visit first, whatever it does then, in the least driving time.

    Attributes:
        mask: The POIs.
        driven: Driving time until the last of them.
        home: Driving time until it is home, if it goes home then.
    """

    mask: int
    driven: float
    home: float


def clairvoyant(ground: Ground) -> float:
    """The expected value of the best plans, each made for known fates."""
    if ground.process == "mission":
        return sum(p * _most(ground, worth) for p, worth in _for_missions(ground))
    fates = {"per_leg": _along_pois, "hazard": _in_driving}[ground.process]
    return sum(math.prod(p for p, _ in team) * _most(ground, [worth for _, worth in team])
               for team in itertools.product(*(fates(ground, k) for k in ground.robots)))


def _most(ground: Ground, worth: list[Worth]) -> float:
    """The most that a team earns: every POI is one robot's."""
    bits, most = list(ground.bit.values()), NOWHERE
    for owners in itertools.product(ground.robots, repeat=len(bits)):
        most = max(most, sum(own(sum(b for b, o in zip(bits, owners, strict=True) if o == k))
                             for k, own in enumerate(worth)))
    return most


def _for_missions(ground: Ground) -> Iterator[tuple[float, list[Worth]]]:
    names = [v.name for v in ground.instance.vehicles]
    able = [_worth(ground, k) for k in ground.robots]
    for there in itertools.product((True, False), repeat=len(names)):
        available = {name for name, t in zip(names, there, strict=True) if t}
        if ground.instance.joint is None:
            probability = math.prod(p if t else 1 - p for p, t in zip(ground.chance, there, strict=True))
        else:
            probability = sum(s.probability for s in ground.instance.joint if s.available == available)
        yield probability, [own if t else lambda _: 0.0 for own, t in zip(able, there, strict=True)]


def _along_pois(ground: Ground, robot: int) -> list[tuple[float, Worth]]:
    """The number of POIs after which a robot fails."""
    s, fates = ground.chance[robot], []
    for number in range(len(ground.pois) + 1):
        probability = s**number * (1 - s if number < len(ground.pois) else 1)
        if probability > 0:
            fates.append((probability, _worth(ground, robot, pois=number)))
    return fates


def _in_driving(ground: Ground, robot: int) -> list[tuple[float, Worth]]:
    """Intervals of lifetimes within which it makes no difference when a robot fails."""
    rate, reached = ground.rate[robot], _reached(ground, robot)
    if rate == 0:
        return [(1.0, _worth(ground, robot))]
    edges = [0.0, *sorted({t for r in reached for t in (r.driven, r.home) if 0 < t < math.inf}), math.inf]
    fates = []
    for since, until in itertools.pairwise(edges):
        probability = math.exp(-rate * since) - math.exp(-rate * until) if since else -math.expm1(-rate * until)
        if math.isinf(rate):
            probability = 0.0 if since else 1.0
        if probability > 0:
            fates.append((probability, _worth(ground, robot, lifetime=since)))
    return fates


def _worth(ground: Ground, robot: int, *, pois: int = sys.maxsize, lifetime: float = math.inf) -> Worth:
    """What a robot earns at most over a mask if it can visit so many POIs, or drive for so long."""
    gains: dict[int, float] = {}
    for r in _reached(ground, robot):
        earned = sum(ground.reward[robot][j] for j, bit in ground.bit.items() if bit & r.mask)
        gain = earned - (0.0 if r.home <= lifetime else ground.loss[robot])
        if r.driven <= lifetime and r.mask.bit_count() <= pois:
            gains[r.mask] = max(gains.get(r.mask, NOWHERE), gain)
    table = [max((gain for own, gain in gains.items() if not own & ~mask), default=0.0)
             for mask in range(ground.everything + 1)]
    return lambda mask: max(table[mask], 0.0)


def _reached(ground: Ground, robot: int) -> list[Reached]:
    """Everything that a robot can visit on safe routes, in the least driving time, and the least until it is home."""
    driven: dict[int, float] = {}
    home: dict[int, float] = {}
    seen = set()
    waiting = [(ground.base, 0.0, 0.0, 0.0, 0)]
    while waiting:
        here, ready, burnt, so_far, mask = waiting.pop()
        for there in (ground.base, *ground.pois, *ground.stations):
            bit = ground.bit.get(there, 0)
            arrival = ground.arrival(robot, here, there, ready, burnt)
            if arrival is None or bit & mask:
                continue
            now = so_far + ground.cost[robot][here][there]
            if there == ground.base:
                home[mask] = min(home.get(mask, math.inf), now)
                continue
            if bit and ground.is_safe(robot, there, *arrival):
                driven[mask | bit] = min(driven.get(mask | bit, math.inf), now)
            label = (there, *arrival, now, mask | bit)
            if label not in seen and ground.is_safe(robot, there, *arrival):
                seen.add(label)
                waiting.append(label)
    return [Reached(mask, t, home.get(mask, math.inf)) for mask, t in driven.items()]
