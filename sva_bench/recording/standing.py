"""Robots that stand in one place, as at the base: in which order they are seen, and since when they stand there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sva_bench.arrays import FloatArray


def ranks_of(at_m: Sequence[FloatArray], first: Sequence[bool], near_m: float) -> list[int]:
    """How many robots come before each in the place where it begins; robots that have one for themselves are 0.

    Args:
        at_m: Where each begins, shape (2,).
        first: Which come before the others.
        near_m: How near to each other robots in one place are.
    """
    order = sorted(range(len(at_m)), key=lambda k: (not first[k], k))
    ranks = [0] * len(at_m)
    for number, k in enumerate(order):
        ranks[k] = sum(float(np.hypot(*(at_m[k] - at_m[other]))) < near_m for other in order[:number])
    return ranks


def standing(time_s: FloatArray, pose: FloatArray, near_m: float) -> tuple[FloatArray, FloatArray]:
    """Whether a robot is where it began (1) or away (0), from which times on, the first of them 0 s.

    Args:
        time_s: When it is where, shape (n,).
        pose: x, y [m], yaw [rad], shape (n, 3).
        near_m: How far it has to be away.

    Returns:
        Times [s] and the numbers from each on, shape (m,).
    """
    near = np.hypot(*(pose[:, :2] - pose[0, :2]).T) < near_m
    changes = np.append(0, np.flatnonzero(np.diff(near)) + 1)
    return np.where(changes == 0, 0.0, time_s[changes]), near[changes].astype(np.float64)
