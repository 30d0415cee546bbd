"""Robots that stand together, as at the base: which are seen, in what rows names are, and since when they stand."""

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


def raised_by(at_m: Sequence[FloatArray], first: Sequence[bool], step_m: float) -> list[float]:
    """How far each robot's name is raised where it begins, so that it covers none of those before it [m].

    Args:
        at_m: Where each begins, shape (2,).
        first: Which come before the others.
        step_m: How high names are, which are about as wide as twice that.
    """
    order = sorted(range(len(at_m)), key=lambda k: (not first[k], k))
    raised = [0.0] * len(at_m)
    rows: list[FloatArray] = []
    for k in order:
        for steps in range(2 * len(rows) + 1):  # each name stands in the way of two at most
            place = at_m[k] + np.array([0.0, steps * step_m])
            apart = [np.abs(other - place) for other in rows]
            if not any(dx < 2 * step_m and dy < 0.99 * step_m for dx, dy in apart):
                raised[k] = steps * step_m
                rows.append(place)
                break
    return raised


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
