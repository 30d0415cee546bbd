"""Physics: one robot driving one route in PyBullet. The only importer of pybullet."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.interrupts import deferring_ctrl_c
from sva_bench.robot.follower import ARRIVED, CONTROL_HZ, DRIVE, Stretch, control, new_state
from sva_bench.robot.model import CASTERS_AT, RobotModel
from sva_bench.robot.twin import patience_steps


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

PHYSICS_HZ = 120.0
_SUBSTEPS = round(PHYSICS_HZ / CONTROL_HZ)
_ITERATIONS, _FINE_ITERATIONS = 50, 200  # at most: at the usual residual, and at a finer one
_RESIDUAL = 1e-4  # ends the iterations early: 1.6 times faster; leg times keep within 0.6 % of the twin
_WHEEL_RAD_S, _WHEEL_RAD_S2 = 5.0, 7.0  # slower or more slowly accelerated wheels don't bear that residual [rad2/s2]
_WALL_M = 0.2  # thickness of the walls about the bounds; nothing is seen of it
_HEIGHT_M = 0.5  # of all obstacles; taller than any robot's hull
_CASTER_GAP_M = 0.001  # casters touch the floor only when the hull tilts, so the weight rests on the driven wheels
_WHEEL_FRICTION = 1.0  # rubber on a hard floor
_USUAL_RAD_S = 100.0  # to which PyBullet holds joints, unless told otherwise: small wheels of a fast robot turn faster
_MOTOR_G = 3.0  # motor torque, in multiples of what accelerates the robot as its limits allow
_STUCK_CHECK_S = 10.0  # a robot that hardly moves or turns for so long is stuck
_STUCK_M, _STUCK_RAD = 0.02, 0.05
_STUCK_DRIVING = 0.5  # share of the time between two checks spent on the way from which on only progress counts


class Simulator:
    """A world of obstacles with one robot in it: one physics client.

    Robots that don't meet have a client each; filtering collisions between them would not be the same.
    Use it as a context manager; each drive wants a fresh one, for only that is reproducible bit by bit.
    """

    def __init__(
        self, obstacles: Obstacles, model: RobotModel, pose: tuple[float, float, float],
        wheel_gains: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        self._model, self._gains = model, wheel_gains
        residual = _residual(model)
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise RuntimeError("PyBullet gave no physics client")
        try:
            pybullet.setPhysicsEngineParameter(
                fixedTimeStep=1.0 / CONTROL_HZ, numSubSteps=_SUBSTEPS, deterministicOverlappingPairs=1,
                numSolverIterations=_ITERATIONS if residual == _RESIDUAL else _FINE_ITERATIONS,
                solverResidualThreshold=residual, physicsClientId=self._client)
            pybullet.setGravity(0, 0, -9.81, physicsClientId=self._client)
            with deferring_ctrl_c(), _quiet():  # or it might come while both outputs lead nowhere
                self._build_world(obstacles)
            self._body = self._build_robot(pose)
        except BaseException:
            pybullet.disconnect(physicsClientId=self._client)
            raise

    def __enter__(self) -> Simulator:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        pybullet.disconnect(physicsClientId=self._client)

    def _build_world(self, obstacles: Obstacles) -> None:
        floor = pybullet.createMultiBody(
            0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client),
            physicsClientId=self._client)
        pybullet.changeDynamics(floor, -1, lateralFriction=1.0, physicsClientId=self._client)
        # One compound body for all obstacles: its own tree finds the few that are near. Only a URDF may hold more
        # than 16 shapes: createCollisionShapeArray drops the others without a word.
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "obstacles.urdf")
            path.write_text(obstacles_urdf(obstacles), encoding="utf-8")
            pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=self._client)

    def _build_robot(self, pose: tuple[float, float, float]) -> int:
        model, client = self._model, self._client
        wheel, hull = model.wheel_radius_m, 1.5 * model.wheel_radius_m
        caster = wheel / 2
        reach = CASTERS_AT * model.radius_m
        base = pybullet.createCollisionShapeArray(
            shapeTypes=[pybullet.GEOM_CYLINDER, pybullet.GEOM_SPHERE, pybullet.GEOM_SPHERE],
            radii=[model.radius_m, caster, caster], lengths=[2 * hull, 0, 0], halfExtents=[[0, 0, 0]] * 3,
            collisionFramePositions=[[0, 0, hull - wheel / 2], [reach, 0, _CASTER_GAP_M - caster],
                                     [-reach, 0, _CASTER_GAP_M - caster]],
            collisionFrameOrientations=[[0, 0, 0, 1]] * 3, physicsClientId=client)
        # Spheres roll on one point: the speed is right to 0.1 %, where cylinder wheels are 2.4 % off and drift.
        tyre = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=wheel, physicsClientId=client)
        body: int = pybullet.createMultiBody(
            baseMass=0.9 * model.mass_kg, baseCollisionShapeIndex=base, basePosition=[pose[0], pose[1], wheel],
            baseOrientation=_upright(pose[2]), linkMasses=[0.05 * model.mass_kg] * 2,
            linkCollisionShapeIndices=[tyre, tyre], linkVisualShapeIndices=[-1, -1],
            linkPositions=[[0, model.track_m / 2, 0], [0, -model.track_m / 2, 0]],
            linkOrientations=[[0, 0, 0, 1]] * 2, linkInertialFramePositions=[[0, 0, 0]] * 2,
            linkInertialFrameOrientations=[[0, 0, 0, 1]] * 2, linkParentIndices=[0, 0],
            linkJointTypes=[pybullet.JOINT_REVOLUTE] * 2, linkJointAxis=[[0, 1, 0]] * 2, physicsClientId=client)
        smooth = {"linearDamping": 0.0, "angularDamping": 0.0, "physicsClientId": client}
        pybullet.changeDynamics(body, -1, lateralFriction=0.0, **smooth)  # casters and hull slide
        for link in (0, 1):
            pybullet.changeDynamics(body, link, lateralFriction=_WHEEL_FRICTION, jointDamping=0.0, **smooth)
            fastest = (model.followed_speed_m_s + model.max_turn_rad_s * model.track_m / 2) / wheel
            if 2 * fastest > _USUAL_RAD_S:
                pybullet.changeDynamics(body, link, maxJointVelocity=2 * fastest, physicsClientId=client)
        return body

    def pose(self) -> tuple[float, float, float]:
        """x, y [m], yaw [rad]."""
        (x, y, _), (qx, qy, qz, qw) = pybullet.getBasePositionAndOrientation(self._body, physicsClientId=self._client)
        return x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))

    def drive(self, course: Sequence[Stretch], poses: list[tuple[float, float, float]] | None = None
              ) -> tuple[float, bool]:
        """Drive the stretches of one hop.

        Args:
            course: The stretches.
            poses: Receives the pose after each control step; ``None`` keeps none.

        Returns:
            Driving time [s], and whether the robot arrived; False if it got stuck.
        """
        model, client, body = self._model, self._client, self._body
        limits, dt, radius, half = model.limits, 1.0 / CONTROL_HZ, model.wheel_radius_m, model.track_m / 2
        torque = motor_torque(model)
        left_gain, right_gain = self._gains
        check = round(_STUCK_CHECK_S * CONTROL_HZ)
        total = 0
        for stretch in course:
            state, since_yaw, since_s, driving = new_state(), self.pose()[2], 0.0, 0
            for step in range(1, patience_steps(stretch, model) + 1):
                x, y, yaw = self.pose()
                speed, rate = control(stretch.path, stretch.arc, stretch.heading_rad, limits, state, x, y, yaw, dt)
                if state[0] == ARRIVED:
                    break
                pybullet.setJointMotorControlArray(
                    body, (0, 1), pybullet.VELOCITY_CONTROL, forces=(torque, torque), physicsClientId=client,
                    targetVelocities=((speed - half * rate) * left_gain / radius,
                                      (speed + half * rate) * right_gain / radius))
                pybullet.stepSimulation(physicsClientId=client)
                total += 1
                driving += state[0] == DRIVE
                if poses is not None:
                    poses.append(self.pose())
                if step % check == 0:
                    # On the way only progress along the path counts: a robot that pushes a wall sways and slides.
                    # One that has turned for nearly all of the time has not had any to make progress.
                    turned = abs(math.remainder(yaw - since_yaw, 2 * math.pi)) >= _STUCK_RAD
                    on_the_way = state[0] == DRIVE and driving >= _STUCK_DRIVING * check
                    if state[1] - since_s < _STUCK_M and (on_the_way or not turned):
                        return total * dt, False
                    since_yaw, since_s, driving = yaw, float(state[1]), 0
            else:
                return total * dt, False
        return total * dt, True


def motor_torque(model: RobotModel) -> float:
    """Greatest torque of a wheel's motor [Nm]: several times what the robot's limits ask for, driving or turning."""
    turning = model.turn_inertia_m2 * model.turn_acceleration_rad_s2 / model.track_m
    force = max(model.acceleration_m_s2, model.acceleration_m_s2 / 2 + turning)  # of each wheel, per mass [m/s2]
    return _MOTOR_G * model.mass_kg * force * model.wheel_radius_m


def _residual(model: RobotModel) -> float:
    """Residual at which the solver's iterations may end: less where wheels are so slow that it would show."""
    turning = model.track_m / 2
    speed = min(model.followed_speed_m_s, model.max_turn_rad_s * turning) / model.wheel_radius_m
    acceleration = min(model.acceleration_m_s2, model.turn_acceleration_rad_s2 * turning) / model.wheel_radius_m
    return _RESIDUAL * min(speed / _WHEEL_RAD_S, acceleration / _WHEEL_RAD_S2, 1.0) ** 2


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


def _upright(yaw: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def downsampled(poses: Sequence[tuple[float, float, float]], keep_hz: float) -> tuple[FloatArray, FloatArray]:
    """Times since the first control step [s] and poses at a lower rate, the last always among them."""
    every = max(round(CONTROL_HZ / keep_hz), 1)
    kept = sorted({*range(every - 1, len(poses), every), len(poses) - 1}) if poses else []
    return np.array([(k + 1) / CONTROL_HZ for k in kept]), np.array([poses[k] for k in kept]).reshape(-1, 3)
