"""From a robot's links and joints to its body: one hull on two driven wheels, all other joints held where they are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.errors import SvaBenchError
from sva_bench.files.printable import shown
from sva_bench.robot.body import CASTER_GAP_M, OwnBody, Solid, Vector
from sva_bench.robot.urdf import Joint, Link, Shape, Urdf, about, rpy_of

_LEVEL = 0.02  # greatest sine between an axle and the floor, or between both axles
_EVEN = 0.01  # greatest relative difference of the wheels' radii, and of their heights to the radius
_ASKEW = 0.17  # greatest sine between the axle and the y axis of the root: 10 degrees
_SUNK = 0.15  # of the wheel radius: how far a caster may reach below the wheels
_TILT = math.tan(math.radians(2.0))  # how far the robot may tilt until it stands on something
_RIM = 64  # points of a cylinder's rim to look at
_COMPACT = 0.07, 2.0  # least and greatest radius of gyration of the hull, in half diagonals of all solids


class WheelsExchanged(SvaBenchError):
    """What is named as the left wheel is the right one: wrong is not the URDF, but what names them."""

    def __init__(self, left: str, right: str, root: str) -> None:
        super().__init__(left, right, root)
        self.left, self.right, self.root = left, right, root

    def __str__(self) -> str:
        return (f"{shown(self.left)} is to the right of {shown(self.right)}, seen along the x axis of "
                f"{shown(self.root)}, which points ahead; exchange left_wheel and right_wheel")


Frames = dict[str, tuple[FloatArray, FloatArray]]
"""Origin and axes of each link in the root."""


@dataclass(frozen=True, kw_only=True)
class Derived:
    """What a robot's links and joints say of it.

    Attributes:
        body: Its body.
        radius_m: Radius of the circle about the middle of the axle that holds all solids [m].
        wheel_radius_m: Radius of the driven wheels [m].
        track_m: Distance between them [m].
    """

    body: OwnBody
    radius_m: float
    wheel_radius_m: float
    track_m: float


@dataclass(frozen=True, eq=False, kw_only=True)
class _Placed:
    """A solid in the frame of the root, or of the axle."""

    link: Link
    shape: Shape
    at_m: FloatArray
    turned: FloatArray

    def moved(self, origin: FloatArray, axes: FloatArray) -> _Placed:
        """The same seen from a frame of that origin and those axes."""
        return _Placed(link=self.link, shape=self.shape, at_m=axes.T @ (self.at_m - origin),
                       turned=axes.T @ self.turned)

    def points(self) -> FloatArray:
        """The corners of a box, points of a cylinder's rims, or the extremes of a sphere, shape (n, 3)."""
        a, b, c = self.shape.size_m
        if self.shape.kind == "box":
            own = np.array([(x, y, z) for x in (-a / 2, a / 2) for y in (-b / 2, b / 2) for z in (-c / 2, c / 2)])
        elif self.shape.kind == "cylinder":
            round_m = np.linspace(0, 2 * math.pi, _RIM, endpoint=False)
            own = np.array([(a * math.cos(t), a * math.sin(t), z) for t in round_m.tolist() for z in (-b / 2, b / 2)])
        else:
            flat = self.at_m[:2] / max(float(np.hypot(*self.at_m[:2])), 1e-12)
            up = np.array([0.0, 0.0, a])
            return np.array([self.at_m - up, self.at_m + up, self.at_m + a * np.array([*flat, 0.0])])
        return self.at_m + own @ self.turned.T


@dataclass(frozen=True, eq=False, kw_only=True)
class _Wheel:
    """A driven wheel in the frame of the root."""

    joint: Joint
    links: frozenset[str]
    shape: _Placed
    centre_m: FloatArray
    axis: FloatArray
    radius_m: float
    mass_kg: float
    spin_kg_m2: float
    across_kg_m2: float


