"""Joint distributions of availabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class JointState:
    """One outcome of a joint distribution of availabilities.

    Attributes:
        probability: Its probability.
        available: Names of the vehicles that are available in it.
    """

    probability: float
    available: frozenset[str]


def marginals(joint: Sequence[JointState], vehicles: Sequence[str]) -> dict[str, float]:
    """Availability of each vehicle under a joint distribution."""
    return {name: min(1.0, sum(s.probability for s in joint if name in s.available)) for name in vehicles}
