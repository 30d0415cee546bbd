"""The body of a robot that has one of its own: solids, masses, and how it stands on its wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sva_bench.choices import SolidKind

GRAVITY_M_S2 = 9.81
CASTER_GAP_M = 0.001
"""Casters touch the floor only when the hull tilts, so the weight rests on the driven wheels."""

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Solid:
    """A convex solid of a robot.

    Attributes:
        kind: What it is.
        size_m: Box: its edges; cylinder: radius, length along z, 0; sphere: radius, 0, 0 [m].
        at_m: Its centre [m].
        rpy_rad: Its roll, pitch and yaw, about fixed axes [rad].
    """

    kind: SolidKind
    size_m: Vector
    at_m: Vector
    rpy_rad: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class OwnBody:
    """The body of a robot: one rigid hull on two driven wheels.

    All is seen from the middle of the axle: x ahead, y to the left, z up.

    Attributes:
        solids: What it touches with, but for the driven wheels on the floor.
        base_kg: Mass of all but the driven wheels [kg].
        centre_m: Centre of that mass [m].
        inertia_kg_m2: Its inertia about that centre: ixx, ixy, ixz, iyy, iyz, izz [kg m2].
        wheel_kg: Mass of the left and the right wheel [kg].
        spin_kg_m2: Inertia of each wheel about the axle [kg m2].
        across_kg_m2: Inertia of each wheel about its diameter [kg m2].
        front_m, rear_m: How far ahead of and behind the axle it stands on the floor when it tilts; 0 = not at all [m].
    """

    solids: tuple[Solid, ...]
    base_kg: float
    centre_m: Vector
    inertia_kg_m2: tuple[float, float, float, float, float, float]
    wheel_kg: tuple[float, float]
    spin_kg_m2: float
    across_kg_m2: float
    front_m: float
    rear_m: float

    @property
    def mass_kg(self) -> float:
        """Mass of the whole robot [kg]."""
        return self.base_kg + sum(self.wheel_kg)

    def centre_of_all_m(self, track_m: float) -> Vector:
        """Centre of mass of the whole robot [m]."""
        share = self.base_kg / self.mass_kg
        x, y, z = self.centre_m
        aside = (self.wheel_kg[0] - self.wheel_kg[1]) * track_m / 2 / self.mass_kg
        return share * x, share * y + aside, share * z

    def turn_inertia_m2(self, track_m: float) -> float:
        """Moment of inertia about the vertical axis through the middle of the axle, per mass [m2]."""
        x, y, _ = self.centre_m
        wheels = sum(self.wheel_kg) * (track_m / 2) ** 2 + 2 * self.across_kg_m2
        return (self.inertia_kg_m2[5] + self.base_kg * (x * x + y * y) + wheels) / self.mass_kg

    def wheel_load(self, track_m: float, wheel_radius_m: float, acceleration_m_s2: float) -> float:
        """Least load of a driven wheel when the robot accelerates or brakes so, per mass [m/s2]; negative = it tips."""
        x, y, z = self.centre_of_all_m(track_m)
        lower = math.inf
        for towards in (acceleration_m_s2, -acceleration_m_s2):  # braking throws the weight ahead
            moment = GRAVITY_M_S2 * x + towards * (z + wheel_radius_m)
            reach = self.front_m if moment > 0 else self.rear_m
            borne = 0.0 if moment == 0 else abs(moment) / reach if reach > 0 else math.inf
            lower = min(lower, GRAVITY_M_S2 - borne)
        return lower * (0.5 - abs(y) / track_m) if lower > 0 else lower
