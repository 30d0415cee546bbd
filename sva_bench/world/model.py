"""The world as data: obstacles, sites, robots, scenarios and failure processes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from sva_bench.choices import Departures, FailureProcess, Interaction, News, PolicyName, SiteKind
from sva_bench.errors import UnknownName, nearest
from sva_bench.files.printable import counted
from sva_bench.geometry.obstacles import Obstacles
from sva_bench.mission.failures import JointState, Reliability
from sva_bench.robot.model import RobotModel
from sva_bench.world.maps.files import MapFile
from sva_bench.world.noise import Noise, Passage


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place where robots stop.

    Attributes:
        name: Its name; the base is called ``base``.
        kind: Base, refuelling station or point of interest.
        x_m, y_m: Its place [m].
        heading_rad: Heading in which a robot stops there [rad].
        stop_s: Duration of a stop [s].
        charge_rate: Of a station: seconds of driving that a second there fills into the tank, on top of ``stop_s``;
            ``None`` = a stop takes ``stop_s`` alone.
        slots: Of a station: how many robots it serves at once, where robots meet.
    """

    name: str
    kind: SiteKind
    x_m: float
    y_m: float
    heading_rad: float
    stop_s: float = 0.0
    charge_rate: float | None = None
    slots: int = 1


@dataclass(frozen=True, eq=False, kw_only=True)
class UrdfSource:
    """The origin of a robot that is described in URDF.

    Attributes:
        section: The content of its ``model`` in the world file, with defaults.
        file: The URDF, as read.
    """

    section: Mapping[str, str | float]
    file: MapFile


@dataclass(frozen=True, eq=False, kw_only=True)
class Robot:
    """One robot of a mission.

    Attributes:
        name: Its name.
        model: Its figures.
        fuel_capacity_s: Fuel capacity [s of driving]; ``inf`` = no limit.
        mission_limit_s: Longest mission [s]; ``inf`` = no limit.
        availability: Default of its availability in scenarios.
        incentives: Incentive of its visit to each POI, by name.
        mtbf_s: Default of its mean driving time to failure under ``hazard`` [s]; ``None`` = by availability and limit.
        loss_cost: Cost if it leaves the base and doesn't come home [incentive].
        idle_share: Share of the fuel of driving that it burns while it stands.
        urdf: Origin of its model; ``None`` if that is known by its figures.
    """

    name: str
    model: RobotModel
    fuel_capacity_s: float
    mission_limit_s: float
    availability: float
    incentives: Mapping[str, float]
    mtbf_s: float | None = None
    loss_cost: float = 0.0
    idle_share: float = 0.0
    urdf: UrdfSource | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Scenario:
    """Availability of every robot.

    Attributes:
        name: Its name.
        availability: Availability by robot; the marginals of ``joint`` where there is one.
        joint: Joint distribution of the availabilities; ``None`` = independent.
        mtbf_s: Mean driving time to failure under ``hazard`` [s], by robot, of those whose availability doesn't say it.
    """

    name: str
    availability: Mapping[str, float]
    joint: tuple[JointState, ...] | None = None
    mtbf_s: Mapping[str, float] = field(default_factory=dict)

    def reliability(self, robot: Robot) -> Reliability:
        """What a failure process has to know of a robot."""
        return Reliability(availability=self.availability[robot.name], mission_limit_s=robot.mission_limit_s,
                           mtbf_s=self.mtbf_s.get(robot.name), loss_cost=robot.loss_cost)


NOMINAL = "nominal"
"""The scenario of the availabilities under ``robots:``."""


def nominal_of(robots: Sequence[Robot]) -> Scenario:
    """The scenario of the robots' own availabilities and lifetimes."""
    return Scenario(name=NOMINAL, availability={robot.name: robot.availability for robot in robots},
                    mtbf_s={robot.name: robot.mtbf_s for robot in robots if robot.mtbf_s is not None})


