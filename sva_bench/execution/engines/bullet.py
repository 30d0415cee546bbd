"""Physics: a robot among obstacles in PyBullet. The only importer of pybullet."""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import math
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

from sva_bench.arrays import FloatArray
from sva_bench.choices import Fault
from sva_bench.execution.engines.accuracy import accuracy, fastest_wheel_rad_s, finest, motor_torque
from sva_bench.execution.engines.bodies import (
    HEIGHT_M,
    RoundBody,
    body_urdf,
    height_of,
    obstacles_urdf,
    round_body,
)
from sva_bench.execution.touch import Touch
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.robot.body import CASTER_GAP_M
from sva_bench.robot.disturbance import Disturbance
from sva_bench.robot.follower import CONTROL_HZ
from sva_bench.robot.model import RobotModel


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keeps what native code prints off both outputs: results and messages go there, and nothing else."""
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    sys.stderr.flush()
    libc.fflush(None)  # what others have buffered goes where it was meant to go
    saved = [os.dup(1), os.dup(2)]
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 1)
        os.dup2(null, 2)
        yield
    finally:
        libc.fflush(None)  # else a banner comes out of the C library's buffer when the program ends
        for number, descriptor in enumerate(saved, start=1):
            os.dup2(descriptor, number)
            os.close(descriptor)
        os.close(null)


with _quiet():  # prints a banner on import
    import pybullet

_CONTACT_STEPS = 3  # control steps from one look at contacts to the next: 50 ms
_PLACE, _DISTANCE = 5, 8  # where a contact point of PyBullet has its place on the robot, and its distance
_UPRIGHT = 0.7  # cosine of the tilt at which a robot has tipped over
_CASTER_FRICTION = 0.01  # of the hull in PyBullet, with the casters, which slide; obstacles make up for it
_WHEEL_FRICTION = 1.0  # rubber on a hard floor
_USUAL_RAD_S = 100.0  # to which PyBullet holds joints, unless told otherwise: small wheels of a fast robot turn faster
_HULL, _WHEELS = -1, (0, 1)  # links of a robot
_NEAR_M = 0.05  # gap between hulls, by their radii, from which on contact is looked for
_Pose = tuple[float, float, float]  # x, y [m], yaw [rad]
_free: list[int] = []  # clients of this process that no engine uses


class _Client:
    """A client of PyBullet with a world of obstacles in it.

    The world is built anew for each drive, for only that is reproducible bit by bit; clients are used again, for a
    client that was reset is as good as a new one, which takes five times as long.
    """

    def __init__(self, obstacles: Obstacles, models: Sequence[RobotModel]) -> None:
        self.number = _free.pop() if _free else pybullet.connect(pybullet.DIRECT)
        if self.number < 0:
            raise RuntimeError("PyBullet gave no physics client")
        with self.closed_on_error():
            pybullet.setPhysicsEngineParameter(**finest([accuracy(model) for model in models]),
                                               physicsClientId=self.number)
            pybullet.setGravity(0, 0, -9.81, physicsClientId=self.number)
            with deferring_ctrl_c(), _quiet():  # or it might come while both outputs lead nowhere
                self.solids = _build_world(obstacles, max(HEIGHT_M, *map(height_of, models)), self.number)

    @contextlib.contextmanager
    def closed_on_error(self) -> Iterator[None]:
        """Gives the client up if anything goes wrong: whatever state it is in."""
        try:
            yield
        except BaseException:
            pybullet.disconnect(physicsClientId=self.number)
            raise

    def close(self, error: BaseException | None, faults: Iterable[Fault | None]) -> None:
        """Keep the client for others, unless something went wrong: then it is in whatever state."""
        if error is not None or "physics failed" in faults:
            pybullet.disconnect(physicsClientId=self.number)
            return
        pybullet.resetSimulation(physicsClientId=self.number)
        _free.append(self.number)

    def advance(self) -> None:
        """Move all for one control step."""
        pybullet.stepSimulation(physicsClientId=self.number)


class _Robot:
    """A robot in the world of a client."""

    def __init__(self, client: _Client, model: RobotModel, pose: _Pose, disturbance: Disturbance,
                 floors: list[list[float]]) -> None:
        self._client, self._solids, self._floors = client.number, client.solids, floors
        self._model, self._disturbance = model, disturbance
        self._left = disturbance.wheel_gains[0] / model.wheel_radius_m
        self._right = disturbance.wheel_gains[1] / model.wheel_radius_m
        self._grips, self._last = [1.0, 1.0], pose
        torque = motor_torque(model)
        self._forces = (torque, torque)
        self._touching: set[int | None] = set()
        self.touches: list[Touch] = []
        self.fault: Fault | None = None
        self.body = self._build(pose)
        self._axle = None if model.body is None else _axle_in_base(self.body, self._client)

    def pose(self) -> _Pose:
        """x, y [m], yaw [rad]; the last that was known of a robot that has a fault."""
        (x, y, _), (qx, qy, qz, qw) = self.axle_placed()
        if not math.isfinite(x + y + qx + qy + qz + qw):
            self.fault = "physics failed"
            return self._last
        if 1 - 2 * (qx * qx + qy * qy) <= _UPRIGHT:
            self.fault = "tipped over"
            return self._last
        self._last = x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        return self._last

    def axle_placed(self) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
        """Place of the middle of the axle [m], and the robot's orientation as a quaternion."""
        place, turned = pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client)
        if self._axle is not None:  # else the base is its centre of mass
            place, turned = pybullet.multiplyTransforms(place, turned, *self._axle)
        return place, turned

    def command(self, left_m_s: float, right_m_s: float) -> None:
        """Set the speeds of the wheels for the next control step."""
        pybullet.setJointMotorControlArray(
            self.body, (0, 1), pybullet.VELOCITY_CONTROL, forces=self._forces, physicsClientId=self._client,
            targetVelocities=(left_m_s * self._left, right_m_s * self._right))
        if self._floors:
            self._grip_floor()

    def look_for_contacts(self, since_s: float) -> None:
        """Note whether it touches an obstacle."""
        self._note(None, pybullet.getContactPoints(self.body, self._solids, physicsClientId=self._client), since_s)

    def look_at(self, robot: int, other: _Robot, since_s: float) -> bool:
        """Note whether it touches another robot; whether it does so anew."""
        before = robot in self._touching
        self._note(robot, pybullet.getContactPoints(self.body, other.body, physicsClientId=self._client), since_s)
        return robot in self._touching and not before

    def _note(self, other: int | None, near: Sequence[tuple[Any, ...]], since_s: float) -> None:
        places = [point[_PLACE] for point in near if point[_DISTANCE] <= 0]
        period = _CONTACT_STEPS / CONTROL_HZ
        if places and other in self._touching:
            last = max(k for k, touch in enumerate(self.touches) if touch.robot == other)
            self.touches[last] = replace(self.touches[last], lasted_s=self.touches[last].lasted_s + period)
        elif places:
            self.touches.append(Touch(since_s=since_s, lasted_s=period, x_m=places[0][0], y_m=places[0][1],
                                      robot=other))
            self._touching.add(other)
        else:
            self._touching.discard(other)

    def _grip_floor(self) -> None:
        """Give each wheel the friction of the floor that it stands on."""
        x, y, yaw = self.pose()
        half = self._model.track_m * self._disturbance.track_gain / 2
        for wheel, side in enumerate((half, -half)):
            px, py, grip = x - side * math.sin(yaw), y + side * math.cos(yaw), _WHEEL_FRICTION
            for fx, fy, hx, hy, turned, friction in self._floors:
                c, s = math.cos(turned), math.sin(turned)
                if abs(c * (px - fx) + s * (py - fy)) <= hx and abs(-s * (px - fx) + c * (py - fy)) <= hy:
                    grip = friction
            if grip != self._grips[wheel]:
                self._grips[wheel] = grip
                pybullet.changeDynamics(self.body, wheel, lateralFriction=grip, physicsClientId=self._client)

    def _build(self, pose: _Pose) -> int:
        model, client = self._model, self._client
        track, payload = model.track_m * self._disturbance.track_gain, self._disturbance.payload_kg
        if model.body is None:
            parts = round_body(model)
            body = _create_round(replace(parts, track_m=track, base_kg=parts.base_kg + payload), pose, client)
        else:
            own = replace(model.body, base_kg=model.body.base_kg + payload)
            body = _load_own(body_urdf(own, model, track), model, pose, client)
        smooth = {"linearDamping": 0.0, "angularDamping": 0.0, "physicsClientId": client}
        rough = self._disturbance.hull_friction > 0
        # PyBullet multiplies the frictions of two bodies: robots slide along each other.
        pybullet.changeDynamics(body, -1, lateralFriction=_CASTER_FRICTION if rough else 0.0, **smooth)
        if rough:
            pybullet.changeDynamics(self._solids, -1, physicsClientId=client,
                                    lateralFriction=self._disturbance.hull_friction / _CASTER_FRICTION)
        for link in _WHEELS:
            pybullet.changeDynamics(body, link, lateralFriction=_WHEEL_FRICTION, jointDamping=0.0, **smooth)
            fastest = fastest_wheel_rad_s(model)
            if 2 * fastest > _USUAL_RAD_S:
                pybullet.changeDynamics(body, link, maxJointVelocity=2 * fastest, physicsClientId=client)
        _part_wheels(body, self._solids, (_HULL,), client)
        return body


