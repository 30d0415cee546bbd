"""The outcomes of the draw of availabilities: sets of available vehicles and their probabilities."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.errors import BadInput
from sva_bench.mission.instance import Instance

MOST_OUTCOMES = 256


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcomes:
    """All outcomes of the draw of availabilities.

    Attributes:
        incentives: Reward of a visit by vehicle m to site j if it is available, shape (M, n).
        probability: Probability of each outcome, shape (outcomes,).
        available: 1 where a vehicle is available in an outcome, else 0, shape (outcomes, M).
    """

    incentives: FloatArray
    probability: FloatArray
    available: FloatArray

    def times(self, factor: float) -> Outcomes:
        """The same outcomes with rewards in another unit."""
        return replace(self, incentives=self.incentives * factor)


def possible(instance: Instance) -> dict[frozenset[str], float]:
    """The sets of vehicles that can be available, and their probabilities."""
    found: dict[frozenset[str], float] = {}
    if instance.joint is not None:
        for state in instance.joint:
            if state.probability > 0:
                found[state.available] = found.get(state.available, 0.0) + state.probability
        return found
    certain = [v.name for v in instance.vehicles if v.availability == 1]
    uncertain = [v for v in instance.vehicles if 0 < v.availability < 1]
    for drawn in itertools.product((True, False), repeat=len(uncertain)):
        names = frozenset([*certain, *(v.name for v, t in zip(uncertain, drawn, strict=True) if t)])
        found[names] = math.prod(
            v.availability if t else 1 - v.availability for v, t in zip(uncertain, drawn, strict=True))
    return found


def outcomes_of(instance: Instance, sets: Mapping[frozenset[str], float], scale: float = 1.0) -> Outcomes:
    """The outcomes as arrays, rewards divided by ``scale``.

    Args:
        instance: The instance.
        sets: Probability of each set of available vehicles.
        scale: Unit of the rewards.

    Raises:
        BadInput: If there are more than ``MOST_OUTCOMES``, each of which is rows of the program.
    """
    if len(sets) > MOST_OUTCOMES:
        raise BadInput(f"instance {instance.name}: {len(sets)} sets of vehicles can be available, and the program has "
                       f"rows for each; at most {MOST_OUTCOMES}: plan for the expected incentive instead, by the "
                       "method auto or expected")
    names = [v.name for v in instance.vehicles]
    return Outcomes(
        incentives=np.array([v.incentives for v in instance.vehicles]).reshape(len(names), len(instance.sites)) / scale,
        probability=np.array(list(sets.values())),
        available=np.array([[float(name in vehicles) for name in names] for vehicles in sets]).reshape(
            len(sets), len(names)))