def derive(urdf: Urdf, left: str, right: str) -> Derived:
    """The body of a robot, and the figures that follow from it.

    Args:
        urdf: The robot.
        left, right: Names of the driven wheels' joints, which it has.

    Raises:
        BadFile: If the wheels are no pair of driven wheels, or the robot would not stand on them.
        WheelsExchanged: If the left one is the right one.
    """
    frames = _frames(urdf)
    pair = [_wheel(urdf, frames, urdf.joints[name]) for name in (left, right)]
    origin, axes, track = _axle(urdf, *pair)
    radius = (pair[0].radius_m + pair[1].radius_m) / 2
    driven = pair[0].links | pair[1].links
    solids = [placed.moved(origin, axes) for placed in _placed(urdf, frames, driven)]
    solids = [_lifted(urdf, solid, radius) for solid in solids]
    stands = _supports([solid.points() for solid in solids], radius)
    for wheel in pair:  # what the wheels touch obstacles with; on the floor they roll on spheres
        shape = wheel.shape.shape
        a, *rest = shape.size_m
        smaller = Shape(kind=shape.kind, size_m=(a - 2 * CASTER_GAP_M, rest[0], rest[1]), at_m=shape.at_m,
                        turned=shape.turned, line=shape.line)
        solids.append(_Placed(link=wheel.shape.link, shape=smaller, at_m=wheel.shape.at_m,
                              turned=wheel.shape.turned).moved(origin, axes))
    mass, centre, inertia = _mass_of(urdf, frames, driven, origin, axes)
    root = urdf.links[urdf.root]
    if mass <= 0:
        raise about(urdf.file, root.line, f"link {root.name}", "nothing but the wheels has a mass; give the hull one")
    points = np.concatenate([solid.points() for solid in solids])
    _refuse_odd_inertia(urdf, mass, inertia, points)
    body = OwnBody(
        solids=tuple(Solid(kind=s.shape.kind, size_m=s.shape.size_m, at_m=_rounded(s.at_m),
                           rpy_rad=_rounded(rpy_of(s.turned))) for s in solids),
        base_kg=mass, centre_m=_rounded(centre),
        inertia_kg_m2=(float(inertia[0, 0]), float(inertia[0, 1]), float(inertia[0, 2]), float(inertia[1, 1]),
                       float(inertia[1, 2]), float(inertia[2, 2])),
        wheel_kg=(pair[0].mass_kg, pair[1].mass_kg), spin_kg_m2=(pair[0].spin_kg_m2 + pair[1].spin_kg_m2) / 2,
        across_kg_m2=(pair[0].across_kg_m2 + pair[1].across_kg_m2) / 2, front_m=stands[0], rear_m=stands[1])
    _refuse_unstable(urdf, body, track, radius)
    reach = float(np.hypot(points[:, 0], points[:, 1]).max()) + 2 * CASTER_GAP_M
    return Derived(body=body, radius_m=round(reach, 6), wheel_radius_m=round(radius, 9), track_m=round(track, 9))


def _frames(urdf: Urdf) -> Frames:
    """Origin and axes of each link in the root, with all joints at zero."""
    frames = {urdf.root: (np.zeros(3), np.eye(3))}
    children = urdf.joints_below()
    waiting = [urdf.root]
    while waiting:
        here = waiting.pop()
        at, axes = frames[here]
        for joint in children.get(here, ()):
            frames[joint.child] = at + axes @ joint.at_m, axes @ joint.turned
            waiting.append(joint.child)
    return frames


def _below(urdf: Urdf, link: str) -> frozenset[str]:
    """A link and all that hang on it."""
    found, waiting, children = {link}, [link], urdf.joints_below()
    while waiting:
        further = [joint.child for joint in children.get(waiting.pop(), ())]
        found |= set(further)
        waiting += further
    return frozenset(found)


def _placed(urdf: Urdf, frames: Frames, without: frozenset[str]) -> Iterator[_Placed]:
    for name, link in urdf.links.items():
        at, axes = frames[name]
        for shape in link.shapes if name not in without else ():
            yield _Placed(link=link, shape=shape, at_m=at + axes @ shape.at_m, turned=axes @ shape.turned)


