"""Noise: what differs from one rollout to the next, drawn ahead, each source from a stream of its own.

A source is a class and a line in ``SOURCES``. It adds what it draws to a ``NoiseDraw``. What a robot meets on its way
(closed passages, people) depends on the way, so it is drawn by ``waits``.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np

from sva_bench.choices import NoiseName
from sva_bench.robot.disturbance import UNDISTURBED, Disturbance, ErrorField
from sva_bench.seeds import Stream, rng_for
from sva_bench.world.noise import Noise

_LEAST_GAIN = 0.2  # of wheels and track, however unlikely a draw: a robot drives with it
_LEAST_CAPACITY = 0.05  # share of a tank that is always there


@dataclass(frozen=True, kw_only=True)
class NoiseDraw:
    """One robot in one rollout.

    Attributes:
        disturbance: How it drives.
        capacity: Factor on what its tank holds.
    """

    disturbance: Disturbance = UNDISTURBED
    capacity: float = 1.0


@dataclass(frozen=True)
class Draws:
    """Where a source's numbers come from: its stream, for one rollout and robot.

    Attributes:
        seed: Root seed.
        index: Stream, rollout and the robot's position in its team.
    """

    seed: int
    index: tuple[int, ...]

    @property
    def rng(self) -> np.random.Generator:
        """A generator at its start."""
        stream, *index = self.index
        return rng_for(self.seed, Stream(stream), *index)


class NoiseSource(Protocol):
    """One source of noise.

    Attributes:
        stream: Its stream of random numbers, indexed by rollout and robot; no two sources share one.
    """

    stream: ClassVar[Stream]

    def silent(self, noise: Noise) -> bool:
        """Whether a world has none of it."""
        ...

    def silenced(self, noise: Noise) -> Noise:
        """The same noise without it."""
        ...

    def disturb(self, so_far: NoiseDraw, noise: Noise, draws: Draws) -> NoiseDraw:
        """The draw with what this source adds to it."""
        ...


def _gain(value: float) -> float:
    return max(float(value), _LEAST_GAIN)


class WheelGains:
    """Each wheel turns faster or slower than commanded by a factor of its own: wear and pressure of the tyres."""

    stream: ClassVar[Stream] = Stream.NOISE

    def silent(self, noise: Noise) -> bool:
        """Whether both gains are always 1."""
        return noise.wheel_gain_sd == 0

    def silenced(self, noise: Noise) -> Noise:
        """The same noise without it."""
        return replace(noise, wheel_gain_sd=0.0)

    def disturb(self, so_far: NoiseDraw, noise: Noise, draws: Draws) -> NoiseDraw:
        """Normal gains about 1 for the left and the right wheel, in this order."""
        left, right = 1.0 + noise.wheel_gain_sd * draws.rng.standard_normal(2)
        return _with(so_far, wheel_gains=(_gain(left), _gain(right)))


class SpeedGain:
    """All wheels turn faster or slower than commanded by one factor: their radius, the battery's voltage, the floor."""

    stream: ClassVar[Stream] = Stream.SPEED_GAIN

    def silent(self, noise: Noise) -> bool:
        """Whether the gain is always 1."""
        return noise.speed_gain_sd == 0

    def silenced(self, noise: Noise) -> Noise:
        """The same noise without it."""
        return replace(noise, speed_gain_sd=0.0)

    def disturb(self, so_far: NoiseDraw, noise: Noise, draws: Draws) -> NoiseDraw:
        """A normal gain about 1, on top of the wheels' own."""
        gain = _gain(1.0 + noise.speed_gain_sd * draws.rng.standard_normal())
        left, right = so_far.disturbance.wheel_gains
        return _with(so_far, wheel_gains=(left * gain, right * gain))


class TrackGain:
    """The distance between the wheels differs from what the controller reckons with."""

    stream: ClassVar[Stream] = Stream.TRACK_GAIN

    def silent(self, noise: Noise) -> bool:
        """Whether the gain is always 1."""
        return noise.track_gain_sd == 0

    def silenced(self, noise: Noise) -> Noise:
        """The same noise without it."""
        return replace(noise, track_gain_sd=0.0)

    def disturb(self, so_far: NoiseDraw, noise: Noise, draws: Draws) -> NoiseDraw:
        """A normal gain about 1."""
        return _with(so_far, track_gain=_gain(1.0 + noise.track_gain_sd * draws.rng.standard_normal()))