class Bullet:
    """A world of obstacles with one robot in it, in PyBullet.

    Robots that don't meet have a world each; filtering collisions between them would not be the same.
    """

    def __init__(self, obstacles: Obstacles, model: RobotModel, pose: _Pose, disturbance: Disturbance) -> None:
        self._steps = 0
        self._client = _Client(obstacles, [model])
        with self._client.closed_on_error():
            self._robot = _Robot(self._client, model, pose, disturbance, obstacles.floors.tolist())
        self.pose, self.touches = self._robot.pose, self._robot.touches

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._client.close(error, [self._robot.fault])

    @property
    def fault(self) -> Fault | None:
        """Why it drives no more though nothing holds it."""
        return self._robot.fault

    def tilt_rad(self) -> float:
        """Angle between the robot's upright axis and the vertical: some milliradians, unless it tips over."""
        _, (qx, qy, _, _) = self._robot.axle_placed()
        return math.acos(max(-1.0, 1 - 2 * (qx * qx + qy * qy)))

    def step(self, left_m_s: float, right_m_s: float) -> None:
        """Advance by one control step."""
        self._robot.command(left_m_s, right_m_s)
        self._client.advance()
        self._steps += 1
        if self._steps % _CONTACT_STEPS == 0:
            self._robot.look_for_contacts(self._steps / CONTROL_HZ)


