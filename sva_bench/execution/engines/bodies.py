"""What stands in the physics, as data: obstacles and robots; ``bullet`` makes bodies of it."""

from __future__ import annotations

from dataclasses import dataclass

from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.model import CASTERS_AT, RobotModel

_WALL_M = 0.2  # thickness of the walls about the bounds; nothing is seen of it
_HEIGHT_M = 0.5  # of all obstacles; taller than any robot's hull
CASTER_GAP_M = 0.001
"""Casters touch the floor only when the hull tilts, so the weight rests on the driven wheels."""


@dataclass(frozen=True, kw_only=True)
class RoundBody:
    """A round robot: a cylinder on two driven wheels and two ball casters, seen from the middle of its axle.

    Wheels are spheres, which roll on one point: the speed is right to 0.1 %, where cylinder wheels are 2.4 % off and
    drift.

    Attributes:
        base_kg, wheel_kg: Mass of hull and casters, and of each wheel [kg].
        radii_m: Radii of hull, front and rear caster [m].
        hull_m: Height of the hull [m].
        at_m: Centres of hull, front and rear caster [m].
        wheel_radius_m: Radius of the wheels [m].
        track_m: Distance between the wheels [m].
    """

    base_kg: float
    wheel_kg: float
    radii_m: tuple[float, float, float]
    hull_m: float
    at_m: tuple[tuple[float, float, float], ...]
    wheel_radius_m: float
    track_m: float


def round_body(model: RobotModel) -> RoundBody:
    """The body of a robot of which only the figures are known."""
    wheel, hull = model.wheel_radius_m, 1.5 * model.wheel_radius_m
    caster = wheel / 2
    reach = CASTERS_AT * model.radius_m
    return RoundBody(
        base_kg=0.9 * model.mass_kg, wheel_kg=0.05 * model.mass_kg, radii_m=(model.radius_m, caster, caster),
        hull_m=2 * hull, at_m=((0, 0, hull - wheel / 2), (reach, 0, CASTER_GAP_M - caster),
                               (-reach, 0, CASTER_GAP_M - caster)),
        wheel_radius_m=wheel, track_m=model.track_m)


def obstacles_urdf(obstacles: Obstacles) -> str:
    """All obstacles, and the walls about the bounds, as one link of a URDF."""
    solids = [(x, y, yaw, f'<box size="{2 * a!r} {2 * b!r} {_HEIGHT_M}"/>')
              for x, y, a, b, yaw in obstacles.walled(_WALL_M).boxes.tolist()]
    solids += [(x, y, 0.0, f'<cylinder radius="{r!r}" length="{_HEIGHT_M}"/>')
               for x, y, r in obstacles.cylinders.tolist()]
    # A solid a line: the reader cuts longer ones.
    shapes = "\n".join(
        f'<collision><origin xyz="{x!r} {y!r} {_HEIGHT_M / 2}" rpy="0 0 {yaw!r}"/>'
        f"<geometry>{shape}</geometry></collision>"
        for x, y, yaw, shape in solids)
    nothing = '<mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
    link = f'<link name="obstacles">\n<inertial>{nothing}</inertial>\n{shapes}\n</link>'
    return f'<robot name="obstacles">\n{link}\n</robot>\n'