class Localisation:
    """The robot believes to be elsewhere, by an error that depends on the place."""

    stream: ClassVar[Stream] = Stream.LOCALISATION

    def silent(self, noise: Noise) -> bool:
        """Whether it always knows where it is."""
        return noise.localisation is None

    def silenced(self, noise: Noise) -> Noise:
        """The same noise without it."""
        return replace(noise, localisation=None)

    def disturb(self, so_far: NoiseDraw, noise: Noise, draws: Draws) -> NoiseDraw:
        """An error field of its own."""
        assert noise.localisation is not None
        return _with(so_far, field=ErrorField(
            sd_m=noise.localisation.sd_m, sd_rad=math.radians(noise.localisation.sd_deg),
            length_m=noise.localisation.length_m, seed=(draws.seed, *draws.index)))


class Delay:
    """The wheels obey a command some time after it was given."""

    stream: ClassVar[Stream] = Stream.DELAY

    def silent(self, noise: Noise) -> bool:
        """Whether they obey at once."""
        return noise.delay_s == (0.0, 0.0)

    def silenced(self, noise: Noise) -> Noise:
        """The same noise without it."""
        return replace(noise, delay_s=(0.0, 0.0))

    def disturb(self, so_far: NoiseDraw, noise: Noise, draws: Draws) -> NoiseDraw:
        """A delay, uniform."""
        return _with(so_far, delay_s=float(draws.rng.uniform(*noise.delay_s)))


class Payload:
    """What the robot carries."""

    stream: ClassVar[Stream] = Stream.PAYLOAD

    def silent(self, noise: Noise) -> bool:
        """Whether it carries nothing."""
        return noise.payload_kg == (0.0, 0.0)

    def silenced(self, noise: Noise) -> Noise:
        """The same noise without it."""
        return replace(noise, payload_kg=(0.0, 0.0))

    def disturb(self, so_far: NoiseDraw, noise: Noise, draws: Draws) -> NoiseDraw:
        """A payload, uniform."""
        return _with(so_far, payload_kg=float(draws.rng.uniform(*noise.payload_kg)))


class Capacity:
    """A tank or battery holds more or less than its nominal capacity, and has aged."""

    stream: ClassVar[Stream] = Stream.CAPACITY

    def silent(self, noise: Noise) -> bool:
        """Whether it always holds what it should."""
        return noise.capacity_sd == 0 and noise.capacity_fade == (0.0, 0.0)

    def silenced(self, noise: Noise) -> Noise:
        """The same noise without it."""
        return replace(noise, capacity_sd=0.0, capacity_fade=(0.0, 0.0))

    def disturb(self, so_far: NoiseDraw, noise: Noise, draws: Draws) -> NoiseDraw:
        """A normal factor about 1, less a uniform share lost by age."""
        rng = draws.rng
        factor = (1.0 + noise.capacity_sd * rng.standard_normal()) * (1.0 - rng.uniform(*noise.capacity_fade))
        return replace(so_far, capacity=max(float(factor), _LEAST_CAPACITY))


def _with(so_far: NoiseDraw, **changed: object) -> NoiseDraw:
    return replace(so_far, disturbance=replace(so_far.disturbance, **changed))  # type: ignore[arg-type]


SOURCES: Mapping[NoiseName, NoiseSource] = {
    "wheels": WheelGains(), "speed": SpeedGain(), "track": TrackGain(), "localisation": Localisation(),
    "delay": Delay(), "payload": Payload(), "capacity": Capacity()}
"""The sources by the names under which their effects are reported."""


@functools.lru_cache(maxsize=1 << 16)  # every plan and scenario of a run asks for the same
def draw_noise(noise: Noise, seed: int, rollout: int, robot: int) -> NoiseDraw:
    """What a rollout has for a robot, the same for every plan, scenario and failure process.

    Args:
        noise: What the world says of noise.
        seed: Root seed.
        rollout: Number of the noise draw.
        robot: The robot's position in its team.
    """
    drawn = NoiseDraw(disturbance=replace(UNDISTURBED, hull_friction=noise.hull_friction))
    for source in SOURCES.values():
        if not source.silent(noise):
            drawn = source.disturb(drawn, noise, Draws(seed, (source.stream, rollout, robot)))
    return drawn
