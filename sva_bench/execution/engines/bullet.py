"""Physics: a robot among obstacles in PyBullet. The only importer of pybullet."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

from sva_bench.choices import Fault
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
from sva_bench.robot.model import MOTOR_RESERVE, RobotModel


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

PHYSICS_HZ, _FINE_HZ = 60.0, 120.0  # 960 Hz and a residual of 1e-7 give leg times within 0.2 % of these
_ITERATIONS, _FINE_ITERATIONS = 50, 200  # at most: at the usual residual, and at a finer one
_RESIDUAL = 1e-4  # ends the iterations early
_OWN_RESIDUAL = 1e-5  # of bodies that were not made for the solver, as round ones are
_WHEEL_RAD_S, _WHEEL_RAD_S2 = 5.0, 7.0  # slower or more slowly accelerated wheels don't bear that residual [rad2/s2]
_FAST_RAD_S = 30.0  # wheels that turn faster don't bear 60 Hz: up to 1.5 % of a leg's time
_CONTACT_STEPS = 3  # control steps from one look at contacts to the next: 50 ms
_PLACE, _DISTANCE = 5, 8  # where a contact point of PyBullet has its place on the robot, and its distance
_UPRIGHT = 0.7  # cosine of the tilt at which a robot has tipped over
_CASTER_FRICTION = 0.01  # of the hull in PyBullet, with the casters, which slide; obstacles make up for it
_WHEEL_FRICTION = 1.0  # rubber on a hard floor
_USUAL_RAD_S = 100.0  # to which PyBullet holds joints, unless told otherwise: small wheels of a fast robot turn faster
_ROBOT, _STATIC, _FLOOR = 1, 2, 64  # groups of bodies: Bullet's own for moving and fixed ones, and one of ours
_free: list[int] = []  # clients of this process that no engine uses


class Bullet:
    """A world of obstacles with one robot in it, in PyBullet.

    Robots that don't meet have a client each; filtering collisions between them would not be the same. The world is
    built anew for each engine, for only that is reproducible bit by bit; clients are used again, for a client that was
    reset is as good as a new one, which takes five times as long.
    """

    def __init__(self, obstacles: Obstacles, model: RobotModel, pose: tuple[float, float, float],
                 disturbance: Disturbance) -> None:
        self._model = model
        self._left = disturbance.wheel_gains[0] / model.wheel_radius_m
        self._right = disturbance.wheel_gains[1] / model.wheel_radius_m
        self._steps, self._touched = 0, False
        self.touches: list[Touch] = []
        self.fault: Fault | None = None
        self._disturbance, self._floors = disturbance, obstacles.floors.tolist()
        self._grips = [1.0, 1.0]
        self._last = pose
        torque = motor_torque(model)
        self._forces = (torque, torque)
        self._client = _free.pop() if _free else pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise RuntimeError("PyBullet gave no physics client")
        try:
            pybullet.setPhysicsEngineParameter(**_accuracy(model), physicsClientId=self._client)
            pybullet.setGravity(0, 0, -9.81, physicsClientId=self._client)
            with deferring_ctrl_c(), _quiet():  # or it might come while both outputs lead nowhere
                self._solids = self._build_world(obstacles)
            self._body = self._build_robot(pose)
            self._axle = None if model.body is None else _axle_in_base(self._body, self._client)
        except BaseException:
            pybullet.disconnect(physicsClientId=self._client)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if error is not None or self.fault == "physics failed":  # whatever state it is in
            pybullet.disconnect(physicsClientId=self._client)
            return
        pybullet.resetSimulation(physicsClientId=self._client)
        _free.append(self._client)

    def pose(self) -> tuple[float, float, float]:
        """x, y [m], yaw [rad]."""
        (x, y, _), (qx, qy, qz, qw) = self._axle_placed()
        if not math.isfinite(x + y + qx + qy + qz + qw):
            self.fault = "physics failed"
            return self._last
        if 1 - 2 * (qx * qx + qy * qy) <= _UPRIGHT:
            self.fault = "tipped over"
            return self._last
        self._last = x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        return self._last

    def tilt_rad(self) -> float:
        """Angle between the robot's upright axis and the vertical: some milliradians, unless it tips over."""
        _, (qx, qy, _, _) = self._axle_placed()
        return math.acos(max(-1.0, 1 - 2 * (qx * qx + qy * qy)))

    def _axle_placed(self) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
        """Place of the middle of the axle [m], and the robot's orientation as a quaternion."""
        place, turned = pybullet.getBasePositionAndOrientation(self._body, physicsClientId=self._client)
        if self._axle is not None:  # else the base is its centre of mass
            place, turned = pybullet.multiplyTransforms(place, turned, *self._axle)
        return place, turned

    def step(self, left_m_s: float, right_m_s: float) -> None:
        """Advance by one control step."""
        pybullet.setJointMotorControlArray(
            self._body, (0, 1), pybullet.VELOCITY_CONTROL, forces=self._forces, physicsClientId=self._client,
            targetVelocities=(left_m_s * self._left, right_m_s * self._right))
        if self._floors:
            self._grip_floor()
        pybullet.stepSimulation(physicsClientId=self._client)
        self._steps += 1
        if self._steps % _CONTACT_STEPS == 0:
            self._look_for_contacts()

    def _look_for_contacts(self) -> None:
        near = pybullet.getContactPoints(self._body, self._solids, physicsClientId=self._client)
        places = [point[_PLACE] for point in near if point[_DISTANCE] <= 0]
        period = _CONTACT_STEPS / CONTROL_HZ
        if places and self._touched:
            self.touches[-1] = replace(self.touches[-1], lasted_s=self.touches[-1].lasted_s + period)
        elif places:
            self.touches.append(Touch(since_s=self._steps / CONTROL_HZ, lasted_s=period, x_m=places[0][0],
                                      y_m=places[0][1]))
        self._touched = bool(places)

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
                pybullet.changeDynamics(self._body, wheel, lateralFriction=grip, physicsClientId=self._client)

    def _build_world(self, obstacles: Obstacles) -> int:
        floor = pybullet.createMultiBody(
            0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client),
            physicsClientId=self._client)
        # Casters that hover over the floor are no contacts to solve for: they'd take a sixth of the time.
        pybullet.setCollisionFilterGroupMask(floor, -1, _STATIC | _FLOOR, -1, physicsClientId=self._client)
        pybullet.changeDynamics(floor, -1, lateralFriction=1.0, contactProcessingThreshold=CASTER_GAP_M / 2,
                                physicsClientId=self._client)
        # One compound body for all obstacles: its own tree finds the few that are near. Only a URDF may hold more
        # than 16 shapes: createCollisionShapeArray drops the others without a word.
        height_m = max(HEIGHT_M, height_of(self._model))
        return _load(obstacles_urdf(obstacles, height_m), useFixedBase=True, physicsClientId=self._client)

    def _build_robot(self, pose: tuple[float, float, float]) -> int:
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
        # PyBullet multiplies the frictions of two bodies.
        pybullet.changeDynamics(body, -1, lateralFriction=_CASTER_FRICTION if rough else 0.0, **smooth)
        if rough:
            pybullet.changeDynamics(self._solids, -1, physicsClientId=client,
                                    lateralFriction=self._disturbance.hull_friction / _CASTER_FRICTION)
        for link in (0, 1):
            pybullet.changeDynamics(body, link, lateralFriction=_WHEEL_FRICTION, jointDamping=0.0, **smooth)
            fastest = fastest_wheel_rad_s(model)
            if 2 * fastest > _USUAL_RAD_S:
                pybullet.changeDynamics(body, link, maxJointVelocity=2 * fastest, physicsClientId=client)
        return body