class BulletTeam:
    """A world of obstacles with several robots in it, in PyBullet; with one robot it is ``Bullet`` to the bit."""

    def __init__(self, obstacles: Obstacles, robots: Sequence[tuple[RobotModel, _Pose, Disturbance]]) -> None:
        self._steps = 0
        self._client = _Client(obstacles, [model for model, _, _ in robots])
        with self._client.closed_on_error():
            self._robots = [_Robot(self._client, *robot, obstacles.floors.tolist()) for robot in robots]
        self._stood = [False] * len(robots)
        radii = [model.radius_m for model, _, _ in robots]
        self._pairs = [(i, j, radii[i] + radii[j] + _NEAR_M) for j in range(len(robots)) for i in range(j)]
        for one, other in itertools.permutations(self._robots, 2):
            _part_wheels(one.body, other.body, (_HULL, *_WHEELS), self._client.number)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._client.close(error, [robot.fault for robot in self._robots])

    def touches(self, robot: int) -> Sequence[Touch]:
        """Each time that a robot's hull came to touch an obstacle or another robot, so far."""
        return self._robots[robot].touches

    def faults(self) -> dict[int, Fault]:
        """Why robots drive no more though nothing holds them, by their numbers."""
        return {number: robot.fault for number, robot in enumerate(self._robots) if robot.fault}

    def step(self, wheels_m_s: Sequence[tuple[float, float]], poses: FloatArray) -> list[tuple[int, int]]:
        """Advance by one control step.

        Args:
            wheels_m_s: Speed along the floor that the left and the right wheel of each robot are commanded to have,
                before the disturbance.
            poses: Receives x, y [m], yaw [rad] of each robot, shape (n, 3).

        Returns:
            Pairs of robots that came to touch.
        """
        for number, (left, right) in enumerate(wheels_m_s):
            stands = left == 0.0 and right == 0.0
            if not (stands and self._stood[number]):
                self._robots[number].command(left, right)
            self._stood[number] = stands
        self._client.advance()
        self._steps += 1
        placed = [robot.pose() for robot in self._robots]
        poses[:] = placed
        return self._look_for_contacts(placed) if self._steps % _CONTACT_STEPS == 0 else []

    def _look_for_contacts(self, placed: Sequence[_Pose]) -> list[tuple[int, int]]:
        since_s, met = self._steps / CONTROL_HZ, []
        for robot in self._robots:
            robot.look_for_contacts(since_s)
        for i, j, near_m in self._pairs:
            if math.hypot(placed[i][0] - placed[j][0], placed[i][1] - placed[j][1]) < near_m:
                self._robots[j].look_at(i, self._robots[i], since_s)
                if self._robots[i].look_at(j, self._robots[j], since_s):
                    met.append((i, j))
        return met


