"""Robot models: the figures of a differential-drive robot."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields

import numpy as np

from sva_bench.arrays import FloatArray

LOOKAHEAD_M = 0.25
"""How far ahead on its path a robot looks; shorter oscillates, longer cuts corners by more than the planning margin."""

_STEERING = 0.3  # least turn acceleration x (time over the lookahead)^2 [rad]: with less the robot oscillates
_BRAKING_LOOKAHEADS = 2.0  # braking distance at most, in lookaheads: a bend is seen no earlier
_GRAVITY_M_S2 = 9.81
_GRIP = 0.5  # share of the wheels' grip available to the accelerations: speed commands are steps, twice as fast
CASTERS_AT = 0.75
"""Where the casters are, before and behind the middle, in radii of the hull."""
_HULL_SHARE, _WHEELS_SHARE = 0.9, 0.1  # of the mass


@dataclass(frozen=True, kw_only=True)
class RobotModel:
    """A round differential-drive robot: two driven wheels on one axis through its centre, and ball casters.

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

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name != "name" and not 0 < value < float("inf"):
                raise ValueError(f"{field.name} must be positive and finite, not {value}")
        if self.track_m / 2 + self.wheel_radius_m / 4 > self.radius_m:
            raise ValueError(f"a track of {self.track_m} m puts the wheels outside a hull of radius {self.radius_m} m")
        if self.wheel_radius_m * 2.5 > self.radius_m:
            raise ValueError(f"wheels of radius {self.wheel_radius_m} m are too large for a hull of radius "
                             f"{self.radius_m} m; at most 0.4 of it")
        if self.track_m < self.radius_m / 2:
            raise ValueError(f"a track of {self.track_m} m is too narrow for a hull of radius {self.radius_m} m: it "
                             "would sway about its wheels and not turn by what they do; at least half the radius")
        self._check_grip()

    def _check_grip(self) -> None:
        """Refuse accelerations at which the wheels would slip, so that the robot can't reach them.

        Each wheel bears half the weight, less what braking puts on the casters, and gives half of the force along and
        its share of the moment about the vertical axis; in a curve the turn rate may change at twice the limit.
        """
        grip = _GRIP * _GRAVITY_M_S2 / 2
        lifted = _GRIP * self.wheel_radius_m / (CASTERS_AT * self.radius_m) / 2  # per acceleration along
        along = (0.5 + lifted) * self.acceleration_m_s2
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
        # Physics takes the inertia of the hull's bounding square: (2 r)^2 / 6.
        return _HULL_SHARE * self.radius_m**2 * 2 / 3 + _WHEELS_SHARE * (self.track_m / 2) ** 2

    def figures(self) -> dict[str, float | str]:
        """All figures by name."""
        return asdict(self)


BUILT_IN = {
    # Kobuki base: hull and wheels from its data sheet; accelerations as its navigation stack limits them.
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
}

USUAL_MODEL = "turtlebot2"
"""The built-in robot of proposed missions."""
