"""What lies outside the bounds of a world."""

from __future__ import annotations

import numpy as np

from sva_bench.arrays import FloatArray


def is_outside(corners_m: FloatArray, bounds_m: FloatArray) -> bool:
    """Whether a segment or a convex polygon has nothing inside the bounds; on their rim is outside.

    Args:
        corners_m: Its corners in order [m], shape (k, 2), k >= 2.
        bounds_m: x_min, y_min, x_max, y_max [m].

    Source:
        The separating axis theorem: two convex shapes are apart if their shadows on the normal of some side are.
    """
    x_min, y_min, x_max, y_max = bounds_m
    rim = np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])
    sides = np.roll(corners_m, -1, axis=0) - corners_m
    for normal in [(1.0, 0.0), (0.0, 1.0), *np.column_stack([-sides[:, 1], sides[:, 0]])]:
        own, others = corners_m @ normal, rim @ normal
        if own.max() <= others.min() or own.min() >= others.max():
            return True
    return False