def fastest_wheel_rad_s(model: RobotModel) -> float:
    """Fastest that a wheel turns, driving and turning at a time."""
    return (model.followed_speed_m_s + model.max_turn_rad_s * model.track_m / 2) / model.wheel_radius_m


def motor_torque(model: RobotModel) -> float:
    """Greatest torque of a wheel's motor [Nm]: several times what the robot's limits ask for, driving or turning."""
    turning = model.turn_inertia_m2 * model.turn_acceleration_rad_s2 / model.track_m
    force = max(model.acceleration_m_s2, model.acceleration_m_s2 / 2 + turning)  # of each wheel, per mass [m/s2]
    return MOTOR_RESERVE * model.mass_kg * force * model.wheel_radius_m


def _accuracy(model: RobotModel) -> dict[str, float]:
    """Steps and solver of the physics: finer for wheels that are so slow, or so fast, that it would show,
    and for bodies of their own."""
    turning = model.track_m / 2
    speed = min(model.followed_speed_m_s, model.max_turn_rad_s * turning) / model.wheel_radius_m
    acceleration = min(model.acceleration_m_s2, model.turn_acceleration_rad_s2 * turning) / model.wheel_radius_m
    slowness = min(speed / _WHEEL_RAD_S, acceleration / _WHEEL_RAD_S2, 1.0)
    own = model.body is not None
    fast = own or fastest_wheel_rad_s(model) > _FAST_RAD_S
    return {"fixedTimeStep": 1.0 / CONTROL_HZ,
            "numSubSteps": round((_FINE_HZ if fast or slowness < 1 else PHYSICS_HZ) / CONTROL_HZ),
            "numSolverIterations": _ITERATIONS if slowness == 1 and not own else _FINE_ITERATIONS,
            "solverResidualThreshold": (_OWN_RESIDUAL if own else _RESIDUAL) * slowness**2, "enableConeFriction": 0,
            "deterministicOverlappingPairs": 1}


def _load(urdf: str, **options: Any) -> int:
    with tempfile.NamedTemporaryFile("w", suffix=".urdf", encoding="utf-8") as file:
        file.write(urdf)
        file.flush()
        body: int = pybullet.loadURDF(file.name, **options)
    return body


def _load_own(urdf: str, model: RobotModel, pose: tuple[float, float, float], client: int) -> int:
    with _quiet():
        body = _load(urdf, basePosition=[pose[0], pose[1], model.wheel_radius_m],
                     baseOrientation=_upright(pose[2]), physicsClientId=client,
                     flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER)
    for link in (0, 1):  # they roll on the floor as spheres; what they touch obstacles with is among the hull's solids
        pybullet.setCollisionFilterGroupMask(body, link, _ROBOT, _FLOOR, physicsClientId=client)
    return body


def _create_round(parts: RoundBody, pose: tuple[float, float, float], client: int) -> int:
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


def _upright(yaw: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
