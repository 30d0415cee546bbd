"""The schema of ``robots.<name>.model`` in world files: a name, figures, or a robot's own description."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from sva_bench.files.fields import Name, Positive, Section
from sva_bench.world.maps.section import FileName

JointName = Annotated[str, Field(min_length=1, max_length=200)]
Radius = Annotated[Positive, Field(ge=0.05, le=5)]
WheelRadius = Annotated[Positive, Field(ge=0.01, le=2)]
Track = Annotated[Positive, Field(ge=0.05, le=10)]
Mass = Annotated[Positive, Field(ge=0.05, le=10_000)]
Speed = Annotated[Positive, Field(ge=0.02, le=20)]
TurnRate = Annotated[Positive, Field(ge=0.05, le=20)]
Acceleration = Annotated[Positive, Field(ge=0.02, le=20)]
TurnAcceleration = Annotated[Positive, Field(ge=0.1, le=100)]


class Figures(Section):
    """Parameters of a robot that isn't built in; ``RobotModel`` checks their combination.

    Smaller hulls, wheels and tracks are below the contact tolerance of physics; with less turn acceleration a robot
    takes a second to correct the heading errors that are allowed at a stop, more than 1 % of many legs.
    """

    radius_m: Radius
    wheel_radius_m: WheelRadius
    track_m: Track
    mass_kg: Mass
    max_speed_m_s: Speed
    max_turn_rad_s: TurnRate
    acceleration_m_s2: Acceleration
    turn_acceleration_rad_s2: TurnAcceleration


class LikeFigures(Section):
    """A built-in robot with other values of some figures."""

    like: Name
    radius_m: Radius | None = None
    wheel_radius_m: WheelRadius | None = None
    track_m: Track | None = None
    mass_kg: Mass | None = None
    max_speed_m_s: Speed | None = None
    max_turn_rad_s: TurnRate | None = None
    acceleration_m_s2: Acceleration | None = None
    turn_acceleration_rad_s2: TurnAcceleration | None = None


class UrdfEntry(Section):
    """A robot described in URDF, which says its shape, masses and wheels, but not how fast it is."""

    urdf: FileName
    left_wheel: JointName
    right_wheel: JointName
    max_speed_m_s: Speed
    max_turn_rad_s: TurnRate = 2.0
    acceleration_m_s2: Acceleration = 0.5
    turn_acceleration_rad_s2: TurnAcceleration = 3.0


def _how_given(data: Any) -> str:
    """The tag of a name, of figures, or of what they start from."""
    if isinstance(data, LikeFigures | UrdfEntry | Figures):
        return {LikeFigures: "[like]", UrdfEntry: "[urdf]", Figures: "[figures]"}[type(data)]
    if not isinstance(data, dict):
        return "[name]"
    return "[urdf]" if "urdf" in data else "[like]" if "like" in data else "[figures]"


ModelEntry = Annotated[
    Annotated[Name, Tag("[name]")] | Annotated[LikeFigures, Tag("[like]")] | Annotated[UrdfEntry, Tag("[urdf]")]
    | Annotated[Figures, Tag("[figures]")], Discriminator(_how_given)]