def _build_world(obstacles: Obstacles, height_m: float, client: int) -> int:
    floor = pybullet.createMultiBody(
        0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    # Casters that hover over the floor are no contacts to solve for: they'd take a sixth of the time.
    pybullet.changeDynamics(floor, -1, lateralFriction=1.0, contactProcessingThreshold=CASTER_GAP_M / 2,
                            physicsClientId=client)
    # One compound body for all obstacles: its own tree finds the few that are near. Only a URDF may hold more
    # than 16 shapes: createCollisionShapeArray drops the others without a word.
    return _load(obstacles_urdf(obstacles, height_m), useFixedBase=True, physicsClientId=client)


def _load(urdf: str, **options: Any) -> int:
    with tempfile.NamedTemporaryFile("w", suffix=".urdf", encoding="utf-8") as file:
        file.write(urdf)
        file.flush()
        body: int = pybullet.loadURDF(file.name, **options)
    return body


def _load_own(urdf: str, model: RobotModel, pose: _Pose, client: int) -> int:
    with _quiet():
        return _load(urdf, basePosition=[pose[0], pose[1], model.wheel_radius_m],
                     baseOrientation=_upright(pose[2]), physicsClientId=client,
                     flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER)


def _create_round(parts: RoundBody, pose: _Pose, client: int) -> int:
    base = pybullet.createCollisionShapeArray(
        shapeTypes=[pybullet.GEOM_CYLINDER, pybullet.GEOM_SPHERE, pybullet.GEOM_SPHERE],
        radii=list(parts.radii_m), lengths=[parts.hull_m, 0, 0], halfExtents=[[0, 0, 0]] * 3,
        collisionFramePositions=[list(at) for at in parts.at_m],
        collisionFrameOrientations=[[0, 0, 0, 1]] * 3, physicsClientId=client)
    tyre = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=parts.wheel_radius_m, physicsClientId=client)
    body: int = pybullet.createMultiBody(
        baseMass=parts.base_kg, baseCollisionShapeIndex=base, basePosition=[pose[0], pose[1], parts.wheel_radius_m],
        baseOrientation=_upright(pose[2]), linkMasses=[parts.wheel_kg] * 2,
        linkCollisionShapeIndices=[tyre, tyre], linkVisualShapeIndices=[-1, -1],
        linkPositions=[[0, parts.track_m / 2, 0], [0, -parts.track_m / 2, 0]],
        linkOrientations=[[0, 0, 0, 1]] * 2, linkInertialFramePositions=[[0, 0, 0]] * 2,
        linkInertialFrameOrientations=[[0, 0, 0, 1]] * 2, linkParentIndices=[0, 0],
        linkJointTypes=[pybullet.JOINT_REVOLUTE] * 2, linkJointAxis=[[0, 1, 0]] * 2, physicsClientId=client)
    return body


def _axle_in_base(body: int, client: int) -> tuple[Any, Any]:
    """The middle of the axle in the frame that PyBullet reports of the base: that of its principal inertia."""
    place, turned = pybullet.getDynamicsInfo(body, -1, physicsClientId=client)[3:5]
    axle: tuple[Any, Any] = pybullet.invertTransform(place, turned)
    return axle


def _part_wheels(body: int, other: int, links: Sequence[int], client: int) -> None:
    """Let a robot's wheels not touch a body: as spheres they stick out farther than the hull, of which wheels of a body
    of its own are a part as the cylinders that they are."""
    for wheel, link in itertools.product(_WHEELS, links):
        pybullet.setCollisionFilterPair(body, other, wheel, link, 0, physicsClientId=client)


def _upright(yaw: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
