"""A small world for tests: one room of 6 m with a wall, a box and a post, a station and four POIs, two robots."""

from __future__ import annotations

from pathlib import Path

from sva_bench.world.load import load_world
from sva_bench.world.model import World

SITES = """\
  stations:
    r1: {at_m: [3.2, 5.2], stop_s: 4}
  pois:
    p1: {at_m: [2.2, 0.8]}
    p2: {at_m: [0.8, 5.0], stop_s: 2}
    p3: {at_m: [5.2, 5.2]}
    p4: {at_m: [4.2, 0.8]}
"""

SMALL = """\
format: sva-bench/world@1
name: small
map:
  shapes:
    bounds_m: [0, 0, 6, 6]
    obstacles:
      - {wall: [[3.0, 0.0], [3.0, 2.6]], thickness_m: 0.1}
      - {box: [2.2, 4.0], size_m: [1.2, 0.5], yaw_deg: 30}
      - {cylinder: [4.4, 3.2], radius_m: 0.3}
sites:
  base: {at_m: [0.8, 0.8], heading_deg: 45}
""" + SITES + """\
robots:
  uv1:
    model: turtlebot2
    fuel_capacity_s: 60
    mission_limit_s: 120
    incentives: {p1: 10, p2: 20, p3: 30, p4: 40}
  uv2:
    model: turtlebot2
    fuel_capacity_s: 60
    mission_limit_s: 120
    availability: 0.75
    incentives: {p1: 40, p2: 30, p3: 20, p4: 10}
scenarios:
  half: {uv2: 0.5}
  safe: {uv2: 1.0}
noise: {wheel_gain_sd: 0.01}
"""


def world_of(folder: Path, text: str = SMALL) -> World:
    """The world that a file of this text describes."""
    path = folder / "world.yaml"
    path.write_text(text, encoding="utf-8")
    return load_world(path)
