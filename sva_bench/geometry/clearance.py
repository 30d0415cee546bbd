"""The distance that planned paths keep from obstacles."""

from __future__ import annotations

CLEARANCE_MARGINS_M = (0.12, 0.06, 0.03)
"""Distances to obstacles that paths keep beyond the robot's radius [m]; the first that connects all sites is used.

The follower cuts gentle corners by up to 0.05 m and tracks to 0.01 m: at 0.12 m no robot touches anything.
"""
