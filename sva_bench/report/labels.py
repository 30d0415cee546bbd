"""Label placement that avoids overlaps with other labels, markers and lines."""

from __future__ import annotations

import numpy as np

from sva_bench.arrays import FloatArray

_DIRECTIONS = 16
_GAPS = (4.0, 12.0, 24.0)  # between a marker and its label, in pixels of 1/200 inch
_PASSES = 4  # over all labels; later passes know where all others are
_COSTS = {"frame": 50.0, "label": 20.0, "marker": 20.0, "line": 3.0, "solid": 1.0, "far": 0.1, "astray": 12.0}
_MOST_POINTS = {"line": 3, "solid": 8}  # more under a label make it no harder to read
_PLAINLY = 10.0  # nearer to its own marker by so much, a label is no other's


def place_labels(
    at: FloatArray, sizes: FloatArray, *, radii: FloatArray, frame: FloatArray, lines: FloatArray, solid: FloatArray,
) -> FloatArray:
    """Centres of labels next to what they label; all in the same unit.

    Each takes the cheapest of 48 places beside its marker, the most crowded first, a few times over.

    Args:
        at: Centres of the markers, shape (n, 2).
        sizes: Width and height of the labels, shape (n, 2).
        radii: Radii of the markers, length n.
        frame: x0, y0, x1, y1 of what labels should stay inside.
        lines: Points of lines that labels had better leave free, shape (k, 2).
        solid: Points that labels had better leave free where there is a choice, shape (s, 2).

    Returns:
        Shape (n, 2).
    """
    n = len(at)
    half = sizes / 2
    angles = np.arange(_DIRECTIONS) / _DIRECTIONS * 2 * np.pi
    directions = np.round(np.column_stack([np.cos(angles), np.sin(angles)]), 9)
    order = np.argsort(-_neighbours(at), kind="stable")
    options, fixed = [], []
    for k in range(n):
        # As far out as it takes one edge of the label to clear the marker.
        with np.errstate(divide="ignore"):
            out = [((half[k] + radii[k] + gap) / np.abs(directions)).min(axis=1) for gap in _GAPS]
        places = np.concatenate([at[k] + directions * reach[:, None] for reach in out])
        boxes = np.concatenate([places - half[k], places + half[k]], axis=1)
        cost = _COSTS["far"] * np.repeat(_GAPS, _DIRECTIONS)
        outside = np.maximum(frame[:2] - boxes[:, :2], 0) + np.maximum(boxes[:, 2:] - frame[2:], 0)
        cost = cost + _COSTS["frame"] * outside.sum(axis=1)
        others = np.delete(np.arange(n), k)
        markers = np.concatenate([at[others] - radii[others, None], at[others] + radii[others, None]], axis=1)
        cost = cost + _COSTS["marker"] * _overlap(boxes, markers).sum(axis=1) / np.prod(sizes[k]) * 10
        nearest = _distances(boxes, at[others]).min(axis=1, initial=np.inf)
        own = _distances(boxes, at[k:k + 1])[:, 0]
        cost = cost + _COSTS["astray"] * np.clip((own + _PLAINLY - nearest) / _PLAINLY, 0.0, 1.0)
        for kind, points in (("line", lines), ("solid", solid)):
            cost = cost + _COSTS[kind] * np.minimum(_inside(boxes, points), _MOST_POINTS[kind])
        options.append(places)
        fixed.append(cost)
    chosen = np.full(n, -1)
    for _ in range(_PASSES):
        for k in order:
            placed = [j for j in range(n) if j != k and chosen[j] >= 0]
            cost = fixed[k]
            if placed:
                centres = np.array([options[j][chosen[j]] for j in placed])
                boxes = np.concatenate([options[k] - half[k], options[k] + half[k]], axis=1)
                taken = np.concatenate([centres - half[placed], centres + half[placed]], axis=1)
                cost = cost + _COSTS["label"] * 10 * _overlap(boxes, taken).sum(axis=1) / np.prod(sizes[k])
            chosen[k] = int(np.argmin(np.round(cost, 6)))
    return np.array([options[k][chosen[k]] for k in range(n)]).reshape(n, 2)


def _distances(boxes: FloatArray, points: FloatArray) -> FloatArray:
    """Distance of each point from each box (x0, y0, x1, y1), shape (len(boxes), len(points)); 0 inside."""
    outside = np.maximum(np.maximum(boxes[:, None, :2] - points[None], points[None] - boxes[:, None, 2:]), 0.0)
    return np.hypot(outside[..., 0], outside[..., 1])


def _neighbours(at: FloatArray) -> FloatArray:
    """How crowded it is about each place."""
    gaps = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    np.fill_diagonal(gaps, np.inf)
    crowded: FloatArray = (1.0 / np.maximum(gaps, 1.0)).max(axis=1, initial=0.0)
    return crowded


def _overlap(boxes: FloatArray, others: FloatArray) -> FloatArray:
    """Area that two boxes share, shape (len(boxes), len(others))."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    shared: FloatArray = np.prod(np.maximum(high - low, 0.0), axis=2)
    return shared


def _inside(boxes: FloatArray, points: FloatArray) -> FloatArray:
    """How many points lie in each box."""
    within = (points[None] >= boxes[:, None, :2]) & (points[None] <= boxes[:, None, 2:])
    count: FloatArray = within.all(axis=2).sum(axis=1).astype(np.float64)
    return count
