"""Robot models: the figures of a differential-drive robot."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np

from sva_bench.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class RobotModel:
    """A round robot with two driven wheels on one axis through its centre, and ball casters.

    Attributes:
        name: Its name.
        radius_m: Radius of the hull.
        wheel_radius_m: Radius of the driven wheels.
        track_m: Distance between the driven wheels.
        mass_kg: Mass of the whole robot.
        max_speed_m_s: Fastest it drives.
        max_turn_rad_s: Fastest it turns on the spot.
        acceleration_m_s2: Greatest acceleration and braking.
        turn_acceleration_rad_s2: Greatest angular acceleration.
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

    @property
    def limits(self) -> FloatArray:
        """Speed [m/s], turn rate [rad/s], acceleration [m/s2], angular acceleration [rad/s2], for compiled code."""
        return np.array([self.max_speed_m_s, self.max_turn_rad_s, self.acceleration_m_s2,
                         self.turn_acceleration_rad_s2])

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
"""The built-in robot of missions that are proposed."""
