"""Sources of noise one by one: which a world has, and the world without one of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from sva_bench.choices import NOISE_NAMES, NoiseName
from sva_bench.execution.noise import SOURCES
from sva_bench.world.model import World

OF_PHYSICS: tuple[NoiseName, ...] = ("contact", "floors", "payload")
"""Sources that the twin knows nothing of."""
ON_CLOCK_OR_TANK: tuple[NoiseName, ...] = ("capacity", "people", "passages")
"""Sources that leave alone how robots drive, so that the same drives serve with and without them."""


def _without_people(world: World) -> World:
    return replace(world, noise=replace(world.noise, people=None))


def _without_passages(world: World) -> World:
    return replace(world, passages=())


def _without_floors(world: World) -> World:
    return replace(world, obstacles=replace(world.obstacles, floors=np.empty((0, 6))))


def _without_contact(world: World) -> World:
    return replace(world, noise=replace(world.noise, hull_friction=0.0))


_OTHERS: Mapping[NoiseName, Callable[[World], World]] = {
    "people": _without_people, "passages": _without_passages, "floors": _without_floors, "contact": _without_contact}


def without(world: World, source: NoiseName) -> World:
    """The world without a source of noise; of one that it doesn't have, the same world."""
    if source in SOURCES:
        return replace(world, noise=SOURCES[source].silenced(world.noise))
    return _OTHERS[source](world)


def sources_on(world: World) -> tuple[NoiseName, ...]:
    """The sources of noise that a world has."""
    return tuple(name for name in NOISE_NAMES if _is_on(world, name))


def _is_on(world: World, source: NoiseName) -> bool:
    if source in SOURCES:
        return not SOURCES[source].silent(world.noise)
    if source == "passages":
        return any(passage.blocked > 0 and passage.wait_s > 0 for passage in world.passages)
    if source == "floors":
        return len(world.obstacles.floors) > 0
    return world.noise.people is not None if source == "people" else world.noise.hull_friction > 0
