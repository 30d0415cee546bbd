"""How a robot differs from its model while it drives: gains, track, delay, payload, and where it believes to be."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from sva_bench.arrays import FloatArray
from sva_bench.robot.follower import CONTROL_HZ

FEATURES = 24
"""Waves that an error field is made of."""

NO_WAVES: FloatArray = np.empty((8, 0))
"""The waves of a robot that knows where it is."""


@dataclass(frozen=True, kw_only=True)
class ErrorField:
    """Errors of localisation over the map: the same error whenever the robot is at the same place.

    Attributes:
        sd_m: Standard deviation of the error along either axis [m].
        sd_rad: Standard deviation of the error of the heading [rad].
        length_m: Distance over which the error changes [m].
        seed: What its waves are drawn from.
    """

    sd_m: float
    sd_rad: float
    length_m: float
    seed: tuple[int, ...]

    def waves(self) -> FloatArray:
        """Wave vector x, y [rad/m], then factors of cosine and sine for x, y [m] and yaw [rad]; shape (8, 24).

        Source:
            Rahimi & Recht (2007), "Random Features for Large-Scale Kernel Machines": a Gaussian field with a
            squared exponential covariance.
        """
        return _waves(self)

    def start(self, pose: tuple[float, float, float]) -> FloatArray:
        """The pose of a robot that believes to be in a given one, shape (3,)."""
        truth = np.array(pose, dtype=np.float64)
        waves = self.waves()
        parts = room_for(waves)
        for _ in range(_SOLVED_AFTER):
            x, y, yaw = error_at(waves, parts, truth[0], truth[1])
            truth = np.array([pose[0] - x, pose[1] - y, pose[2] - yaw])
        return truth


_SOLVED_AFTER = 40  # the error changes by less than half of a step, so that it is right to 1e-12


@functools.lru_cache(maxsize=1 << 14)
def _waves(field: ErrorField) -> FloatArray:
    rng = np.random.default_rng(np.random.SeedSequence(field.seed))
    vectors = rng.standard_normal((FEATURES, 2)) / field.length_m
    phases = rng.uniform(0.0, 2.0 * math.pi, (FEATURES, 3))
    amplitudes = np.array([field.sd_m, field.sd_m, field.sd_rad]) * math.sqrt(2.0 / FEATURES)
    # cos(k p + phase) = cos(phase) cos(k p) - sin(phase) sin(k p)
    factors = np.stack([np.cos(phases) * amplitudes, -np.sin(phases) * amplitudes], axis=2).reshape(FEATURES, 6)
    waves: FloatArray = np.ascontiguousarray(np.hstack([vectors, factors]).T)
    waves.setflags(write=False)
    return waves


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """How one robot differs from its model in one rollout. Equal disturbances are driven once.

    Attributes:
        wheel_gains: Factor on the commanded speed of the left and the right wheel.
        track_gain: Factor on the distance between its wheels, of which its controller knows nothing.
        delay_s: Time from a command until the wheels obey it [s].
        field: Errors of its localisation; ``None`` = it knows where it is.
        payload_kg: What it carries [kg].
        hull_friction: Friction of its hull against what it scrapes along; 0 = it slides.
    """

    wheel_gains: tuple[float, float] = (1.0, 1.0)
    track_gain: float = 1.0
    delay_s: float = 0.0
    field: ErrorField | None = None
    payload_kg: float = 0.0
    hull_friction: float = 0.0

    @property
    def delay_steps(self) -> int:
        """The delay in control steps."""
        return round(self.delay_s * CONTROL_HZ)

    @property
    def waves(self) -> FloatArray:
        """Those of its error field, shape (8, waves); none without one."""
        return NO_WAVES if self.field is None else self.field.waves()

    def start(self, pose: tuple[float, float, float]) -> FloatArray:
        """The pose of a robot that stands where it believes to be in a given one, shape (3,)."""
        return np.array(pose, dtype=np.float64) if self.field is None else self.field.start(pose)


UNDISTURBED = Disturbance()

_PER_TURN = 1.0 / (2.0 * math.pi)


def _series(odd: int) -> tuple[float, ...]:
    """Taylor coefficients of cos(2 pi t), or of sin(2 pi t) / t, in t^2; within 1e-9 for |t| up to 1/4."""
    return tuple((-1.0) ** n * (2.0 * math.pi) ** (2 * n + odd) / math.factorial(2 * n + odd) for n in range(7))


_C0, _C1, _C2, _C3, _C4, _C5, _C6 = _series(0)
_S0, _S1, _S2, _S3, _S4, _S5, _S6 = _series(1)


def room_for(waves: FloatArray) -> FloatArray:
    """What ``error_at`` works in, to be used again and again."""
    return np.empty((3, waves.shape[1]))


@njit(cache=True)  # type: ignore[untyped-decorator]
def error_at(waves: FloatArray, parts: FloatArray, x: float, y: float) -> tuple[float, float, float]:
    """Error of localisation at a place: x, y [m], yaw [rad]; what a robot believes is its pose and this.

    Sines by a series, without a branch, and added up afterwards: so several waves are worked out at a time, which
    makes a sixth of the time, to the same bits. It is asked for at every control step.

    Args:
        waves: As of ``ErrorField.waves``.
        parts: What each wave adds, overwritten; shape (3, waves).
        x, y: The place [m].
    """
    for k in range(waves.shape[1]):
        turns = (waves[0, k] * x + waves[1, k] * y) * _PER_TURN
        # Half a turn changes the sign of both, so that the series need not hold beyond a quarter turn.
        halves = math.floor(2.0 * turns + 0.5)
        t = turns - 0.5 * halves
        sign = 1.0 - 2.0 * (halves - 2.0 * math.floor(0.5 * halves))
        q = t * t
        c = sign * ((((((_C6 * q + _C5) * q + _C4) * q + _C3) * q + _C2) * q + _C1) * q + _C0)
        s = sign * t * ((((((_S6 * q + _S5) * q + _S4) * q + _S3) * q + _S2) * q + _S1) * q + _S0)
        parts[0, k] = waves[2, k] * c + waves[3, k] * s
        parts[1, k] = waves[4, k] * c + waves[5, k] * s
        parts[2, k] = waves[6, k] * c + waves[7, k] * s
    ex = ey = eyaw = 0.0
    for k in range(waves.shape[1]):
        ex += parts[0, k]
        ey += parts[1, k]
        eyaw += parts[2, k]
    return ex, ey, eyaw
