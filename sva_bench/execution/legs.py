"""What a robot drives between two stops."""

from __future__ import annotations

from sva_bench.robot.follower import Stretch

Hop = tuple[Stretch, ...]
"""From one site to the next."""
Leg = tuple[Hop, ...]
"""A leg of a route: the hops of the chain that its repaired cost stands for."""
