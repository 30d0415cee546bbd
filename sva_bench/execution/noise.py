"""Noise: what differs from one rollout to the next, drawn ahead, each source from a stream of its own.

A source is a class and a line in ``SOURCES``, under its key in the ``noise:`` section of a world. It adds what it draws
to a ``Disturbance``, which is all that an engine is told.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np

from sva_bench.seeds import Stream, rng_for
from sva_bench.world.model import Noise


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """How one robot differs from its model in one rollout. Equal disturbances are driven once.

    Attributes:
        wheel_gains: Factor on the commanded speed of the left and the right wheel.
    """

    wheel_gains: tuple[float, float] = (1.0, 1.0)


UNDISTURBED = Disturbance()


class NoiseSource(Protocol):
    """One source of noise.

    Attributes:
        stream: Its stream of random numbers, indexed by rollout and robot; no two sources share one.
    """

    stream: ClassVar[Stream]

    def silent(self, noise: Noise) -> bool:
        """Whether a world has none of it."""
        ...

    def disturb(self, so_far: Disturbance, noise: Noise, rng: np.random.Generator) -> Disturbance:
        """The disturbance with what this source adds to it."""
        ...


class WheelGains:
    """Each wheel turns faster or slower than commanded by a factor of its own: wear and pressure of the tyres."""

    stream: ClassVar[Stream] = Stream.NOISE

    def silent(self, noise: Noise) -> bool:
        """Whether both gains are always 1."""
        return noise.wheel_gain_sd == 0

    def disturb(self, so_far: Disturbance, noise: Noise, rng: np.random.Generator) -> Disturbance:
        """Normal gains about 1 for the left and the right wheel, in this order."""
        left, right = 1.0 + noise.wheel_gain_sd * rng.standard_normal(2)
        return replace(so_far, wheel_gains=(float(left), float(right)))


SOURCES: Mapping[str, NoiseSource] = {"wheel_gain_sd": WheelGains()}
"""The sources by their keys in the ``noise:`` section of a world, which are the fields of ``Noise``."""


@functools.lru_cache(maxsize=1 << 16)  # every plan and scenario of a run asks for the same
def draw_disturbance(noise: Noise, seed: int, rollout: int, robot: int) -> Disturbance:
    """The disturbance of a robot in a rollout, the same for every plan, scenario and failure process.

    Args:
        noise: What the world says of noise.
        seed: Root seed.
        rollout: Number of the noise draw.
        robot: The robot's position in its team.
    """
    drawn = UNDISTURBED
    for source in SOURCES.values():
        if not source.silent(noise):
            drawn = source.disturb(drawn, noise, rng_for(seed, source.stream, rollout, robot))
    return drawn
