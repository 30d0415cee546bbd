"""What stands in the physics, as data: obstacles and robots; ``bullet`` makes bodies of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.robot.body import CASTER_GAP_M, OwnBody, Solid, Vector
from sva_bench.robot.model import CASTERS_AT, RobotModel

_WALL_M = 0.2  # thickness of the walls about the bounds; nothing is seen of it
_WHEEL_SHARE = 0.05  # of the mass, each
_LEAST_WHEEL_SHARE = 1e-3
_LEAST_INERTIA = 1e-4  # that is left to the hull, in its mass and squares of the track
HEIGHT_M = 0.5
"""Height of all obstacles [m], unless the robot is taller."""


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


def well_conditioned(body: OwnBody, model: RobotModel) -> OwnBody:
    """The same mass, centre of mass and inertia with driven wheels of a twentieth of the mass each, as round robots'.

    The solver's iterations end too early for light wheels under a heavy hull: legs take up to 9 % longer. What the
    wheels gain the hull loses about the same points. Wheels that are heavy enough stay as they are.
    """
    xx, xy, xz, yy, yz, zz = body.inertia_kg_m2
    about_axle = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + _of_point(
        body.base_kg, np.array(body.centre_m))
    share, half = _WHEEL_SHARE, model.track_m / 2
    while share > _LEAST_WHEEL_SHARE:
        left, right = (max(share * body.mass_kg - wheel, 0.0) for wheel in body.wheel_kg)
        base = max(body.base_kg - left - right, 1e-9)
        centre = np.array(body.centre_m) * body.base_kg / base - np.array([0.0, (left - right) * half / base, 0.0])
        inertia = about_axle - _of_point(left + right, np.array([0.0, half, 0.0])) - _of_point(base, centre)
        if np.linalg.eigvalsh(inertia).min() > _LEAST_INERTIA * base * model.track_m**2:
            wheels = (body.wheel_kg[0] + left, body.wheel_kg[1] + right)
            sphere = 0.4 * min(wheels) * model.wheel_radius_m**2
            x, y, z = centre.tolist()
            xx, xy, xz, yy, yz, zz = inertia[np.triu_indices(3)].tolist()
            return replace(body, base_kg=base, centre_m=(x, y, z), inertia_kg_m2=(xx, xy, xz, yy, yz, zz),
                           wheel_kg=wheels, spin_kg_m2=max(body.spin_kg_m2, sphere),
                           across_kg_m2=max(body.across_kg_m2, sphere))
        share /= 2  # the hull has too little inertia to give that much away
    return body


def lightness(model: RobotModel) -> float:
    """By how much the driven wheels are lighter than the solver bears: at least 1, which is that of round robots.

    A hull with little inertia can't give its wheels the mass that they want (``well_conditioned``), and the solver's
    iterations converge the more slowly: with a quarter of that mass robots drive 4 % too fast.
    """
    if model.body is None:
        return 1.0
    used = well_conditioned(model.body, model)
    return max(_WHEEL_SHARE * used.mass_kg / min(used.wheel_kg), 1.0)


def _of_point(mass_kg: float, at_m: FloatArray) -> FloatArray:
    """Inertia of a point mass about the origin, shape (3, 3) [kg m2]."""
    return mass_kg * (float(at_m @ at_m) * np.eye(3) - np.outer(at_m, at_m))


def body_urdf(given: OwnBody, model: RobotModel, track_m: float | None = None) -> str:
    """A robot with a body of its own as a URDF of three links, written from figures that were checked: nothing of the
    file that it was read from reaches the physics but them.

    The base is seen from the middle of the axle. Driven wheels are spheres, as those of round robots.

    Args:
        given: The body.
        model: The robot's figures.
        track_m: Distance between its wheels where that is not what its figures say [m].
    """
    track_m = model.track_m if track_m is None else track_m
    body = well_conditioned(given, model)
    xx, xy, xz, yy, yz, zz = body.inertia_kg_m2
    base = _inertial(body.base_kg, body.centre_m, (xx, xy, xz, yy, yz, zz))
    solids = "\n".join(f'<collision><origin xyz="{_words(solid.at_m)}" rpy="{_words(solid.rpy_rad)}"/>'
                       f"<geometry>{_shape(solid)}</geometry></collision>" for solid in body.solids)
    parts = [f'<link name="base">\n{base}\n{solids}\n</link>']
    for name, side, mass in zip(("left", "right"), (0.5, -0.5), body.wheel_kg, strict=True):
        inertia = _inertial(mass, (0, 0, 0), (body.across_kg_m2, 0, 0, body.spin_kg_m2, 0, body.across_kg_m2))
        tyre = f'<sphere radius="{model.wheel_radius_m!r}"/>'
        parts.append(f'<link name="{name}">\n{inertia}\n<collision><geometry>{tyre}</geometry></collision>\n</link>')
        parts.append(f'<joint name="{name}" type="continuous">\n<parent link="base"/><child link="{name}"/>\n'
                     f'<origin xyz="0 {side * track_m!r} 0"/><axis xyz="0 1 0"/>\n</joint>')
    return '<robot name="robot">\n' + "\n".join(parts) + "\n</robot>\n"


def height_of(model: RobotModel) -> float:
    """Height above the floor of the highest that a robot may touch with [m]."""
    if model.body is None:
        return 3.5 * model.wheel_radius_m
    return model.wheel_radius_m + max(
        solid.at_m[2] + math.hypot(*solid.size_m) / (2 if solid.kind == "box" else 1) for solid in model.body.solids)


def _inertial(mass: float, at: Vector, inertia: tuple[float, ...]) -> str:
    moments = " ".join(f'{name}="{value!r}"' for name, value in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), inertia,
                                                                   strict=True))
    return f'<inertial>\n<origin xyz="{_words(at)}"/><mass value="{mass!r}"/>\n<inertia {moments}/>\n</inertial>'


def _shape(solid: Solid) -> str:
    a, b, _ = solid.size_m
    return {"box": f'<box size="{_words(solid.size_m)}"/>', "cylinder": f'<cylinder radius="{a!r}" length="{b!r}"/>',
            "sphere": f'<sphere radius="{a!r}"/>'}[solid.kind]


def _words(vector: Vector) -> str:
    return " ".join(repr(value) for value in vector)


def obstacles_urdf(obstacles: Obstacles, height_m: float = HEIGHT_M) -> str:
    """All obstacles, and the walls about the bounds, as one link of a URDF."""
    solids = [(x, y, yaw, f'<box size="{2 * a!r} {2 * b!r} {height_m}"/>')
              for x, y, a, b, yaw in obstacles.walled(_WALL_M).boxes.tolist()]
    solids += [(x, y, 0.0, f'<cylinder radius="{r!r}" length="{height_m}"/>')
               for x, y, r in obstacles.cylinders.tolist()]
    # A solid a line: the reader cuts longer ones.
    shapes = "\n".join(
        f'<collision><origin xyz="{x!r} {y!r} {height_m / 2}" rpy="0 0 {yaw!r}"/>'
        f"<geometry>{shape}</geometry></collision>"
        for x, y, yaw, shape in solids)
    nothing = '<mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
    link = f'<link name="obstacles">\n<inertial>{nothing}</inertial>\n{shapes}\n</link>'
    return f'<robot name="obstacles">\n{link}\n</robot>\n'
