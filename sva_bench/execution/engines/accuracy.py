"""How finely the physics of a robot is solved, and how strong its motors are: figures that follow from its model."""

from __future__ import annotations

from collections.abc import Sequence

from sva_bench.execution.engines.bodies import lightness
from sva_bench.robot.follower import CONTROL_HZ
from sva_bench.robot.model import RobotModel

PHYSICS_HZ, _FINE_HZ = 60.0, 120.0  # 960 Hz and a residual of 1e-7 give leg times within 0.2 % of these
_ITERATIONS, _FINE_ITERATIONS = 50, 200  # at most: at the usual residual, and at a finer one
_RESIDUAL = 1e-4  # ends the iterations early
_OWN_RESIDUAL = 1e-5  # of bodies that were not made for the solver, as round ones are
_MOST_ITERATIONS = 3200  # however light the wheels are
_WHEEL_RAD_S, _WHEEL_RAD_S2 = 5.0, 7.0  # slower or more slowly accelerated wheels don't bear that residual [rad2/s2]
_FAST_RAD_S = 30.0  # wheels that turn faster don't bear 60 Hz: up to 1.5 % of a leg's time
_MOTOR_G = 3.0  # motor torque, in multiples of what accelerates the robot as its limits allow


def fastest_wheel_rad_s(model: RobotModel) -> float:
    """Fastest that a wheel turns, driving and turning at a time."""
    return (model.followed_speed_m_s + model.max_turn_rad_s * model.track_m / 2) / model.wheel_radius_m


def motor_torque(model: RobotModel) -> float:
    """Greatest torque of a wheel's motor [Nm]: several times what the robot's limits ask for, driving or turning."""
    turning = model.turn_inertia_m2 * model.turn_acceleration_rad_s2 / model.track_m
    force = max(model.acceleration_m_s2, model.acceleration_m_s2 / 2 + turning)  # of each wheel, per mass [m/s2]
    return _MOTOR_G * model.mass_kg * force * model.wheel_radius_m


def accuracy(model: RobotModel) -> dict[str, float]:
    """Steps and solver of the physics: finer for wheels that are so slow, or so fast, that it would show,
    and for bodies of their own."""
    turning = model.track_m / 2
    speed = min(model.followed_speed_m_s, model.max_turn_rad_s * turning) / model.wheel_radius_m
    acceleration = min(model.acceleration_m_s2, model.turn_acceleration_rad_s2 * turning) / model.wheel_radius_m
    slowness = min(speed / _WHEEL_RAD_S, acceleration / _WHEEL_RAD_S2, 1.0)
    own = model.body is not None
    iterations = _ITERATIONS if slowness == 1 and not own else _FINE_ITERATIONS
    fast = own or fastest_wheel_rad_s(model) > _FAST_RAD_S
    return {"fixedTimeStep": 1.0 / CONTROL_HZ,
            "numSubSteps": round((_FINE_HZ if fast or slowness < 1 else PHYSICS_HZ) / CONTROL_HZ),
            "numSolverIterations": min(round(iterations * lightness(model)), _MOST_ITERATIONS),
            "solverResidualThreshold": (_OWN_RESIDUAL if own else _RESIDUAL) * slowness**2, "enableConeFriction": 0,
            "deterministicOverlappingPairs": 1}


def finest(settings: Sequence[dict[str, float]]) -> dict[str, float]:
    """Settings that are fine enough for all robots of a world."""
    return {key: (min if key == "solverResidualThreshold" else max)(each[key] for each in settings)
            for key in settings[0]}