def _wheel(urdf: Urdf, frames: Frames, joint: Joint) -> _Wheel:
    """A driven wheel, if the joint turns one."""
    key = f"joint {joint.name}"
    if not joint.turns:
        raise about(urdf.file, joint.line, key, "a driven wheel's joint must turn; let it be of type continuous")
    own = urdf.links[joint.child]
    links = _below(urdf, joint.child)
    origin, axes = frames[joint.child]
    axis = axes @ joint.axis
    if abs(axis[2]) > _LEVEL:
        raise about(urdf.file, joint.line, key, "the axis of a driven wheel must be parallel to the floor: its z is "
                    f"{axis[2]:.3f} in the frame of {urdf.root}")
    shapes = list(_placed(urdf, frames, frozenset(urdf.links) - links))
    if not shapes:
        raise about(urdf.file, own.line, f"link {own.name}", "a driven wheel needs a <collision>: a cylinder about its "
                    "axle, or a sphere")
    for placed in shapes:
        off = placed.at_m - origin
        off = off - (off @ axis) * axis
        across = placed.shape.kind == "cylinder" and abs(float(placed.turned[:, 2] @ axis)) < math.sqrt(1 - _LEVEL**2)
        if placed.shape.kind == "box" or across or float(np.linalg.norm(off)) > _EVEN * placed.shape.size_m[0]:
            raise about(urdf.file, placed.shape.line, f"link {placed.link.name}", "a driven wheel must be a cylinder "
                        f"about the axis of {joint.name}, or a sphere on it")
    largest = max(shapes, key=lambda placed: placed.shape.size_m[0])
    mass, _, inertia = _mass_of(urdf, frames, frozenset(urdf.links) - links, largest.at_m, np.eye(3))
    if mass <= 0:
        raise about(urdf.file, own.line, f"link {own.name}", "a driven wheel needs an <inertial>; say its mass")
    spin = float(axis @ inertia @ axis)
    return _Wheel(joint=joint, links=links, shape=largest, centre_m=largest.at_m, axis=axis, mass_kg=mass,
                  radius_m=largest.shape.size_m[0], spin_kg_m2=spin,
                  across_kg_m2=(float(np.trace(inertia)) - spin) / 2)


def _axle(urdf: Urdf, left: _Wheel, right: _Wheel) -> tuple[FloatArray, FloatArray, float]:
    """The frame of the axle in the root, and the track [m]."""
    key = f"joint {right.joint.name}"

    def wrong(problem: str) -> Exception:
        return about(urdf.file, right.joint.line, key, problem)

    if left.links & right.links:
        raise wrong("one driven wheel hangs on the other; let both hang on the hull")
    if float(np.linalg.norm(np.cross(left.axis, right.axis))) > _LEVEL:
        raise wrong(f"its axis isn't parallel to that of {left.joint.name}; a differential drive's wheels stand on one "
                    "axle")
    if abs(left.radius_m - right.radius_m) > _EVEN * left.radius_m:
        raise wrong(f"its wheel's radius is {right.radius_m:g} m, and that of {left.joint.name} {left.radius_m:g} m; "
                    "driven wheels must be equal")
    apart = left.centre_m - right.centre_m
    if abs(apart[2]) > _EVEN * left.radius_m:
        raise wrong(f"its wheel stands at another height than that of {left.joint.name}, by {abs(apart[2]):.3f} m; "
                    "driven wheels must stand on one axle")
    track = float(np.hypot(apart[0], apart[1]))
    if track < left.radius_m / 4:
        raise wrong(f"both driven wheels are in one place, {track:.3f} m apart")
    sideways = np.array([apart[0] / track, apart[1] / track, 0.0])
    if float(np.linalg.norm(np.cross(sideways, right.axis))) > _LEVEL:
        raise wrong(f"its wheel doesn't stand on the axle of {left.joint.name}; a differential drive's wheels do")
    if sideways[1] < 0:
        raise WheelsExchanged(left.joint.name, right.joint.name, urdf.root)
    if abs(sideways[0]) > _ASKEW:
        raise wrong(f"the axle must lie across the x axis of {urdf.root}, which points ahead; it is "
                    f"{math.degrees(math.asin(min(abs(sideways[0]), 1.0))):.0f} degrees off")
    axes = np.column_stack([np.array([sideways[1], -sideways[0], 0.0]), sideways, np.array([0.0, 0.0, 1.0])])
    return (left.centre_m + right.centre_m) / 2, axes, track


