"""The world as data: what stands where, who drives, and what may fail."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from sva_bench.arrays import FloatArray, frozen
from sva_bench.geometry.cells import Cells
from sva_bench.mission.failures import FailureProcess, JointState
from sva_bench.robot.model import RobotModel
from sva_bench.seeds import key_of
from sva_bench.world.maps.ros import MapFile

SiteKind = Literal["base", "station", "poi"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Obstacles:
    """Everything that a robot can hit.

    Attributes:
        bounds_m: x_min, y_min, x_max, y_max; walls stand around them. Shape (4,).
        boxes: Centre x, y, half length, half width [m], yaw [rad]; shape (k, 5). Walls are boxes too.
        cylinders: Centre x, y, radius [m]; shape (c, 3).
        cells: The occupancy grid that ``boxes`` cover, where there is one: what it holds, the boxes hold already.
    """

    bounds_m: FloatArray
    boxes: FloatArray
    cylinders: FloatArray
    cells: Cells | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "bounds_m", frozen(self.bounds_m, (4,)))
        object.__setattr__(self, "boxes", frozen(self.boxes, (None, 5)))
        object.__setattr__(self, "cylinders", frozen(self.cylinders, (None, 3)))

    def key(self) -> tuple[int, ...]:
        """Index of random streams that belong to this ground: another ground has others."""
        if self.cells is not None:  # however they are covered by boxes
            cells = self.cells
            return key_of(np.packbits(cells.occupied).tobytes(), repr(cells.occupied.shape),
                          repr(np.append(cells.origin, cells.cell_m).tolist()))
        return key_of(*(repr(part.tolist()) for part in (self.bounds_m, self.boxes, self.cylinders)))

    def walled(self, thickness_m: float) -> Obstacles:
        """The same, with the walls about the bounds as boxes, the first four."""
        x0, y0, x1, y1 = self.bounds_m.tolist()
        cx, cy, hx, hy, t = (x0 + x1) / 2, (y0 + y1) / 2, (x1 - x0) / 2, (y1 - y0) / 2, thickness_m / 2
        walls = [(x0 - t, cy, t, hy + 2 * t, 0.0), (x1 + t, cy, t, hy + 2 * t, 0.0),
                 (cx, y0 - t, hx + 2 * t, t, 0.0), (cx, y1 + t, hx + 2 * t, t, 0.0)]
        return replace(self, boxes=np.concatenate([walls, self.boxes]))


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place where robots stop.

    Attributes:
        name: Its name; the base is called ``base``.
        kind: Base, refuelling station or point of interest.
        x_m, y_m: Where it is.
        heading_rad: Heading in which a robot stops there.
        stop_s: Time that a stop takes.
    """

    name: str
    kind: SiteKind
    x_m: float
    y_m: float
    heading_rad: float
    stop_s: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Robot:
    """One robot of a mission.

    Attributes:
        name: Its name.
        model: Its figures.
        fuel_capacity_s: Driving time on one filling; ``inf`` = no limit.
        mission_limit_s: Longest mission; ``inf`` = no limit.
        availability: Availability where a scenario doesn't say otherwise.
        incentives: What it earns at each POI, by name.
    """

    name: str
    model: RobotModel
    fuel_capacity_s: float
    mission_limit_s: float
    availability: float
    incentives: Mapping[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Scenario:
    """Availability of every robot.

    Attributes:
        name: Its name.
        availability: Availability by robot; the marginals of ``joint`` where there is one.
        joint: Joint distribution of the availabilities; ``None`` = independent.
    """

    name: str
    availability: Mapping[str, float]
    joint: tuple[JointState, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class Noise:
    """What differs from one rollout to the next.

    Attributes:
        wheel_gain_sd: Standard deviation of each wheel's speed gain about 1, drawn per rollout and robot.
    """

    wheel_gain_sd: float = 0.0

    @property
    def silent(self) -> bool:
        """Whether every rollout is the same."""
        return self.wheel_gain_sd == 0


@dataclass(frozen=True, eq=False, kw_only=True)
class MapSource:
    """Where a world's occupancy grid comes from.

    Attributes:
        section: What stands under ``map:`` in the world file.
        files: The files behind it, as they were read.
    """

    section: Mapping[str, Mapping[str, str | float]]
    files: tuple[MapFile, ...]

    def digests(self) -> dict[str, str]:
        """SHA-256 of each file, by name: what results depend on beside the world file."""
        return {file.name: hashlib.sha256(file.content).hexdigest() for file in self.files}


@dataclass(frozen=True, eq=False, kw_only=True)
class World:
    """A mission's world, resolved: every heading computed, every incentive drawn.

    Attributes:
        name: Its name.
        obstacles: What stands in it.
        sites: Base first, then stations, then POIs.
        robots: The robots.
        scenarios: The scenarios, at least one.
        plan_failure: Failure process that plans are made for.
        execute_failure: Failure process that they are executed under.
        margin: Planning costs are twin times x (1 + margin).
        noise: Noise of the execution.
        map_source: Files that the obstacles come from; ``None`` if they are shapes.
    """

    name: str
    obstacles: Obstacles
    sites: tuple[Site, ...]
    robots: tuple[Robot, ...]
    scenarios: tuple[Scenario, ...]
    plan_failure: FailureProcess
    execute_failure: FailureProcess
    margin: float
    noise: Noise
    map_source: MapSource | None = None

    @property
    def stations(self) -> tuple[Site, ...]:
        """The refuelling stations."""
        return tuple(site for site in self.sites if site.kind == "station")

    @property
    def pois(self) -> tuple[Site, ...]:
        """The points of interest."""
        return tuple(site for site in self.sites if site.kind == "poi")

    def scenario(self, name: str) -> Scenario:
        """The scenario of that name."""
        return next(s for s in self.scenarios if s.name == name)