@dataclass(frozen=True, kw_only=True)
class WorldReaction:
    """What a team does about failures.

    Attributes:
        policy: What it does about news of one.
        news: When it learns of one; ``never`` under the policy ``none``, which has no use for it.
    """

    policy: PolicyName = "none"
    news: News = "never"


@dataclass(frozen=True, eq=False, kw_only=True)
class MapSource:
    """The origin of a world's occupancy grid.

    Attributes:
        section: The content of ``map:`` in the world file.
        files: Its files, as read.
    """

    section: Mapping[str, Mapping[str, str | float]]
    files: tuple[MapFile, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class World:
    """A mission's world, resolved: every heading computed, every incentive drawn.

    Attributes:
        name: Its name.
        obstacles: Its obstacles.
        sites: Base first, then stations, then POIs.
        robots: The robots.
        scenarios: The scenarios, at least one.
        plan_failure: Failure process that plans are made for.
        execute_failure: Failure process that they are executed under.
        margin: Planning costs are the kinematic twin's times x (1 + margin).
        noise: Noise of the execution.
        map_source: Origin of the occupancy grid; ``None`` if the obstacles are shapes.
        reaction: What the team does about failures, unless a run asks for something else.
        passages: Doors and gates that may be shut.
        interaction: What the robots are to each other.
        departures: When robots that share it leave.
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
    reaction: WorldReaction = WorldReaction()
    passages: tuple[Passage, ...] = ()
    interaction: Interaction = "independent"
    departures: Departures = "together"

    def __repr__(self) -> str:
        counts = ((self.robots, "robot"), (self.pois, "POI"), (self.stations, "station"), (self.scenarios, "scenario"))
        return f"World({self.name}: {', '.join(counted(len(c), what) for c, what in counts)})"

    @property
    def noisy(self) -> bool:
        """Whether rollouts differ."""
        return not self.noise.silent or any(p.wait_s > 0 and 0 < p.blocked < 1 for p in self.passages)

    @property
    def meets(self) -> bool:
        """Whether robots meet: each then leaves from a berth of its own, and so has travel times of its own."""
        return self.interaction != "independent" and len(self.robots) > 1

    def kind_of(self, robot: Robot) -> str:
        """The key of a robot's travel times and costs: its model's name, and its own where robots meet."""
        return robot.name if self.meets else robot.model.name

    @property
    def files(self) -> tuple[MapFile, ...]:
        """The files that it names, each once: of its map, and of its robots."""
        named = [] if self.map_source is None else list(self.map_source.files)
        named += [robot.urdf.file for robot in self.robots if robot.urdf is not None]
        return tuple({file.name: file for file in named}.values())

    def digests(self) -> dict[str, str]:
        """SHA-256 of each of these files, by name: results depend on them besides the world file."""
        return {file.name: hashlib.sha256(file.content).hexdigest() for file in self.files}

    @property
    def stations(self) -> tuple[Site, ...]:
        """The refuelling stations."""
        return tuple(site for site in self.sites if site.kind == "station")

    @property
    def pois(self) -> tuple[Site, ...]:
        """The points of interest."""
        return tuple(site for site in self.sites if site.kind == "poi")

    @property
    def unfit_departures(self) -> bool:
        """Whether departures are to be staggered though nobody coordinates the robots."""
        return self.departures == "staggered" and self.interaction != "shared"

    @property
    def ambiguous_robot(self) -> tuple[str, str] | None:
        """A robot that goes by the name of something else that robots wait for, and what that is; ``None`` = none."""
        others = {**{passage.name: "a passage" for passage in self.passages}, "people": "people in the way",
                  "replanning": "a team that plans anew"} if self.meets else {}
        return next(((robot.name, others[robot.name]) for robot in self.robots if robot.name in others), None)

    def scenario(self, name: str) -> Scenario:
        """The scenario of that name.

        Raises:
            UnknownName: If there is none.
        """
        for scenario in self.scenarios:
            if scenario.name == name:
                return scenario
        raise UnknownName(f"{self.name} has no scenario {name!r}; {nearest(name, [s.name for s in self.scenarios])}")