def _lifted(urdf: Urdf, solid: _Placed, wheel_radius_m: float) -> _Placed:
    """The solid, lifted to where it clears the floor, so that the weight rests on the driven wheels."""
    low = float(solid.points()[:, 2].min()) + wheel_radius_m
    if low < -_SUNK * wheel_radius_m:
        raise about(urdf.file, solid.shape.line, f"link {solid.link.name}", f"its collision shape reaches {-low:.3f} m "
                    "below the driven wheels, which would hang in the air; raise or shrink it")
    lift = np.array([0.0, 0.0, max(CASTER_GAP_M - low, 0.0)])
    return _Placed(link=solid.link, shape=solid.shape, at_m=solid.at_m + lift, turned=solid.turned)


def _mass_of(
    urdf: Urdf, frames: Frames, without: frozenset[str], origin: FloatArray, axes: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """Mass, its centre, and inertia about the centre, seen from a frame of that origin and those axes."""
    parts = []
    for name, link in urdf.links.items():
        if name not in without and link.mass_kg > 0:
            at, turned = frames[name]
            inertia = axes.T @ turned @ link.inertia_kg_m2 @ turned.T @ axes
            parts.append((link.mass_kg, axes.T @ (at + turned @ link.centre_m - origin), inertia))
    mass = sum(part[0] for part in parts)
    if not parts:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    centre = sum((kg * at for kg, at, _ in parts), np.zeros(3)) / mass
    total = np.zeros((3, 3))
    for kg, at, inertia in parts:
        off = at - centre
        total += inertia + kg * (float(off @ off) * np.eye(3) - np.outer(off, off))
    return mass, centre, total


def _supports(solids: Sequence[FloatArray], wheel_radius_m: float) -> tuple[float, float]:
    """How far ahead of and behind the axle the robot stands on the floor, once it tilts a little."""
    points = np.concatenate([*solids, np.zeros((1, 3))])
    near = points[points[:, 2] + wheel_radius_m <= 2 * CASTER_GAP_M + _TILT * np.abs(points[:, 0]), 0]
    return float(near.max(initial=0.0)), float(-near.min(initial=0.0))


def _refuse_odd_inertia(urdf: Urdf, mass: float, inertia: FloatArray, points: FloatArray) -> None:
    """Refuse inertia that no mass within the hull has: physics would shake, or hardly turn."""
    root = urdf.links[urdf.root]
    farthest = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0))) / 2
    for moment in np.linalg.eigvalsh(inertia).tolist():
        gyration = math.sqrt(moment / mass)
        if not _COMPACT[0] * farthest <= gyration <= _COMPACT[1] * farthest:
            raise about(urdf.file, root.line, f"link {root.name}",
                        f"with all that is fixed to it, it has an inertia of {moment:.3g} kg m2 about one axis, as if "
                        f"its {mass:.3g} kg were {gyration:.3g} m away from it; its shapes reach {farthest:.3g} m "
                        "from their middle. Check the inertias, and their unit: kg m2")


def _refuse_unstable(urdf: Urdf, body: OwnBody, track_m: float, wheel_radius_m: float) -> None:
    """Refuse a robot that falls over where it stands, or whose wheels are harder to spin up than itself."""
    root = urdf.links[urdf.root]
    x, y, _ = body.centre_of_all_m(track_m)
    ahead, reach = ("ahead of", body.front_m) if x >= 0 else ("behind", body.rear_m)
    if abs(x) > 1e-6 and abs(x) >= reach:
        stands = f"it stands on the floor up to {reach:.3f} m" if reach > 0 else "nothing there stands on the floor"
        raise about(urdf.file, root.line, f"link {root.name}",
                    f"the robot tips over: its centre of mass is {abs(x):.3f} m {ahead} the axle, and {stands}; add a "
                    "caster, or move the mass")
    if abs(y) >= track_m / 2:
        raise about(urdf.file, root.line, f"link {root.name}",
                    f"the robot tips over: its centre of mass is {abs(y):.3f} m aside, beyond its driven wheels; move "
                    "the mass")
    if 2 * body.spin_kg_m2 > wheel_radius_m**2 * body.mass_kg:
        raise about(urdf.file, root.line, f"link {root.name}", "its driven wheels are harder to spin up than the robot "
                    f"is to move: {body.spin_kg_m2:.3g} kg m2 about the axle; check their inertia, and its unit: kg m2")


def _rounded(vector: FloatArray | Vector) -> Vector:
    """Without the last digits, which depend on the order of operations."""
    x, y, z = (round(float(value), 9) + 0.0 for value in vector)
    return x, y, z
