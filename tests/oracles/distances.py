"""Distances among segments, rotated boxes, cylinders and bounds by way of corners and edges, in numpy."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.geometry.obstacles import Obstacles


def corners_of(box: FloatArray) -> FloatArray:
    """Corners of a box (centre x, y, half length, half width, yaw), counter-clockwise, shape (4, 2)."""
    cx, cy, hx, hy, yaw = box
    forward = np.array([math.cos(yaw), math.sin(yaw)])
    left = np.array([-math.sin(yaw), math.cos(yaw)])
    return np.array([[cx, cy] + sx * hx * forward + sy * hy * left for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))])


def points_to_segment(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Distance of each point to one segment, shape (n,)."""
    along = b - a
    squared = float(along @ along)
    share = np.zeros(len(points)) if squared == 0 else np.clip((points - a) @ along / squared, 0.0, 1.0)
    gaps: FloatArray = np.hypot(*(a + share[:, None] * along - points).T)
    return gaps


def segments_cross(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> bool:
    """Whether two segments properly cross."""
    def side(p: FloatArray, q: FloatArray, r: FloatArray) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


def inside_convex(polygon: FloatArray, point: FloatArray) -> bool:
    """Whether a point lies in a convex counter-clockwise polygon."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    offsets = point - polygon
    return bool(np.all(edges[:, 0] * offsets[:, 1] - edges[:, 1] * offsets[:, 0] >= 0))


def segment_to_polygon(polygon: FloatArray, a: FloatArray, b: FloatArray) -> float:
    """Distance from a segment to a convex polygon, 0 where they meet."""
    if inside_convex(polygon, a) or inside_convex(polygon, b):
        return 0.0
    nearest = float(points_to_segment(polygon, a, b).min())
    for c, d in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if segments_cross(a, b, c, d):
            return 0.0
        nearest = min(nearest, float(points_to_segment(np.array([a, b]), c, d).min()))
    return nearest


def segment_clearance(obstacles: Obstacles, a: FloatArray, b: FloatArray) -> float:
    """Distance from a segment to whatever stands nearest; negative outside the bounds."""
    x0, y0, x1, y1 = obstacles.bounds_m
    gaps = [min(p[0] - x0, p[1] - y0, x1 - p[0], y1 - p[1]) for p in (a, b)]
    gaps += [segment_to_polygon(corners_of(box), a, b) for box in obstacles.boxes]
    gaps += [max(float(points_to_segment(c[None, :2], a, b)[0]) - c[2], 0.0) for c in obstacles.cylinders]
    return float(min(gaps))


def path_clearance(obstacles: Obstacles, path: FloatArray) -> float:
    """Distance from a polyline to whatever stands nearest."""
    return min(segment_clearance(obstacles, a, b) for a, b in pairwise(path))


def points_clearance(obstacles: Obstacles, points: FloatArray) -> FloatArray:
    """Distance from each point to whatever stands nearest, shape (n,)."""
    x, y = points.T
    x0, y0, x1, y1 = obstacles.bounds_m
    nearest: FloatArray = np.min([x - x0, y - y0, x1 - x, y1 - y], axis=0)
    for box in obstacles.boxes:
        corners = corners_of(box)
        edges = np.roll(corners, -1, axis=0) - corners
        offsets = points[:, None, :] - corners
        inside = np.all(edges[:, 0] * offsets[..., 1] - edges[:, 1] * offsets[..., 0] >= 0, axis=1)
        gap = np.min([points_to_segment(points, c, c + e) for c, e in zip(corners, edges, strict=True)], axis=0)
        nearest = np.minimum(nearest, np.where(inside, 0.0, gap))
    for cx, cy, radius in obstacles.cylinders:
        nearest = np.minimum(nearest, np.maximum(np.hypot(x - cx, y - cy) - radius, 0.0))
    return nearest
