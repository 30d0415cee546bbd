"""Robot models: the figures of a differential-drive robot."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from sva_bench.arrays import FloatArray
from sva_bench.robot.body import GRAVITY_M_S2, OwnBody

LOOKAHEAD_M = 0.25
"""How far ahead on its path a robot looks; shorter oscillates, longer cuts corners by more than the planning margin."""

_STEERING = 0.3  # least turn acceleration x (time over the lookahead)^2 [rad]: with less the robot oscillates
_BRAKING_LOOKAHEADS = 2.0  # braking distance at most, in lookaheads: a bend is seen no earlier
_GRIP = 0.5  # share of the wheels' grip available to the accelerations: speed commands are steps, twice as fast
CASTERS_AT = 0.75
"""Where the casters are, before and behind the middle, in radii of the hull."""
_HULL_SHARE, _WHEELS_SHARE = 0.9, 0.1  # of the mass
_LEAST_TRACK = 0.6  # of a body's own, in radii of gyration; of round ones it is half the radius, which is 0.64
MOTOR_RESERVE = 3.0
"""Torque of the motors, in multiples of what accelerates the robot alone as its limits allow."""
_TIPPING = 1.5  # times its acceleration and braking is what a robot must bear without tipping


@dataclass(frozen=True, kw_only=True)
class RobotModel:
    """A differential-drive robot: two driven wheels on one axis through its centre, and ball casters.

    Round, unless it has a body of its own; then radius, wheel radius, track and mass are those of the body.

    Attributes:
        name: Its name.
        radius_m: Radius of the hull [m].
        wheel_radius_m: Radius of the driven wheels [m].
        track_m: Distance between the driven wheels [m].
        mass_kg: Mass of the whole robot [kg].
        max_speed_m_s: Greatest speed [m/s].
        max_turn_rad_s: Greatest turn rate in place [rad/s].
        acceleration_m_s2: Greatest acceleration and braking [m/s2].
        turn_acceleration_rad_s2: Greatest angular acceleration [rad/s2].
        body: Its own body; ``None`` = round.

    Raises:
        ValueError: If a figure is not positive and finite, or they don't make a robot that drives.
    """

    name: str
    radius_m: float
    wheel_radius_m: float
    track_m: float
    mass_kg: float
    max_speed_m_s: float
    max_turn_rad_s: float
    acceleration_m_s2: float
    turn_acceleration_rad_s2: float
    body: OwnBody | None = None

    def __post_init__(self) -> None:
        for name, value in self.figures().items():
            if isinstance(value, float | int) and not 0 < value < float("inf"):
                raise ValueError(f"{name} must be positive and finite, not {value}")
        if self.body is None:
            self._check_shape()
        else:
            self._check_balance(self.body)
        self._check_grip()

    def _check_shape(self) -> None:
        """Refuse figures that a round robot can't have, or that it would not drive with as it does by the twin."""
        if self.track_m / 2 + self.wheel_radius_m / 4 > self.radius_m:
            raise ValueError(f"a track of {self.track_m} m puts the wheels outside a hull of radius {self.radius_m} m")
        if self.wheel_radius_m * 2.5 > self.radius_m:
            raise ValueError(f"wheels of radius {self.wheel_radius_m} m are too large for a hull of radius "
                             f"{self.radius_m} m; at most 0.4 of it")
        if self.track_m < self.radius_m / 2:
            raise ValueError(f"a track of {self.track_m} m is too narrow for a hull of radius {self.radius_m} m: it "
                             "would sway about its wheels and not turn by what they do; at least half the radius")

    def _check_balance(self, body: OwnBody) -> None:
        """Refuse a body that tips over when it accelerates or brakes, or that sways about its wheels."""
        if body.wheel_load(self.track_m, self.wheel_radius_m, _TIPPING * self.acceleration_m_s2) <= 0:
            x, _, z = body.centre_of_all_m(self.track_m)
            raise ValueError(
                f"it would tip over when it accelerates or brakes at {self.acceleration_m_s2:g} m/s2: its mass is "
                f"centred {abs(x):.3f} m {'ahead of' if x >= 0 else 'behind'} the axle at a height of "
                f"{z + self.wheel_radius_m:z.3f} m, and it stands on the floor {body.front_m:z.3f} m ahead and "
                f"{body.rear_m:z.3f} m behind it; lower acceleration_m_s2, add a caster, or move the mass")
        _, aside, height = body.centre_of_all_m(self.track_m)
        thrown = self.followed_speed_m_s * self.max_turn_rad_s / GRAVITY_M_S2 * (height + self.wheel_radius_m)
        if abs(aside) + thrown >= self.track_m / 2:
            raise ValueError(
                f"it would tip over sideways in a curve at {self.followed_speed_m_s:g} m/s and "
                f"{self.max_turn_rad_s:g} rad/s: its mass is centred {abs(aside):.3f} m aside at a height of "
                f"{height + self.wheel_radius_m:z.3f} m, over a track of {self.track_m:.3f} m; lower max_turn_rad_s or "
                "max_speed_m_s, or move the mass")
        gyration = math.sqrt(self.turn_inertia_m2)
        if self.track_m < _LEAST_TRACK * gyration:
            raise ValueError(
                f"a track of {self.track_m:.3f} m is too narrow for a mass that reaches {gyration:.3f} m about the "
                f"vertical axis (radius of gyration): it would sway about its wheels; at least {_LEAST_TRACK:g} of it")

    def _check_grip(self) -> None:
        """Refuse accelerations at which the wheels would slip, so that the robot can't reach them.

        Each wheel bears half the weight, less what braking puts on the casters, and gives half of the force along and
        its share of the moment about the vertical axis; in a curve the turn rate may change at twice the limit.
        """
        if self.body is not None:
            load = self.body.wheel_load(self.track_m, self.wheel_radius_m, self.acceleration_m_s2)
            self._refuse_slip(0.5 * self.acceleration_m_s2, _GRIP * load)
            return
        lifted = _GRIP * self.wheel_radius_m / (CASTERS_AT * self.radius_m) / 2  # per acceleration along
        self._refuse_slip((0.5 + lifted) * self.acceleration_m_s2, _GRIP * GRAVITY_M_S2 / 2)

    def _refuse_slip(self, along: float, grip: float) -> None:
        """Refuse accelerations that take more grip of a wheel than it has, per mass of the robot [m/s2]."""
        about = 2 * self.turn_inertia_m2 * self.turn_acceleration_rad_s2 / self.track_m
        if along + about > grip:
            key, most = ("acceleration_m_s2", self.acceleration_m_s2) if along > about else (
                "turn_acceleration_rad_s2", self.turn_acceleration_rad_s2)
            raise ValueError(f"the wheels would slip: driving and turning at these accelerations take "
                             f"{(along + about) / grip:.1f} times the grip that the wheels can count on; {key} asks "
                             f"for most of it: lower it from {most:g}")

    @property
    def limits(self) -> FloatArray:
        """Speed [m/s], turn rate [rad/s], acceleration [m/s2], angular acceleration [rad/s2] to drive at, compiled."""
        return np.array([self.followed_speed_m_s, self.max_turn_rad_s, self.acceleration_m_s2,
                         self.turn_acceleration_rad_s2])

    @property
    def followed_speed_m_s(self) -> float:
        """Greatest speed at which it follows a path [m/s]: it must steer and brake within its lookahead.

        Beyond it a robot oscillates about its path or overshoots bends, and the predicted times don't hold.
        """
        steered = LOOKAHEAD_M * math.sqrt(self.turn_acceleration_rad_s2 / _STEERING)
        braked = math.sqrt(2 * self.acceleration_m_s2 * _BRAKING_LOOKAHEADS * LOOKAHEAD_M)
        return min(self.max_speed_m_s, steered, braked)

    @property
    def turn_inertia_m2(self) -> float:
        """Moment of inertia about the vertical axis per mass [m2], as physics builds the robot."""
        if self.body is not None:
            return self.body.turn_inertia_m2(self.track_m)
        # Physics takes the inertia of the hull's bounding square: (2 r)^2 / 6.
        return _HULL_SHARE * self.radius_m**2 * 2 / 3 + _WHEELS_SHARE * (self.track_m / 2) ** 2

    def figures(self) -> dict[str, float | str]:
        """All figures by name."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "body"}


BUILT_IN = {
    # Kobuki: track as its driver has it, hull of 351.5 mm (user guide), speeds just below its limits; 6.3 kg with a
    # laptop on top and the accelerations of its velocity smoother are judgement. Its driver documents wheels of 35 mm;
    # 38 mm were taken once, and stay: wheels are commanded by their speed on the floor, so legs take the same time to
    # 0.3 % (measured), and every figure stored or shipped would move.
    "turtlebot2": RobotModel(
        name="turtlebot2", radius_m=0.177, wheel_radius_m=0.038, track_m=0.23, mass_kg=6.3, max_speed_m_s=0.65,
        max_turn_rad_s=1.9, acceleration_m_s2=0.8, turn_acceleration_rad_s2=3.0),
    # TurtleBot3 data sheet: speeds, wheel radius, separation, mass; the radius encloses the hull about the axis.
    "turtlebot3_burger": RobotModel(
        name="turtlebot3_burger", radius_m=0.105, wheel_radius_m=0.033, track_m=0.16, mass_kg=1.0, max_speed_m_s=0.22,
        max_turn_rad_s=2.84, acceleration_m_s2=0.8, turn_acceleration_rad_s2=3.0),
    "turtlebot3_waffle": RobotModel(
        name="turtlebot3_waffle", radius_m=0.22, wheel_radius_m=0.033, track_m=0.287, mass_kg=1.8, max_speed_m_s=0.26,
        max_turn_rad_s=1.82, acceleration_m_s2=0.8, turn_acceleration_rad_s2=3.0),
    # iRobot's create3_sim: wheels, track, accelerations, turn rate and the speed with safety on of its control.yaml;
    # mass of body and bumper of its URDF. The radius is judgement: the body's 0.164 m and the bumper about it.
    "create3": RobotModel(
        name="create3", radius_m=0.171, wheel_radius_m=0.03575, track_m=0.233, mass_kg=2.4, max_speed_m_s=0.306,
        max_turn_rad_s=1.9, acceleration_m_s2=0.9, turn_acceleration_rad_s2=7.725),
    # Clearpath's jackal_description: wheels, track, mass of chassis and wheels; turn rate of jackal_control; radius
    # half the diagonal of 508 x 430 mm (data sheet). Speed and accelerations are judgement: it is said to reach 2 m/s,
    # but a path is followed at no more than 1 m/s with the accelerations that two wheels have the grip for.
    "jackal": RobotModel(
        name="jackal", radius_m=0.333, wheel_radius_m=0.098, track_m=0.37559, mass_kg=18.431, max_speed_m_s=1.0,
        max_turn_rad_s=4.0, acceleration_m_s2=1.0, turn_acceleration_rad_s2=4.8),
    # Clearpath's husky_description and husky_control, likewise; radius half the diagonal of 990 x 670 mm (data sheet).
    # Speed and accelerations are judgement, for the same reason: its data sheet says 1 m/s.
    "husky": RobotModel(
        name="husky", radius_m=0.598, wheel_radius_m=0.1651, track_m=0.5708, mass_kg=56.582, max_speed_m_s=0.7,
        max_turn_rad_s=2.0, acceleration_m_s2=0.5, turn_acceleration_rad_s2=2.4),
}

USUAL_MODEL = "turtlebot2"
"""The built-in robot of proposed missions."""
